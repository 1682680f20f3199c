//! Isotropic turbulence: series and spectra do not depend on the ranks, a restart goes on with them, and what makes no sense is refused.

use fibreflow_tests::program::Bench;
use fibreflow_tests::state::State;

const CASE: &str = r#"[time]
end = 10.0
cfl = 0.5
max_step = 0.1

[mesh]
kind = "box"
size = [1.0, 1.0, 1.0]
cells = [12, 12, 12]
periodic = [true, true, true]

[fluid]
density = 1000.0
viscosity = 2.0
forcing = { kind = "linear", rate = 2.0 }
initial = { kind = "isotropic", intensity = 1.0, wavelength = 0.5, seed = 3 }
turbulence = { model = "wale" }

[output]
turbulence = { every = 2 }
"#;

fn bench() -> Bench {
    Bench::new(env!("CARGO_BIN_EXE_program"), CASE)
}

/// Numbers of a series, line by line.
fn series(bench: &Bench, out: &str, name: &str) -> Vec<Vec<f64>> {
    let text = std::fs::read_to_string(bench.path(out).join("series").join(name)).expect("series");
    let numbers = |line: &str| {
        line.split(',')
            .map(|v| v.parse().expect("number"))
            .collect()
    };
    text.lines().skip(1).map(numbers).collect()
}

#[test]
fn series_and_spectra_do_not_depend_on_the_ranks() {
    for (kind, arguments) in [
        (
            "fourth order",
            &["--set=fluid.order=4", "--set=output.spectrum.every=4"][..],
        ),
        ("tetrahedra", &["--set=mesh.element=tetrahedron"]),
    ] {
        let bench = bench();
        let arguments = [arguments, &["--steps=8"]].concat();
        let run = |ranks: usize| {
            let name = format!("ranks-{ranks}");
            let ended = bench.run(ranks, &name, &arguments)?;
            assert!(ended.status.success(), "{}", ended.text);
            let state = State::of(&bench.path(&name), 12 * 12 * 12);
            let mut lines = series(&bench, &name, "turbulence.csv");
            if arguments.iter().any(|a| a.contains("spectrum")) {
                lines.extend(series(&bench, &name, "spectrum.csv"));
            }
            Some((state, lines))
        };
        let (state, lines) = run(1).expect("one rank needs no mpirun");
        for ranks in [2, 3, 4] {
            let Some((other, others)) = run(ranks) else {
                return;
            };
            let [velocity, _] = state.difference(&other);
            let off = |(a, b): (&Vec<f64>, &Vec<f64>)| {
                let largest = a[2..].iter().fold(0.0f64, |m, v| m.max(v.abs()));
                let pairs = a[1..].iter().zip(&b[1..]);
                pairs.fold(0.0f64, |m, (a, b)| m.max((a - b).abs() / largest))
            };
            assert_eq!(lines.len(), others.len());
            let off = lines.iter().zip(&others).map(off).fold(0.0, f64::max);
            println!("{kind}, {ranks} ranks: velocity {velocity:.1e}, series {off:.1e}");
            assert!(velocity < 1e-8 && off < 1e-8);
        }
    }
}

#[test]
fn a_restart_goes_on_with_the_series() {
    let bench = bench();
    let run = |name: &str, steps: &str, more: &[&str]| {
        let set = [
            "--set=fluid.order=4",
            "--set=output.spectrum.every=3",
            steps,
        ];
        let ended = bench.run(1, name, &[&set[..], more].concat());
        let ended = ended.expect("one rank needs no mpirun");
        assert!(ended.status.success(), "{}", ended.text);
    };
    run("whole", "--steps=9", &["--set=output.checkpoint.every=6"]);
    run("parts", "--steps=6", &[]);
    run("parts", "--steps=9", &["--resume"]);
    for name in ["turbulence.csv", "spectrum.csv"] {
        let [whole, parts] = ["whole", "parts"].map(|out| series(&bench, out, name));
        assert!(whole.len() > 3 && whole == parts, "{name}");
    }
}

#[test]
fn what_needs_periodic_boxes_is_refused_without() {
    let walls = [
        "--set=mesh.periodic=[true, false, true]",
        "--set=fluid.boundaries.y_min.kind=wall",
        "--set=fluid.boundaries.y_max.kind=wall",
    ];
    let at_rest = "--set=fluid.initial={ kind = \"rest\" }";
    let undriven = "--set=fluid.forcing={ kind = \"none\" }";
    let spectrum = "--set=output.spectrum.every=1";
    for (arguments, wanted) in [
        (&[&walls[..], &[at_rest]].concat()[..], "fluid.forcing.kind"),
        (&[&walls[..], &[undriven]].concat(), "fluid.initial.kind"),
        (
            &[&walls[..], &[undriven, at_rest, spectrum]].concat(),
            "output.spectrum",
        ),
        (&[spectrum, "--set=mesh.element=prism"], "output.spectrum"),
        (&["--set=fluid.inertia=linear"], "fluid.turbulence"),
        (
            &["--set=fluid.turbulence.constant=0"],
            "fluid.turbulence.constant",
        ),
        (&["--set=fluid.turbulence.model=les"], "smagorinsky"),
        (
            &["--set=output.turbulence.interval=1.0"],
            "output.turbulence",
        ),
    ] {
        let ended = bench().run(1, "out", &[arguments, &["--steps=1"]].concat());
        let ended = ended.expect("one rank needs no mpirun");
        assert_eq!(
            ended.status.code(),
            Some(2),
            "{arguments:?}: {}",
            ended.text
        );
        assert!(
            ended.text.contains(wanted),
            "no `{wanted}` in:\n{}",
            ended.text
        );
    }
}
