//! Two fluids: the order parameter on 1, 2 and 3 ranks, and a run that is two runs.

use fibreflow_tests::program::Bench;
use fibreflow_tests::state::State;

const NODES: usize = 8 * 11 * 6;

/// A drop on a fixed solid, carried along by the channel.
const SETTINGS: [&str; 7] = [
    "--set=phase.surface_tension=0.02",
    "--set=phase.interface_width=1e-3",
    "--set=phase.diffusivity=1e-4",
    "--set=phase.initial=\"tanh((0.002 - sqrt((x - 0.004)^2 + (y - 0.004)^2 + (z - 0.003)^2)) / 0.0014)\"",
    "--set=phase.solid={ fraction = \"0.5 - 0.5 * tanh((abs(x - 0.004) - 0.001) / 0.0014)\", psi_0 = 0.3 }",
    "--set=phase.decay=0.02",
    "--set=phase.tolerance=1e-11",
];

fn bench() -> Bench {
    Bench::new(
        env!("CARGO_BIN_EXE_program"),
        include_str!("../src/channel.toml"),
    )
}

/// None where there is no `mpirun`.
fn run(bench: &Bench, ranks: usize, out: &str, more: &[&str]) -> Option<State> {
    let arguments: Vec<&str> = SETTINGS.iter().chain(more).copied().collect();
    let ended = bench.run(ranks, out, &arguments)?;
    assert!(ended.status.success(), "{}", ended.text);
    Some(State::of(&bench.path(out), NODES))
}

fn psi(state: &State) -> &[f64] {
    let mut fields = state.snapshot.node_fields.iter();
    let found = fields.find(|f| f.name == "phase.order_parameter");
    &found.expect("order parameter").values
}

#[test]
fn the_order_parameter_does_not_depend_on_the_ranks() {
    let bench = bench();
    for element in ["hexahedron", "tetrahedron"] {
        let element = format!("--set=mesh.element={element}");
        let more = ["--steps=20", &element];
        let one = run(&bench, 1, "one", &more).expect("one rank needs no mpirun");
        for ranks in [2, 3] {
            let Some(several) = run(&bench, ranks, "several", &more) else {
                return;
            };
            let pairs = psi(&one).iter().zip(psi(&several));
            let off = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            let [velocity, fibres] = one.difference(&several);
            println!(
                "{element}, {ranks} ranks: ψ {off:.1e}, velocity {velocity:.1e}, fibres {fibres:.1e}"
            );
            assert!(off < 1e-8 && velocity < 1e-7 && fibres < 1e-7);
        }
    }
}

#[test]
fn one_run_of_two_fluids_is_two_runs() {
    let bench = bench();
    for ranks in [1, 2] {
        if run(&bench, ranks, "parts", &["--steps=6"]).is_none() {
            return;
        }
        let parts = run(&bench, ranks, "parts", &["--steps=11", "--resume"]).expect("was there");
        let straight = run(&bench, ranks, "straight", &["--steps=11"]).expect("was there");
        let different = straight.bits_that_differ(&parts);
        assert!(different.is_empty(), "on {ranks} ranks: {different:?}");
    }
}
