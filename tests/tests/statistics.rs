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

/// The channel without its fibres.
fn bench() -> Bench {
    let case = include_str!("../src/channel.toml");
    let (flow, _) = case.split_once("[[fibres]]").expect("fibres");
    Bench::new(
        env!("CARGO_BIN_EXE_program"),
        &(flow.to_owned() + STATISTICS),
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
    let mut worst = 0.0f64;
    for name in [
        "profiles/statistics.csv",
        "profiles/spectrum_x.csv",
        "profiles/correlation_z.csv",
    ] {
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
