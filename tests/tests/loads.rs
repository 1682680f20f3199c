//! Forces and flow on patches, as a run reports them.

use fibreflow_tests::program::Bench;

const CHANNEL: &str = r#"[time]
end = 1.0
step = 0.05

[mesh]
kind = "box"
size = [1.0, 2.0, 0.6]
cells = [4, 12, 3]
stretching = ["uniform", { tanh = 1.5 }, "uniform"]
periodic = [true, false, true]

[fluid]
density = 2.0
viscosity = 0.5
initial = { kind = "poiseuille", bulk_velocity = [1.0, 0.0, 0.0] }
forcing = { kind = "pressure-gradient", value = [1.5, 0.0, 0.0] }
poisson = { tolerance = 1e-12 }

[fluid.boundaries]
y_min = { kind = "wall" }
y_max = { kind = "wall" }

[output.loads]
every = 5
about = [0.5, 1.0, 0.3]
coefficients = { velocity = 3.0, area = 0.6, drag = [2, 0, 0], lift = [0, 1, 0] }
"#;

/// Columns of `series/loads.csv`.
struct Table {
    names: Vec<String>,
    lines: Vec<Vec<f64>>,
}

impl Table {
    fn of(bench: &Bench, out: &str) -> Self {
        let path = bench.path(out).join("series/loads.csv");
        let text = std::fs::read_to_string(path).expect("series");
        let mut lines = text.lines();
        let names = lines.next().expect("header").split(',');
        let numbers = |line: &str| {
            line.split(',')
                .map(|v| v.parse().expect("number"))
                .collect()
        };
        Self {
            names: names.map(str::to_owned).collect(),
            lines: lines.map(numbers).collect(),
        }
    }

    fn column(&self, name: &str) -> Vec<f64> {
        let index = self.names.iter().position(|n| n == name);
        let index = index.unwrap_or_else(|| panic!("no `{name}` in {:?}", self.names));
        self.lines.iter().map(|line| line[index]).collect()
    }

    fn last(&self, name: &str) -> f64 {
        *self.column(name).last().expect("a line")
    }
}

fn run(bench: &Bench, ranks: usize, out: &str, arguments: &[&str]) -> bool {
    let Some(ended) = bench.run(ranks, out, arguments) else {
        return false;
    };
    assert!(ended.status.success(), "{}", ended.text);
    true
}

#[test]
fn walls_of_a_channel_take_the_driving_force() {
    let bench = Bench::new(env!("CARGO_BIN_EXE_program"), CHANNEL);
    let long = ["--set", "time.end=60.0", "--set", "time.step=0.5"];
    run(&bench, 1, "out", &long);
    let table = Table::of(&bench, "out");
    assert_eq!(table.column("step")[..2], [5.0, 10.0]);
    // Half of G V on each wall, at arms of −1 and 1.
    let shear = 0.5 * 1.5 * 1.2;
    for (wall, torque) in [("y_min", shear), ("y_max", -shear)] {
        let value = |column: &str| table.last(&format!("{wall}_{column}"));
        let off = [
            value("viscous_x") - shear,
            value("torque_z") - torque,
            value("pressure_y"),
            value("flux"),
        ];
        assert!(off.iter().all(|o| o.abs() < 1e-8), "{wall}: {off:?}");
    }
    let drag = 2.0 * shear / (0.5 * 2.0 * 9.0 * 0.6);
    assert!((table.last("drag_coefficient") - drag).abs() < 1e-8);
    assert!(table.last("lift_coefficient").abs() < 1e-8);
    // The same at the end, in the summary.
    let summary = bench.summary("out");
    let loads = &summary["fluid"]["loads"];
    assert_eq!(
        loads["y_max"]["viscous"][0].as_f64(),
        Some(table.last("y_max_viscous_x"))
    );
    assert_eq!(
        loads["coefficients"]["drag_coefficient"].as_f64(),
        Some(table.last("drag_coefficient"))
    );
}

#[test]
fn the_series_goes_on_after_a_restart_and_is_that_of_other_ranks() {
    let bench = Bench::new(env!("CARGO_BIN_EXE_program"), CHANNEL);
    let unsteady = ["--set", "fluid.forcing.value=[4.0, 0.0, 1.0]"];
    let text = |out: &str| std::fs::read_to_string(bench.path(out).join("series/loads.csv"));
    run(&bench, 1, "whole", &unsteady);
    let [set, value] = unsteady;
    run(&bench, 1, "parts", &[set, value, "--steps", "11"]);
    run(&bench, 1, "parts", &[set, value, "--resume"]);
    let whole = Table::of(&bench, "whole");
    assert_eq!(whole.column("step"), [5.0, 10.0, 15.0, 20.0]);
    // The first part left a line at its end.
    let parts = text("parts").expect("series");
    let kept: Vec<&str> = parts.lines().filter(|l| !l.starts_with("11,")).collect();
    assert_eq!(kept.len() + 1, parts.lines().count());
    assert_eq!(
        kept,
        text("whole").expect("series").lines().collect::<Vec<_>>()
    );
    if !run(&bench, 2, "two", &unsteady) {
        return;
    }
    let two = Table::of(&bench, "two");
    for name in ["y_min_viscous_x", "y_max_viscous_z", "y_max_torque_x"] {
        for (a, b) in whole.column(name).iter().zip(two.column(name)) {
            assert!((a - b).abs() < 1e-8 * a.abs(), "{name}: {a} {b}");
        }
    }
}

/// What an inlet brings in by its table leaves through the outlet, and only the named patches are listed.
#[test]
fn flow_through_patches_is_what_the_table_says() {
    let case = CHANNEL
        .replace("periodic = [true,", "periodic = [false,")
        .replace("forcing = { kind = \"pressure-gradient\", value = [1.5, 0.0, 0.0] }\n", "")
        .replace("initial = { kind = \"poiseuille\", bulk_velocity = [1.0, 0.0, 0.0] }\n", "")
        .replace("[fluid.boundaries]", "[fluid.boundaries]\nx_min = { kind = \"inlet\", velocity = [1, 0, 0], profile = { formula = [\"y*(2 - y)\", \"0\", \"0\"] }, factor = { kind = \"table\", times = [0, 0.3, 0.5], values = [0, 1, 0.5] } }\nx_max = { kind = \"KIND\" }")
        .replace("velocity = [1, 0, 0], profile", "profile")
        .replace("every = 5", "patches = [\"x_max\", \"x_min\"]");
    for outlet in ["outlet", "convective-outlet"] {
        let bench = Bench::new(env!("CARGO_BIN_EXE_program"), &case.replace("KIND", outlet));
        run(&bench, 1, "out", &[]);
        let table = Table::of(&bench, "out");
        assert_eq!(table.names.len(), 2 + 2 * 10 + 2);
        let (inflow, outflow) = (table.column("x_min_flux"), table.column("x_max_flux"));
        let times = table.column("time");
        assert_eq!(times.len(), 20);
        let full = -inflow[5];
        // ∫ y (2 − y) dy over the width of 0.6, by the nodes.
        assert!((full - 0.8).abs() < 0.02, "{full}");
        for (k, t) in times.iter().enumerate() {
            let factor = (t / 0.3).min(1.0 - 2.5 * (t - 0.3).clamp(0.0, 0.2));
            let off = [inflow[k] + factor * full, outflow[k] + inflow[k]];
            assert!(
                off.iter().all(|o| o.abs() < 1e-9),
                "{outlet}, t = {t}: {off:?}"
            );
        }
    }
}
