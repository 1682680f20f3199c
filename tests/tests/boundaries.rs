//! Boundary conditions of the case file do what they say: plug flows whose answer is known at every step.

use fibreflow_tests::program::Bench;
use std::f64::consts::TAU;

/// A duct along x between slip planes: a plug flow, so that its mean velocity tells all.
fn duct(x_min: &str, x_max: &str) -> Bench {
    let case = format!(
        r#"[time]
end = 0.5
step = 0.01

[mesh]
kind = "box"
size = [2.0, 1.0, 0.5]
cells = [6, 4, 2]

[fluid]
density = 2.0
viscosity = 0.1
poisson.tolerance = 1e-11

[fluid.boundaries]
x_min = {x_min}
x_max = {x_max}
y_min = {{ kind = "slip" }}
y_max = {{ kind = "slip" }}
z_min = {{ kind = "slip" }}
z_max = {{ kind = "slip" }}
"#
    );
    Bench::new(env!("CARGO_BIN_EXE_program"), &case)
}

/// (time, value) of a column of `series/fluid.csv`.
fn series(bench: &Bench, out: &str, column: &str) -> Vec<(f64, f64)> {
    let path = bench.path(out).join("series/fluid.csv");
    let text = std::fs::read_to_string(path).expect("series");
    let mut lines = text.lines();
    let header = lines.next().expect("header");
    let index = header.split(',').position(|c| c == column).expect("column");
    let pair = |line: &str| {
        let numbers: Vec<f64> = line
            .split(',')
            .map(|v| v.parse().expect("number"))
            .collect();
        (numbers[1], numbers[index])
    };
    lines.map(pair).collect()
}

fn run(bench: &Bench, out: &str) -> Vec<(f64, f64)> {
    let ended = bench.run(1, out, &[]).expect("one rank needs no mpirun");
    assert!(ended.status.success(), "{}", ended.text);
    series(bench, out, "bulk_velocity_x")
}

/// Largest difference from a function of time.
fn off(found: &[(f64, f64)], wanted: impl Fn(f64) -> f64) -> f64 {
    let apart = found.iter().map(|(t, u)| (u - wanted(*t)).abs());
    apart.fold(0.0, f64::max)
}

#[test]
fn an_inlet_follows_its_table_through_either_outlet() {
    let inlet = r#"{ kind = "inlet", velocity = [3, 0, 0], factor = { kind = "table", times = [0, 0.2, 0.3], values = [1, 2, 0.5] } }"#;
    let wanted = |t: f64| {
        if t < 0.2 {
            3.0 + 15.0 * t
        } else {
            6.0 - 45.0 * (t - 0.2).min(0.1)
        }
    };
    for outlet in ["outlet", "convective-outlet"] {
        let bench = duct(inlet, &format!("{{ kind = \"{outlet}\" }}"));
        let found = run(&bench, outlet);
        assert_eq!(found.len(), 51);
        // A kink of the table costs nodes 45 m/s² times a part of a step; elsewhere they are of second order.
        let apart = off(&found, wanted);
        println!("{outlet}: {apart:.1e} m/s");
        assert!(apart < 0.1 * 0.45, "{outlet}: {apart}");
    }
}

#[test]
fn tables_in_files_are_those_in_the_case() {
    let inlet =
        |factor: &str| format!("{{ kind = \"inlet\", velocity = [1, 0, 0], factor = {factor} }}");
    let inline =
        inlet("{ kind = \"table\", times = [0, 0.1, 0.2], values = [1, 3, 1], periodic = true }");
    let file = inlet("{ kind = \"file\", file = \"pulse.csv\", periodic = true }");
    let outlet = "{ kind = \"outlet\" }";
    let expected = run(&duct(&inline, outlet), "inline");
    let bench = duct(&file, outlet);
    std::fs::write(bench.path("pulse.csv"), "time,value\n0,1\n0.1,3\n0.2,1\n").expect("file");
    assert_eq!(run(&bench, "file"), expected);
    // Half-way up to the second of three peaks.
    assert!((expected[25].1 - 2.0).abs() < 1e-3, "{:?}", expected[25]);
}

/// ρ L dū/dt = p(0) − p(L) with p(0) = P cos ωt, so slow that the kinetic energy that inflow does not bring is nothing.
#[test]
fn a_pressure_that_oscillates_moves_the_plug() {
    let ends = |formula: &str| {
        format!(
            "{{ kind = \"outlet\", pressure = 8e-3, factor = {{ kind = \"formula\", value = \"{formula}\" }} }}"
        )
    };
    let bench = duct(&ends("cos(2*pi*t/0.4)"), "{ kind = \"outlet\" }");
    let omega = TAU / 0.4;
    let amplitude = 8e-3 / (2.0 * 2.0 * omega);
    let apart = ["0.01", "0.005"].map(|step| {
        let ended = bench.run(1, step, &["--set", &format!("time.step={step}")]);
        assert!(ended.is_some_and(|e| e.status.success()));
        let found = series(&bench, step, "bulk_velocity_x");
        off(&found, |t| amplitude * (omega * t).sin()) / amplitude
    });
    println!("off by {apart:?} of the amplitude");
    assert!(apart[0] < 5e-3 && apart[1] < apart[0] / 3.0, "{apart:?}");
}

