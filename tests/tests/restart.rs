//! A run that was killed goes on bit by bit on the same ranks, and to tolerance on others; a run that is told to stop
//! leaves a checkpoint.

use fibreflow_tests::program::{Bench, LIMIT};
use fibreflow_tests::state::State;
use std::time::{Duration, Instant};

const NODES: usize = 8 * 11 * 6;

fn bench() -> Bench {
    Bench::new(
        env!("CARGO_BIN_EXE_program"),
        include_str!("../src/channel.toml"),
    )
}

/// Starts a long run and kills it once it has a checkpoint; None where there is no `mpirun`.
fn killed(bench: &Bench, ranks: usize, out: &str) -> Option<()> {
    let job = bench.start(ranks, out, &["--steps", "100000"])?;
    wait_for(|| has_checkpoint(bench, out), || job.text());
    job.signal("KILL");
    assert!(!job.wait(LIMIT).status.success());
    if ranks > 1 {
        // The ranks notice a moment later that their mpirun is gone.
        std::thread::sleep(Duration::from_secs(2));
    }
    Some(())
}

fn has_checkpoint(bench: &Bench, out: &str) -> bool {
    let entries = std::fs::read_dir(bench.path(out).join("checkpoint"));
    let mut complete = entries.into_iter().flatten().filter_map(Result::ok);
    complete.any(|e| e.path().join("index.json").exists())
}

