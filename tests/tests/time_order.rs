//! Order in time of fibres in a flow that changes in time and space (one-way).

use fibreflow_tests::program::Bench;
use fibreflow_tests::state::State;

const CASE: &str = r#"
[time]
end = 0.32
step = 0.02

[mesh]
kind = "box"
size = [1, 1, 0.25]
cells = [8, 8, 2]
periodic = [true, true, true]

[fluid]
density = 1.0
viscosity = 0.05
initial = { kind = "expression", velocity = ["1 + sin(2*pi*x)*cos(2*pi*y)", "0.5 - cos(2*pi*x)*sin(2*pi*y)", "0"] }
poisson = { tolerance = 1e-12 }

[[fibres]]
placement = { kind = "line", start = [0.2, 0.3, 0.1], end = [0.5, 0.4, 0.13] }
diameter = 0.02
segments = 4
youngs_modulus = 1e5
density = 1.0

[coupling]
mode = "one-way"
KERNEL

[mechanics]
integrator = "implicit"
tolerance = 0.0

[output]
checkpoint = { every = 1000 }
"#;

#[test]
fn fibres_follow_a_changing_flow_to_second_order() {
    let middle = "kernel = \"middle\"";
    for kernel in ["", middle, "kernel = \"gaussian\"\nwidth = 0.06"] {
        let bench = Bench::new(
            env!("CARGO_BIN_EXE_program"),
            &CASE.replace("KERNEL", kernel),
        );
        let positions = |halvings: u32| {
            let name = format!("run-{halvings}");
            let step = format!("--set=time.step={}", 0.02 / f64::from(1 << halvings));
            let ended = bench.run(1, &name, &[&step]).expect("one rank");
            assert!(ended.status.success(), "{}", ended.text);
            State::of(&bench.path(&name), 8 * 8 * 2).fibres
        };
        let runs: Vec<_> = (0..4).map(positions).collect();
        let apart = |k: usize| {
            let pairs = runs[k].iter().zip(&runs[k + 1]);
            pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
        };
        let orders = [0, 1].map(|k| (apart(k) / apart(k + 1)).log2());
        println!(
            "{kernel:?}: changes {:.2e} {:.2e} {:.2e}, orders {orders:.2?}",
            apart(0),
            apart(1),
            apart(2)
        );
        assert!(orders[1] > 1.7, "{kernel:?}: {orders:?}");
    }
}
