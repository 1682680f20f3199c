//! A run that blows up says where and why, and leaves with code 1 on every rank.

use fibreflow_tests::program::Bench;

fn bench() -> Bench {
    let case = include_str!("../src/channel.toml");
    // A constant step of Courant number 20 or so.
    let case = case.replace("cfl = 0.4\nmax_step = 1e-3", "step = 2e-2");
    Bench::new(env!("CARGO_BIN_EXE_program"), &case)
}

fn blows_up(ranks: usize) {
    let Some(ended) = bench().run(ranks, "out", &["--steps", "400"]) else {
        return;
    };
    assert_eq!(ended.status.code(), Some(1), "{}", ended.text);
    assert!(
        ended.text.contains("the run stopped in step"),
        "{}",
        ended.text
    );
    assert!(
        ended.text.contains("likely cause: the Courant number"),
        "{}",
        ended.text
    );
    assert_eq!(ended.text.matches("error:").count(), 1, "{}", ended.text);
}

#[test]
fn on_one_rank() {
    blows_up(1);
}

#[test]
fn on_three_ranks() {
    blows_up(3);
}

/// The fibres are not to blame.
#[test]
fn where_nothing_can_be_written() {
    let case = include_str!("../src/channel.toml");
    let bench = Bench::new(env!("CARGO_BIN_EXE_program"), case);
    let out = bench.path("out");
    std::fs::create_dir_all(&out).expect("folder");
    // A folder where nothing can be written, whoever asks.
    std::os::unix::fs::symlink("/proc/self", out.join("fluid")).expect("link");
    let ended = bench
        .run(1, "out", &["--steps", "400"])
        .expect("one rank needs no mpirun");
    assert_eq!(ended.status.code(), Some(1), "{}", ended.text);
    for part in [
        "the run stopped in step",
        "cannot be written",
        "a full disk",
    ] {
        assert!(ended.text.contains(part), "no `{part}` in:\n{}", ended.text);
    }
    assert!(!ended.text.contains("driven"), "{}", ended.text);
}
