//! Linked fibres from a case file: the star floc runs and goes on bit by bit, and what does not fit is refused.

use fibreflow_tests::program::Bench;

const CASE: &str = include_str!("../../cases/star-floc/case.toml");

fn bench(case: &str) -> Bench {
    let bench = Bench::new(env!("CARGO_BIN_EXE_program"), case);
    let star = include_str!("../../cases/star-floc/star.csv");
    std::fs::write(bench.path("star.csv"), star).expect("written");
    bench
}

fn last_line(bench: &Bench, out: &str) -> String {
    let path = bench.path(out).join("series").join("fibres.csv");
    let text = std::fs::read_to_string(path).expect("a series");
    text.lines().last().expect("lines").to_owned()
}

#[test]
fn a_run_goes_on_where_it_stopped() {
    let bench = bench(CASE);
    let long = ["--set", "time.end=2e-3"];
    let run = |out: &str, more: &[&str]| {
        let arguments = [&long[..], more].concat();
        let ended = bench.run(1, out, &arguments).expect("one rank");
        assert!(ended.status.success(), "{}", ended.text);
    };
    run("whole", &[]);
    run("parts", &["--steps", "7"]);
    run("parts", &["--resume"]);
    let line = last_line(&bench, "whole");
    assert_eq!(line, last_line(&bench, "parts"));
    assert!(line.starts_with("20,"), "{line}");
    assert_eq!(bench.summary("whole")["fibres"]["segments"], 35);
}

#[test]
fn what_does_not_fit_is_refused() {
    let changes = [
        (
            "friction = 20.0",
            "friction = 20.0\nstiffness = 1.0",
            "contact.stiffness",
        ),
        ("torque = \"prolate-spheroid\"", "", "hydrodynamics.torque"),
        (
            "density = 1000.0\n\n[contact]",
            "density = 1000.0\nclamp = \"first\"\n\n[contact]",
            "fibres[0].clamp",
        ),
        ("length = 1.12e-3\n", "", "fibres[0]` lacks `length`"),
        ("kinematics = \"linked\"", "", "`contact` lacks `stiffness`"),
        (
            "[true, true, true]",
            "[true, false, true]",
            "ambient.domain.periodic",
        ),
        (
            "star.csv",
            "comet.csv",
            "fibres[0].placement.file = \"comet.csv\"",
        ),
    ];
    for (old, new, wanted) in changes {
        assert!(CASE.contains(old), "{old}");
        let bench = bench(&CASE.replace(old, new));
        let ended = bench.run(1, "out", &[]).expect("one rank");
        assert_eq!(ended.status.code(), Some(2), "{old}: {}", ended.text);
        assert!(ended.text.contains(wanted), "no {wanted} in {}", ended.text);
    }
}
