//! Averages of a turbulent run: a restart in the middle and the number of ranks change nothing but round-off.

use fibreflow_tests::program::Bench;

const STATISTICS: &str = r#"
[output]
checkpoint = { every = 30 }

[output.statistics]
from = 0.005
every = 3
block = 0.02
spectra = ["x", "z"]
average = { kind = "planes", normal = "y", flow = "x", symmetric = true }
"#;

/// Points, a line, a plane and a box, each at times of its own.
const SAMPLES: &str = r#"
[[output.samples]]
name = "probes"
every = 1
at = { kind = "points", points = [[1e-3, 4e-3, 2e-3], [7.9e-3, 1e-3, 5.5e-3]] }

[[output.samples]]
name = "across"
interval = 0.004
at = { kind = "line", start = [3e-3, 0, 3e-3], end = [3e-3, 8e-3, 3e-3], count = 9 }

[[output.samples]]
name = "wall"
every = 10
at = { kind = "plane", normal = "y", position = 1e-3, low = [0, 0], high = [8e-3, 6e-3], counts = [9, 7] }
"#;

/// The channel without its fibres.
fn bench() -> Bench {
    let case = include_str!("../src/channel.toml");
    let (flow, _) = case.split_once("[[fibres]]").expect("fibres");
    Bench::new(
        env!("CARGO_BIN_EXE_program"),
        &(flow.to_owned() + STATISTICS + SAMPLES),
    )
}

fn run(bench: &Bench, ranks: usize, out: &str, more: &[&str]) -> Option<()> {
    let ended = bench.run(ranks, out, more)?;
    assert!(ended.status.success(), "{}", ended.text);
    Some(())
}

/// All numbers of a table, by column.
fn table(bench: &Bench, out: &str, name: &str) -> Vec<(String, Vec<f64>)> {
    let path = bench.path(out).join(name);
    let text = std::fs::read_to_string(path).expect("a table");
    let mut lines = text.lines();
    let names = lines.next().expect("a header").split(',');
    let mut columns: Vec<(String, Vec<f64>)> = names.map(|n| (n.to_owned(), Vec::new())).collect();
    for line in lines {
        for (column, number) in columns.iter_mut().zip(line.split(',')) {
            column.1.push(number.parse().expect("a number"));
        }
    }
    columns
}

/// Largest difference of any column, by the largest magnitude in it or, for sums that cancel, in the table's scale.
fn difference(bench: &Bench, a: &str, b: &str, scale: f64) -> f64 {
    let names = ["statistics", "spectrum_x", "correlation_z"];
    difference_of(bench, [a, b], scale, &names)
}

fn difference_of(bench: &Bench, [a, b]: [&str; 2], scale: f64, names: &[&str]) -> f64 {
    let mut worst = 0.0f64;
    for name in names {
        let name = &format!("profiles/{name}.csv");
        let (a, b) = (table(bench, a, name), table(bench, b, name));
        assert_eq!(a.len(), b.len());
        for ((name, a), (_, b)) in a.iter().zip(&b) {
            // Ratios of moments that vanish at walls are round-off there.
            if name.starts_with("skewness") || name.starts_with("flatness") {
                continue;
            }
            assert!(!a.is_empty() && a.len() == b.len());
            let size = a.iter().fold(0.0f64, |m, v| m.max(v.abs()));
            for (x, y) in a.iter().zip(b) {
                worst = worst.max((x - y).abs() / size.max(scale));
            }
        }
    }
    worst
}

#[test]
fn a_restart_in_the_middle_changes_no_average() {
    let bench = bench();
    run(&bench, 1, "straight", &["--steps=100"]).expect("one rank");
    run(&bench, 1, "halves", &["--steps=61"]).expect("one rank");
    run(&bench, 1, "halves", &["--steps=100", "--resume"]).expect("one rank");
    let series = |out: &str| std::fs::read_to_string(bench.path(out).join("series/friction.csv"));
    assert_eq!(
        series("straight").expect("friction"),
        series("halves").expect("friction")
    );
    let worst = difference(&bench, "straight", "halves", 1e-12);
    println!("restart: {worst:.1e}");
    assert!(worst < 1e-9, "{worst}");
}

