//! Sweeps: what they make of their members, one that fails among them, and how they go on after they were killed.

use fibreflow_tests::launch::{self, Ended};
use fibreflow_tests::program::{Bench, LIMIT};
use std::process::Command;
use std::time::Instant;

const CASE: &str = r#"[time]
end = 2.5
step = 2e-2

[ambient]
density = 1000.0
viscosity = 1.0
flow = { kind = "shear", rate = 1.0 }
domain = { size = [1e-3, 1e-3, 1e-3], periodic = [true, true, true] }

[[fibres]]
placement = { kind = "random", count = 24, seed = 1, gap = 1e-6 }
kinematics = "linked"
shape = { kind = "chain", bend = 0.3, turn = 0.0 }
length = 7e-4
diameter = 2e-5
segments = 5
youngs_modulus = 2e7
density = 1000.0

[contact]
friction = 5.0
repulsion = { strength = 2e-6, decay = 5e-7, range = 6.6e-6, contact_gap = 3.3e-6 }

[hydrodynamics]
drag = "prolate-spheroid"
torque = "prolate-spheroid"

[output]
checkpoint = { every = 20 }
observables = { every = 5, stress = true }
"#;

const SWEEP: &str = r#"case = "case.toml"

[set]
"contact.friction" = 10.0

[[vary]]
name = "concentration"
keys = ["fibres.0.placement.count", "fibres.0.length"]
values = [[12, 7e-4], [24, 7.1e-4]]
labels = ["low", "high, longer"]

[[vary]]
name = "shape"
keys = ["fibres.0.shape"]
values = [{ kind = "straight" }, { kind = "file", file = "absent.csv" }]
labels = ["straight", "none"]

[replicates]
count = 2
seeds = ["fibres.0.placement.seed"]
first = 7

[results]
columns = ["structure.eta_sp", "fibres.contacts"]
from = 1.0
to = 2.3
steady = "structure.alignment"
"#;

fn bench(sweep: &str) -> Bench {
    let bench = Bench::new(env!("CARGO_BIN_EXE_program"), CASE);
    std::fs::write(bench.path("sweep.toml"), sweep).expect("written");
    bench
}

fn command(bench: &Bench, out: &str, more: &[&str]) -> Command {
    let mut command = launch::command(env!("CARGO_BIN_EXE_program"), 1);
    command.arg("sweep").arg(bench.path("sweep.toml"));
    command.arg("--out").arg(bench.path(out)).args(more);
    command
}

fn run(bench: &Bench, out: &str, more: &[&str]) -> Ended {
    launch::run(command(bench, out, more), LIMIT).expect("one rank")
}

