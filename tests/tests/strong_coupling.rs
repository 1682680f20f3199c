//! Fibres that the fluid cannot ignore: steps that would blow up if forces lagged.

use fibreflow_tests::program::Bench;

/// Fibres held in a creeping shear flow: lagged forces grow many times in a step.
const HELD: &str = r#"
[time]
end = 1.0
step = 0.02

[mesh]
kind = "box"
size = [1, 1, 1]
cells = [6, 6, 6]
periodic = [true, false, true]

[fluid]
density = 1.0
viscosity = 1.0
inertia = "steady"
boundaries.y_min = { kind = "wall" }
boundaries.y_max = { kind = "moving-wall", velocity = [1, 0, 0] }

[[fibres]]
placement = { kind = "random", count = 60, seed = 1 }
length = 0.3
diameter = 0.01
segments = 4
youngs_modulus = 1e9
density = 1.0
clamp = "both"
"#;

/// Fibres of a thousandth of the fluid's density, many to a node, in a flow with inertia.
const LIGHT: &str = r#"
[time]
end = 100.0
step = 1.0

[mesh]
kind = "box"
size = [1, 1, 1]
cells = [8, 8, 8]
periodic = [true, false, true]

[fluid]
density = 1.0
viscosity = 1.0
inertia = "full"
initial = { kind = "expression", velocity = ["y*(1-y)", "0", "0"] }
boundaries.y_min = { kind = "wall" }
boundaries.y_max = { kind = "wall" }
forcing = { kind = "pressure-gradient", value = [2, 0, 0] }

[[fibres]]
placement = { kind = "random", count = 400, seed = 1 }
length = 0.3
diameter = 0.006
segments = 4
youngs_modulus = 1e9
density = 1e-3
"#;

fn bench(case: &str) -> Bench {
    Bench::new(env!("CARGO_BIN_EXE_program"), case)
}

#[test]
fn lagged_forces_blow_up_and_iterated_ones_do_not() {
    let bench = bench(HELD);
    let ended = bench.run(1, "iterated", &["--steps=8"]).expect("one rank");
    assert!(ended.status.success(), "{}", ended.text);
    assert!(
        ended.text.contains("scheme iterated") && ended.text.contains("without convection"),
        "{}",
        ended.text
    );
    let summary = bench.summary("iterated");
    let number = |key: &str| summary["coupling"][key].as_f64().expect("a number");
    let [gain, mean, most] = ["gain_max", "rounds_mean", "rounds_max"].map(number);
    println!("gain {gain:.2}: {mean:.1} rounds a step, {most} at most");
    assert!(gain > 3.0, "the case should be hard: gain {gain}");
    assert!(most <= 25.0, "{most} rounds");
    let energy = summary["fluid"]["kinetic_energy"].as_f64().expect("energy");
    assert!(energy < 0.2, "held fibres hold the flow back: {energy}");

    let lagged = ["--steps=8", "--set=coupling.scheme=staggered"];
    let ended = bench.run(1, "lagged", &lagged).expect("one rank");
    if ended.status.success() {
        let summary = bench.summary("lagged");
        let lagged = summary["fluid"]["kinetic_energy"]
            .as_f64()
            .unwrap_or(f64::INFINITY);
        println!("lagged: kinetic energy {lagged:.1e} instead of {energy:.1e}");
        assert!(lagged > 1e3 * energy, "lagging would do: {lagged}");
    }
}

#[test]
fn forces_do_not_depend_on_the_ranks() {
    let bench = bench(HELD);
    let coupling = [
        "--steps=2",
        "--set=fibres.0.placement.count=12",
        "--set=coupling.kernel=gaussian",
        "--set=coupling.width=0.2",
        "--set=coupling.correction=undisturbed",
    ];
    let mut energies = Vec::new();
    for ranks in [1, 2, 4] {
        let name = format!("ranks-{ranks}");
        let Some(ended) = bench.run(ranks, &name, &coupling) else {
            return;
        };
        assert!(ended.status.success(), "{}", ended.text);
        let energy = bench.summary(&name)["fluid"]["kinetic_energy"].clone();
        energies.push(energy.as_f64().expect("energy"));
    }
    println!("{energies:?}");
    assert!(
        energies
            .iter()
            .all(|e| (e / energies[0] - 1.0).abs() < 1e-6)
    );
}

#[test]
fn light_fibres_on_nodes_that_they_share_stay_where_the_flow_carries_them() {
    let bench = bench(LIGHT);
    let ended = bench.run(1, "light", &["--steps=40"]).expect("one rank");
    assert!(ended.status.success(), "{}", ended.text);
    let summary = bench.summary("light");
    let loading = summary["coupling"]["loading"].as_f64().expect("loading");
    let energy = summary["fluid"]["kinetic_energy"].as_f64().expect("energy");
    println!("Δt β/(ρV) = {loading:.1}: kinetic energy {energy:.4e}");
    assert!(loading > 100.0, "the case should be hard: {loading}");
    // That of the parabola without fibres is ½·(1/30); with the whole resistance of the fibres it is 0.26 and no end.
    assert!(energy > 1e-4 && energy < 1.0 / 60.0, "{energy}");
}