/// ρ dū/dt = G cos ωt, with and without convection.
#[test]
fn a_gradient_that_oscillates_moves_the_plug() {
    let bench = duct("OPEN", "OPEN");
    let text = std::fs::read_to_string(bench.path("case.toml")).expect("case");
    let text = text.replace("x_min = OPEN\nx_max = OPEN\n", "");
    let forcing = "forcing = { kind = \"pressure-gradient\", value = [4, 0, 0], factor = { kind = \"formula\", value = \"cos(2*pi*t/0.4)\" } }";
    let text = text.replace("cells", "periodic = [true, false, false]\ncells");
    let text = text.replace("viscosity", &format!("{forcing}\nviscosity"));
    std::fs::write(bench.path("case.toml"), text).expect("case");
    let omega = TAU / 0.4;
    let amplitude = 4.0 / (2.0 * omega);
    for inertia in ["full", "linear"] {
        let apart = ["0.01", "0.005"].map(|step| {
            let out = format!("{inertia}-{step}");
            let set = [
                format!("time.step={step}"),
                format!("fluid.inertia={inertia}"),
            ];
            let ended = bench.run(1, &out, &["--set", &set[0], "--set", &set[1]]);
            let ended = ended.expect("one rank needs no mpirun");
            assert!(ended.status.success(), "{}", ended.text);
            let found = series(&bench, &out, "bulk_velocity_x");
            off(&found, |t| amplitude * (omega * t).sin()) / amplitude
        });
        println!("{inertia}: off by {apart:?} of the amplitude");
        // (ωΔt)²/24 of the midpoint rule.
        assert!(apart[0] < 1.1e-3 && apart[1] < apart[0] / 3.5, "{apart:?}");
    }
}

#[test]
fn a_profile_is_the_same_as_formula_and_as_file() {
    let outlet = "{ kind = \"outlet\" }";
    let linear = "{ kind = \"inlet\", profile = { formula = [\"1 + y - 0.5*z\", \"0\", \"0\"] } }";
    let expected = run(&duct(linear, outlet), "formula");
    let file = duct(
        "{ kind = \"inlet\", profile = { file = \"inlet.csv\" } }",
        outlet,
    );
    // Points of another spacing than the mesh, in no order; the profile is linear.
    let mut text = String::from("z,y,u\n");
    for k in 0..35 {
        let (y, z) = (f64::from(k * 3 % 7) / 6.0, f64::from(k % 5) / 8.0);
        text += &format!("{z},{y},{}\n", 1.0 + y - 0.5 * z);
    }
    std::fs::write(file.path("inlet.csv"), text).expect("file");
    let found = run(&file, "file");
    let apart = found.iter().zip(&expected).map(|(a, b)| (a.1 - b.1).abs());
    let apart = apart.fold(0.0, f64::max);
    assert!(apart < 1e-7, "{apart}");
    // Flow through: ∫ (1 + y − z/2) over 1 × ½ by its area.
    assert!((expected[50].1 - 1.375).abs() < 1e-3, "{:?}", expected[50]);
}

/// A square duct with walls all around: what comes in has the mean velocity asked for, and nothing at the walls.
#[test]
fn a_parabola_between_four_walls_keeps_its_mean() {
    let walls = |text: String| {
        text.replace("\"slip\"", "\"wall\"")
            .replace("[6, 4, 2]", "[8, 12, 12]")
    };
    let bench = duct(
        "{ kind = \"inlet\", velocity = [1, 0, 0], profile = \"parabolic\" }",
        "{ kind = \"outlet\" }",
    );
    let text = std::fs::read_to_string(bench.path("case.toml")).expect("case");
    std::fs::write(bench.path("case.toml"), walls(text)).expect("case");
    let found = run(&bench, "out");
    // Trapezoidal rule on 12 cells: 1 − 1/12² in each direction.
    let exact = (1.0 - 1.0 / 144.0_f64).powi(2);
    assert!((found[50].1 - exact).abs() < 1e-3, "{:?}", found[50]);
}

/// A plate that turns in its own plane drags the fluid along: no net momentum, and more energy with either sign.
#[test]
fn a_turning_plate_spins_the_fluid_up() {
    let bench = duct("{ kind = \"wall\" }", "{ kind = \"wall\" }");
    let text = std::fs::read_to_string(bench.path("case.toml")).expect("case");
    let plate = "y_min = { kind = \"rotating-wall\", point = [1.0, 0.0, 0.25], axis = [0, 2, 0], rate = 4.0, factor = { kind = \"formula\", value = \"sign*t\" } }";
    let text = text.replace("y_min = { kind = \"slip\" }", plate);
    let energy = [1.0, -1.0].map(|sign| {
        let case = text.replace("sign", &format!("{sign}"));
        std::fs::write(bench.path("case.toml"), case).expect("case");
        let out = format!("out{sign}");
        let momentum = run(&bench, &out);
        assert!(off(&momentum, |_| 0.0) < 1e-6);
        series(&bench, &out, "kinetic_energy")
    });
    let last = energy.each_ref().map(|e| e[50].1);
    assert!(
        last[0] > 1e-3 && (last[0] / last[1] - 1.0).abs() < 1e-6,
        "{last:?}"
    );
    assert!(energy[0].windows(2).all(|w| w[1].1 > w[0].1));
}