fn read(bench: &Bench, file: &str) -> String {
    let path = bench.path(file);
    std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// Mean of a column of a series over a span of time.
fn mean(text: &str, column: &str, span: [f64; 2]) -> f64 {
    let mut lines = text.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let names = lines.next().expect("a header");
    let at = names.iter().position(|n| *n == column).expect("a column");
    let number = |line: &Vec<&str>, k: usize| line[k].parse::<f64>().expect("a number");
    let kept: Vec<f64> = lines
        .filter(|line| (span[0]..=span[1]).contains(&number(line, 1)))
        .map(|line| number(&line, at))
        .collect();
    kept.iter().sum::<f64>() / kept.len() as f64
}

/// Two of four combinations fail in each run, the others are in the table; killed and told to stop on the way, it is the same.
#[test]
fn killed_and_gone_on_with_it_gives_the_same_table() {
    let bench = bench(SWEEP);
    let whole = run(&bench, "whole", &[]);
    assert_eq!(whole.status.code(), Some(1), "{}", whole.text);
    assert!(
        whole.text.contains("4 of 8 members failed"),
        "{}",
        whole.text
    );

    let started = || launch::start(command(&bench, "parts", &["--jobs", "2"])).expect("one rank");
    let members = bench.path("parts").join("members");
    for (signal, folder) in [
        ("KILL", "concentration=low_shape=straight_seed=8"),
        ("TERM", "concentration=high--longer_shape=straight_seed=8"),
    ] {
        let job = started();
        let begun = Instant::now();
        while !members.join(folder).join("series/structure.csv").exists() {
            assert!(begun.elapsed() < LIMIT, "{}", job.text());
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
        job.signal(signal);
        let ended = job.wait(LIMIT);
        assert!(!ended.status.success(), "{}", ended.text);
        if signal == "TERM" {
            assert!(ended.text.contains("goes on"), "{}", ended.text);
        }
    }
    let rest = run(&bench, "parts", &[]);
    assert_eq!(rest.status.code(), Some(1), "{}", rest.text);
    let stopped = "parts/members/concentration=high--longer_shape=straight_seed=8/run.log";
    let log = read(&bench, stopped);
    assert!(log.contains("resumed at step"), "{log}");
    for table in ["results.csv", "members.csv"] {
        let [a, b] = ["whole", "parts"].map(|out| read(&bench, &format!("{out}/{table}")));
        // The folder is in what a failure says.
        assert_eq!(a, b.replace("/parts/", "/whole/"), "{table}");
    }

    // The table beside the series that it comes from.
    let table = read(&bench, "whole/results.csv");
    let lines: Vec<&str> = table.lines().collect();
    assert_eq!(
        lines[0],
        "concentration,shape,runs,structure.eta_sp,structure.eta_sp_error,fibres.contacts,fibres.contacts_error"
    );
    assert_eq!(lines.len(), 5, "{table}");
    assert_eq!(lines[2], "low,none,0,,,,", "{table}");
    let members = read(&bench, "whole/members.csv");
    let of_seed = |seed: u32| {
        let start = format!("low,straight,{seed},done,");
        let line = members.lines().find(|line| line.starts_with(&start));
        let fields: Vec<&str> = line.expect("a line").split(',').collect();
        let from: f64 = fields[4].parse().expect("a time");
        assert!((1.0..2.3).contains(&from), "{from}");
        let name = format!("whole/members/concentration=low_shape=straight_seed={seed}");
        mean(
            &read(&bench, &format!("{name}/series/structure.csv")),
            "eta_sp",
            [from, 2.3],
        )
    };
    let (a, b) = (of_seed(7), of_seed(8));
    let fields: Vec<&str> = lines[1].split(',').collect();
    let number = |k: usize| fields[k].parse::<f64>().expect("a number");
    assert_eq!(fields[..3], ["low", "straight", "2"]);
    assert!((number(3) - 0.5 * (a + b)).abs() < 1e-12 * number(3).abs());
    assert!((number(4) - 0.5 * (a - b).abs()).abs() < 1e-12 * number(3).abs());
    assert!(a != b && a > 0.0, "{a} {b}");
    assert!(members.contains("absent.csv"), "{members}");
}

/// Done is done; what a changed file means anew runs anew.
#[test]
fn only_what_changed_runs_again() {
    let short = SWEEP
        .replace(
            "{ kind = \"file\", file = \"absent.csv\" }",
            "{ kind = \"chain\", bend = 0.1, turn = 0.0 }",
        )
        .replace("count = 2", "count = 1")
        .replace("\"contact.friction\" = 10.0", "\"time.end\" = 1.5");
    let bench = bench(&short);
    let first = run(&bench, "out", &["--jobs", "2"]);
    assert!(first.status.success(), "{}", first.text);
    let table = read(&bench, "out/results.csv");
    let written = |shape: &str| {
        let name = format!("out/members/concentration=low_shape={shape}_seed=7/summary.json");
        std::fs::metadata(bench.path(&name))
            .and_then(|m| m.modified())
            .expect("a summary")
    };
    let before = ["straight", "none"].map(written);
    std::fs::write(
        bench.path("sweep.toml"),
        short.replace("bend = 0.1", "bend = 0.5"),
    )
    .expect("written");
    let second = run(&bench, "out", &[]);
    assert!(second.status.success(), "{}", second.text);
    assert_eq!(written("straight"), before[0]);
    assert!(written("none") > before[1]);
    let lines = |text: &str| text.lines().map(str::to_owned).collect::<Vec<_>>();
    let (old, new) = (lines(&table), lines(&read(&bench, "out/results.csv")));
    assert_eq!(old[1], new[1]);
    assert_ne!(old[2], new[2]);
}

#[test]
fn bad_sweeps_are_refused_before_anything_runs() {
    for (old, new, wanted) in [
        (
            "case = \"case.toml\"",
            "case = \"cas.toml\"",
            &["cas.toml", "cannot be read"][..],
        ),
        (
            "[results]",
            "[result]",
            &["unknown key `result`", "did you mean `results`"],
        ),
        (
            "contact.friction\" = 10.0",
            "contact.friction\" = -1.0",
            &["contact.friction = -1", "at least 0"],
        ),
        (
            "fibres.0.placement.count\", ",
            "fibres.0.placement.cont\", ",
            &["fibres[0].placement.cont", "unknown key"],
        ),
        (
            "[12, 7e-4]",
            "[12]",
            &["vary[0].values[0]", "a list of 2 values"],
        ),
        (
            "labels = [\"straight\", \"none\"]",
            "",
            &["vary[1]", "lacks `labels`"],
        ),
        (
            "labels = [\"straight\", \"none\"]",
            "labels = [\"straight\"]",
            &["vary[1].labels", "one label a value"],
        ),
        (
            "\"straight\", \"none\"",
            "\"a b\", \"a/b\"",
            &["two members", "shape=a-b"],
        ),
        (
            "name = \"shape\"",
            "name = \"runs\"",
            &["vary[1].name", "is taken"],
        ),
        (
            "structure.eta_sp",
            "eta_sp",
            &["results.columns[0]", "FILE.COLUMN"],
        ),
        (
            "to = 2.3",
            "to = 0.5",
            &["results.to = 0.5", "a later time"],
        ),
        (
            "from = 1.0\nto = 2.3",
            "from = 5.0",
            &["results.from = 5", "time.end"],
        ),
        (
            "count = 2",
            "count = 0",
            &["replicates.count = 0", "at least 1"],
        ),
    ] {
        assert!(SWEEP.contains(old), "{old}");
        let bench = bench(&SWEEP.replace(old, new));
        let ended = run(&bench, "out", &[]);
        assert_eq!(ended.status.code(), Some(2), "{new}: {}", ended.text);
        for part in wanted {
            assert!(ended.text.contains(part), "no {part} in {}", ended.text);
        }
        assert!(!bench.path("out").exists(), "{new}");
    }
    let bench = bench(&SWEEP.replace("structure.eta_sp", "structure.eta"));
    let ended = run(&bench, "out", &[]);
    assert_eq!(ended.status.code(), Some(2), "{}", ended.text);
    let wanted = [
        "results.columns[0] = \"structure.eta\"",
        "contacts_per_fibre",
    ];
    assert!(
        wanted.iter().all(|part| ended.text.contains(part)),
        "{}",
        ended.text
    );
}
