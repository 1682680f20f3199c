//! A channel with an inlet from a file that pulsates, a wall that swings and either outlet, fibres in it: the same on any
//! ranks, and restarted bit by bit.

use fibreflow_tests::program::Bench;
use fibreflow_tests::state::State;

const NODES: usize = 13 * 9 * 5;

const CASE: &str = r#"[time]
end = 10.0
cfl = 0.4
max_step = 2e-3

[mesh]
kind = "box"
size = [1.2e-2, 8e-3, 5e-3]
cells = [12, 8, 5]
stretching = ["uniform", { tanh = 1.2 }, "uniform"]
periodic = [false, false, true]
element = "ELEMENT"

[fluid]
density = 1000.0
viscosity = 0.05
poisson = { tolerance = 1e-12 }

[fluid.boundaries]
y_min = { kind = "wall" }
y_max = { kind = "moving-wall", velocity = [0.1, 0.0, 0.05], factor = { kind = "formula", value = "sin(300*t)" } }
x_max = { kind = "OUTLET" }

[fluid.boundaries.x_min]
kind = "inlet"
profile = { file = "inlet.csv" }
factor = { kind = "table", times = [0.0, 5e-3, 1e-2], values = [1.0, 1.5, 1.0], periodic = true }

[[fibres]]
placement = { kind = "random", count = 20, seed = 2 }
length = 2e-3
diameter = 2e-4
segments = 4
youngs_modulus = 5e4
density = 1200.0

[output]
checkpoint = { every = 3 }
loads = { every = 3 }
"#;

fn bench(element: &str, outlet: &str) -> Bench {
    let case = CASE.replace("ELEMENT", element).replace("OUTLET", outlet);
    let bench = Bench::new(env!("CARGO_BIN_EXE_program"), &case);
    let mut profile = String::from("y,z,u,w\n");
    for k in 0..45 {
        let (y, z) = (f64::from(k / 5) * 1e-3, f64::from(k % 5) * 1e-3);
        let u = 0.3 * 6.0 * y / 8e-3 * (1.0 - y / 8e-3);
        profile += &format!("{y},{z},{u},{}\n", 0.1 * u);
    }
    std::fs::write(bench.path("inlet.csv"), profile).expect("profile");
    bench
}

fn loads(bench: &Bench, out: &str) -> String {
    let path = bench.path(out).join("series/loads.csv");
    std::fs::read_to_string(path).expect("series")
}

#[test]
fn open_boundaries_do_not_depend_on_ranks_or_restarts() {
    for (element, outlet) in [
        ("hexahedron", "convective-outlet"),
        ("tetrahedron", "outlet"),
    ] {
        let bench = bench(element, outlet);
        let run = |ranks: usize, out: &str, arguments: &[&str]| {
            let ended = bench.run(ranks, out, arguments)?;
            assert!(ended.status.success(), "{}", ended.text);
            Some(State::of(&bench.path(out), NODES))
        };
        let one = run(1, "one", &["--steps", "9"]).expect("one rank needs no mpirun");
        // Forces and torques of the fibres, also on nodes of given velocity, are booked to round-off.
        let defect = bench.summary("one")["coupling"]["momentum_defect_relative"].as_f64();
        assert!(defect.is_some_and(|d| d < 1e-10), "{defect:?}");
        run(1, "parts", &["--steps", "6"]);
        let parts = run(1, "parts", &["--steps", "9", "--resume"]).expect("one rank");
        assert_eq!(one.bits_that_differ(&parts), Vec::<String>::new());
        assert_eq!(loads(&bench, "one"), loads(&bench, "parts"));
        for ranks in [2, 3] {
            let Some(several) = run(ranks, &format!("ranks-{ranks}"), &["--steps", "9"]) else {
                return;
            };
            let [velocity, fibres] = one.difference(&several);
            println!("{element}, {ranks} ranks: velocity {velocity:.2e}, fibres {fibres:.2e}");
            assert!(velocity < 1e-8 && fibres < 1e-8);
        }
    }
}