fn wait_for(condition: impl Fn() -> bool, text: impl Fn() -> String) {
    let start = Instant::now();
    while !condition() {
        assert!(start.elapsed() < LIMIT, "{}", text());
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Runs to its end, from the start or from a checkpoint.
fn finished(bench: &Bench, ranks: usize, out: &str, steps: u64, resume: bool) -> State {
    let steps = steps.to_string();
    let mut arguments = vec!["--steps", &steps];
    if resume {
        arguments.push("--resume");
    }
    let ended = bench.run(ranks, out, &arguments).expect("mpirun was there");
    assert!(ended.status.success(), "{}", ended.text);
    assert_eq!(
        ended.text.contains("resumed at step"),
        resume,
        "{}",
        ended.text
    );
    State::of(&bench.path(out), NODES)
}

fn a_killed_run_goes_on_bit_by_bit(ranks: usize) -> Option<()> {
    let bench = bench();
    killed(&bench, ranks, "killed")?;
    let saved = State::of(&bench.path("killed"), NODES).snapshot.step;
    // Not a multiple of anything, so that no schedule hides a difference.
    let end = saved + 7;
    let resumed = finished(&bench, ranks, "killed", end, true);
    let straight = finished(&bench, ranks, "straight", end, false);
    assert_eq!(resumed.snapshot.step, end);
    let different = straight.bits_that_differ(&resumed);
    assert!(
        different.is_empty(),
        "from step {saved} to {end}: {different:?}"
    );

    for file in ["orientation", "shape", "fibres"] {
        let series = |name: &str| {
            let path = bench.path(name).join(format!("series/{file}.csv"));
            std::fs::read_to_string(path).expect("series")
        };
        let (killed, straight) = (series("killed"), series("straight"));
        assert_eq!(killed, straight, "the series {file} has a seam");
    }
    Some(())
}

#[test]
fn killed_on_one_rank() {
    a_killed_run_goes_on_bit_by_bit(1);
}

#[test]
fn killed_on_two_ranks() {
    a_killed_run_goes_on_bit_by_bit(2);
}

/// Symptom: friction springs of fibres that had just changed owner were missing in the checkpoint of that step (32).
#[test]
fn one_run_is_three_runs() {
    let bench = bench();
    for ranks in [1, 2] {
        let name = |what: &str| format!("{what}-{ranks}");
        let steps = ["--steps", "32"];
        let Some(first) = bench.run(ranks, &name("parts"), &steps) else {
            return;
        };
        assert!(first.status.success(), "{}", first.text);
        finished(&bench, ranks, &name("parts"), 33, true);
        let parts = finished(&bench, ranks, &name("parts"), 40, true);
        let straight = finished(&bench, ranks, &name("straight"), 40, false);
        let different = straight.bits_that_differ(&parts);
        assert!(different.is_empty(), "on {ranks} ranks: {different:?}");
    }
}

#[test]
fn a_run_of_fourth_order_is_two_runs() {
    let bench = bench();
    let common = [
        "--set=fluid.order=4",
        "--set=mesh.cells=[12, 12, 10]",
        "--set=fluid.poisson.solves_per_step=3",
    ];
    let run = |ranks: usize, out: &str, more: &[&str]| {
        let arguments: Vec<&str> = common.iter().chain(more).copied().collect();
        let ended = bench.run(ranks, out, &arguments)?;
        assert!(ended.status.success(), "{}", ended.text);
        Some(State::of(&bench.path(out), 12 * 13 * 10))
    };
    for ranks in [1, 2] {
        let name = |what: &str| format!("{what}-{ranks}");
        let Some(_) = run(ranks, &name("parts"), &["--steps=6"]) else {
            return;
        };
        let parts = run(ranks, &name("parts"), &["--steps=10", "--resume"]).expect("was there");
        let straight = run(ranks, &name("straight"), &["--steps=10"]).expect("was there");
        let different = straight.bits_that_differ(&parts);
        assert!(different.is_empty(), "on {ranks} ranks: {different:?}");
    }
}

#[test]
fn resumed_on_other_ranks() {
    let bench = bench();
    let Some(()) = killed(&bench, 2, "killed") else {
        return;
    };
    let saved = State::of(&bench.path("killed"), NODES).snapshot.step;
    let straight = finished(&bench, 1, "straight", saved + 8, false);
    let resumed = finished(&bench, 3, "killed", saved + 8, true);
    let [velocity, fibres] = straight.difference(&resumed);
    assert!(
        velocity < 1e-8 && fibres < 1e-8,
        "velocity {velocity:e}, fibres {fibres:e}"
    );
}

#[test]
fn a_run_that_is_told_to_stop_saves_and_ends_well() {
    stopped(1, "TERM");
    // On SIGTERM mpirun itself ends badly, however well its ranks end.
    stopped(2, "USR1");
}

/// Symptom: means over a run that was stopped and gone on with counted the step of the stop once more than others.
#[test]
fn a_stop_on_the_way_leaves_no_line_of_its_own() {
    let bench = bench();
    let run = |out: &str, more: &[&str]| {
        let schedules = [
            "--set=output.series.every=5",
            "--set=output.observables.every=5",
        ];
        let arguments: Vec<&str> = schedules.iter().chain(more).copied().collect();
        let ended = bench.run(1, out, &arguments).expect("one rank");
        assert!(ended.status.success(), "{}", ended.text);
    };
    run(
        "parts",
        &["--steps=12", "--set=output.wall_time_limit=1e-9"],
    );
    assert_eq!(bench.summary("parts")["steps"], 1);
    run("parts", &["--steps=12", "--resume"]);
    run("whole", &["--steps=12"]);
    for file in ["orientation", "shape", "fibres", "fluid"] {
        let steps = |out: &str| -> Vec<u64> {
            let path = bench.path(out).join(format!("series/{file}.csv"));
            let text = std::fs::read_to_string(path).expect("series");
            let step = |line: &str| line.split(',').next().and_then(|s| s.parse().ok());
            text.lines()
                .skip(1)
                .map(|line| step(line).expect("a step"))
                .collect()
        };
        assert_eq!(steps("whole"), [0, 5, 10, 12], "{file}");
        assert_eq!(steps("parts"), steps("whole"), "{file}");
    }
}

fn stopped(ranks: usize, signal: &str) {
    let bench = bench();
    let Some(job) = bench.start(ranks, "stopped", &["--steps", "100000"]) else {
        return;
    };
    wait_for(|| has_checkpoint(&bench, "stopped"), || job.text());
    job.signal(signal);
    let ended = job.wait(LIMIT);
    assert!(ended.status.success(), "{}", ended.text);
    let summary = bench.summary("stopped");
    assert_eq!(summary["stopped_by"], "signal");
    let saved = State::of(&bench.path("stopped"), NODES).snapshot.step;
    assert_eq!(summary["steps"], saved);
}
