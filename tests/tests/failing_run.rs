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