#[test]
fn averages_do_not_depend_on_the_ranks() {
    let bench = bench();
    run(&bench, 1, "one", &["--steps=100"]).expect("one rank");
    let Some(()) = run(&bench, 2, "two", &["--steps=100"]) else {
        return;
    };
    let worst = difference(&bench, "one", "two", 1e-12);
    println!("1 and 2 ranks over 100 steps: {worst:.1e}");
    assert!(worst < 1e-8, "{worst}");
    // Resumed on another number of ranks.
    run(&bench, 2, "half", &["--steps=60"]).expect("mpirun is there");
    run(&bench, 1, "half", &["--steps=100", "--resume"]).expect("one rank");
    let worst = difference(&bench, "one", "half", 1e-12);
    assert!(worst < 1e-8, "{worst}");
}

/// Rings, and waves along and around a pipe whose rings lie across ranks.
#[test]
fn averages_in_a_pipe_do_not_depend_on_the_ranks() {
    let case = include_str!("../../cases/pipe/case.toml");
    let bench = Bench::new(env!("CARGO_BIN_EXE_program"), case);
    let small = [
        "--steps=12",
        "--set=mesh.cells=8",
        "--set=mesh.core=4",
        "--set=mesh.layers=4",
        "--set=mesh.length=2",
        "--set=output.statistics.from=0",
        "--set=output.statistics.every=2",
        "--set=output.statistics.block=0.1",
        "--set=fluid.poisson.tolerance=1e-12",
    ];
    run(&bench, 1, "one", &small).expect("one rank");
    for (ranks, out) in [(2, "two"), (3, "three")] {
        let Some(()) = run(&bench, ranks, out, &small) else {
            return;
        };
        let names = [
            "statistics",
            "spectrum_x",
            "spectrum_around",
            "correlation_around",
        ];
        let worst = difference_of(&bench, ["one", out], 1e-6, &names);
        println!("1 and {ranks} ranks: {worst:.1e}");
        assert!(worst < 1e-8, "{worst}");
    }
}

/// Probes and lines on two ranks are those on one; every set has its own times, and a resumed run goes on with all of them.
#[test]
fn samples_do_not_depend_on_the_ranks() {
    let bench = bench();
    run(&bench, 1, "one", &["--steps=40"]).expect("one rank");
    let files = |out: &str| {
        let entries = std::fs::read_dir(bench.path(out).join("samples")).expect("samples");
        let mut names: Vec<String> = entries
            .map(|e| e.expect("entry").file_name().to_string_lossy().into_owned())
            .filter(|name| name.ends_with(".csv") || name.ends_with(".pvti"))
            .collect();
        names.sort();
        names
    };
    let lines: Vec<String> = files("one")
        .into_iter()
        .filter(|n| n.ends_with(".csv"))
        .collect();
    let planes = files("one").len() - lines.len();
    // At the start, then every 0.004 s and every 10 steps.
    assert!(lines.len() > 4 && planes == 5, "{lines:?}");
    let Some(()) = run(&bench, 2, "two", &["--steps=23"]) else {
        return;
    };
    run(&bench, 2, "two", &["--steps=40", "--resume"]).expect("mpirun is there");
    assert_eq!(files("one"), files("two"));
    let tables = lines.iter().map(|name| format!("samples/{name}"));
    for name in tables.chain(["series/probes.csv".to_owned()]) {
        let (a, b) = (table(&bench, "one", &name), table(&bench, "two", &name));
        for ((column, a), (_, b)) in a.iter().zip(&b) {
            assert!(!a.is_empty() && a.len() == b.len(), "{name}, {column}");
            let size = a.iter().fold(1e-9f64, |m, v| m.max(v.abs()));
            for (x, y) in a.iter().zip(b) {
                assert!((x - y).abs() < 1e-8 * size, "{name}, {column}: {x} {y}");
            }
        }
    }
}
