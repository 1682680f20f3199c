//! Beads in two fluids: the same on 1, 2 and 3 ranks, and a run that is two runs.

use fibreflow_tests::program::Bench;
use fibreflow_tests::state::State;

const NODES: usize = 48 * 37;

fn bench() -> Bench {
    Bench::new(
        env!("CARGO_BIN_EXE_program"),
        include_str!("../src/beads.toml"),
    )
}

/// None where there is no `mpirun`.
fn run(bench: &Bench, ranks: usize, out: &str, more: &[&str]) -> Option<State> {
    let ended = bench.run(ranks, out, more)?;
    assert!(ended.status.success(), "{}", ended.text);
    Some(State::of(&bench.path(out), NODES))
}

/// What is saved of the beads.
fn beads(state: &State) -> Vec<f64> {
    let saved = state.snapshot.scalars.iter();
    let found: Vec<f64> = saved
        .filter(|(name, _)| name.contains("bead"))
        .map(|(_, value)| *value)
        .collect();
    assert!(found.len() > 5 * 6);
    found
}

#[test]
fn beads_do_not_depend_on_the_ranks() {
    let bench = bench();
    let one = run(&bench, 1, "one", &["--steps=8"]).expect("one rank needs no mpirun");
    for ranks in [2, 3] {
        let Some(several) = run(&bench, ranks, "several", &["--steps=8"]) else {
            return;
        };
        let (a, b) = (beads(&one), beads(&several));
        let off = a.iter().zip(&b).map(|(a, b)| (a - b).abs());
        let off = off.fold(0.0, f64::max);
        let [velocity, _] = one.difference(&several);
        println!("{ranks} ranks: beads {off:.1e}, velocity {velocity:.1e}");
        assert!(off < 1e-6 && velocity < 1e-6);
    }
}

#[test]
fn one_run_of_beads_is_two_runs() {
    let bench = bench();
    for ranks in [1, 2] {
        if run(&bench, ranks, "parts", &["--steps=6"]).is_none() {
            return;
        }
        let parts = run(&bench, ranks, "parts", &["--steps=13", "--resume"]).expect("was there");
        let straight = run(&bench, ranks, "straight", &["--steps=13"]).expect("was there");
        let different = straight.bits_that_differ(&parts);
        assert!(different.is_empty(), "on {ranks} ranks: {different:?}");
        assert!(beads(&straight).iter().any(|x| *x != 0.0));
    }
}
