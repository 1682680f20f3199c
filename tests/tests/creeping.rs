//! Flow without convection, from the case file: chosen by the Reynolds number, right, the same on any ranks, restartable.

use fibreflow_tests::program::Bench;
use fibreflow_tests::state::State;

const CHANNEL: &str = include_str!("../src/channel.toml");
const NODES: usize = 8 * 11 * 6;

fn bench(case: &str) -> Bench {
    Bench::new(env!("CARGO_BIN_EXE_program"), case)
}

/// The same coupled channel so slow, viscous and light that fibres and flow creep.
fn creeping(inertia: &str) -> Bench {
    let case = CHANNEL
        .replace(
            "viscosity = 0.01",
            &format!("viscosity = 10.0\ninertia = \"{inertia}\""),
        )
        .replace("0.5, 0.0, 0.0", "1e-4, 0.0, 0.0")
        .replace("value = 0.5", "value = 1e-4")
        .replace("perturbed-channel", "poiseuille")
        .replace(", intensity = 0.2, seed = 3", "")
        .replace("max_step = 1e-3", "max_step = 0.1")
        .replace("tolerance = 1e-12", "tolerance = 1e-10")
        .replace("density = 1200.0", "density = 1000.0")
        .replace("stiffness = 1.0", "stiffness = 1e-3");
    bench(&case)
}

fn run(bench: &Bench, ranks: usize, out: &str, arguments: &[&str]) -> Option<String> {
    let ended = bench.run(ranks, out, arguments)?;
    assert!(ended.status.success(), "{}", ended.text);
    Some(ended.text)
}

#[test]
fn a_slow_suspension_creeps_on_any_ranks_and_after_a_restart() {
    for (inertia, shown) in [
        ("auto", "inertia linear (unsteady Stokes flow): Re = 0."),
        ("steady", "inertia none (steady Stokes flow): as set"),
    ] {
        let bench = creeping(inertia);
        let text = run(&bench, 1, "one", &["--steps", "2"]).expect("one rank needs no mpirun");
        assert!(text.contains(shown), "{text}");
        let one = State::of(&bench.path("one"), NODES);
        run(&bench, 1, "parts", &["--steps", "1"]);
        run(&bench, 1, "parts", &["--steps", "2", "--resume"]);
        let parts = State::of(&bench.path("parts"), NODES);
        assert_eq!(one.bits_that_differ(&parts), Vec::<String>::new());
        for ranks in [2, 3] {
            let name = format!("ranks-{ranks}");
            let Some(_) = run(&bench, ranks, &name, &["--steps", "2"]) else {
                return;
            };
            let [velocity, fibres] = one.difference(&State::of(&bench.path(&name), NODES));
            println!("{inertia}, {ranks} ranks: velocity {velocity:.2e}, fibres {fibres:.2e}");
            assert!(velocity < 1e-8 && fibres < 1e-8);
        }
    }
}

const POISEUILLE: &str = r#"[time]
end = 1e-6
step = 1e-6

[mesh]
kind = "box"
origin = [0.0, -1.0, 0.0]
size = [0.5, 2.0, 0.25]
cells = [2, 16, 1]
stretching = ["uniform", { tanh = 2.0 }, "uniform"]
periodic = [true, false, true]

[fluid]
density = 1.0
viscosity = 0.5
inertia = "steady"
forcing = { kind = "pressure-gradient", value = [1.0, 0.0, 0.0] }
poisson = { tolerance = 1e-12 }

[fluid.boundaries]
y_min = { kind = "wall" }
y_max = { kind = "wall" }

[output.loads]

[exact]
kind = "poiseuille"
"#;

#[test]
fn a_steady_flow_is_there_in_one_step_of_any_length() {
    let bench = bench(POISEUILLE);
    run(&bench, 1, "out", &[]);
    let summary = bench.summary("out");
    let error = summary["errors"]["velocity_max"].as_f64().expect("error");
    let force = summary["fluid"]["loads"]["y_min"]["viscous"][0]
        .as_f64()
        .expect("force");
    println!("velocity {error:.1e}, force of a wall {force}");
    // Half of G V to each wall.
    assert!(error < 1e-9 && (force - 0.125).abs() < 1e-9);
}

/// Without convection nothing but the Reynolds number tells the flows apart.
#[test]
fn linear_and_full_flow_are_the_same_where_it_is_slow() {
    let case = r#"[time]
end = 0.4
step = 0.01

[mesh]
kind = "box"
size = [1.0, 1.0, 0.25]
cells = [10, 10, 1]
periodic = [false, false, true]

[fluid]
density = 1.0
viscosity = 1.0
inertia = "linear"
poisson = { tolerance = 1e-10 }

[fluid.boundaries]
x_min = { kind = "wall" }
x_max = { kind = "wall" }
y_min = { kind = "wall" }
y_max = { kind = "moving-wall", velocity = [1e-3, 0, 0], factor = { kind = "formula", value = "1 - exp(-10*t)" } }
"#;
    let bench = bench(case);
    let energy = |inertia: &str, cells: usize| {
        let set = [
            format!("fluid.inertia={inertia}"),
            format!("mesh.cells=[{cells}, {cells}, 1]"),
        ];
        run(&bench, 1, "out", &["--set", &set[0], "--set", &set[1]]);
        let energy = bench.summary("out")["fluid"]["kinetic_energy"].as_f64();
        energy.expect("energy")
    };
    // The corners of the lid are singular, and the full flow moves what cannot be balanced there: the two discretisations
    // are apart by the spacing.
    let apart = [20, 40].map(|cells| {
        let (linear, full) = (energy("linear", cells), energy("full", cells));
        println!("{cells}²: energies {linear:e}, {full:e}");
        (linear / full - 1.0).abs()
    });
    assert!(apart[0] < 0.025 && apart[1] < 0.5 * apart[0], "{apart:?}");
}
