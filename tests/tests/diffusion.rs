//! How viscous terms are advanced is a choice of the case file, and the step follows it.

use fibreflow_tests::program::Bench;

const CASE: &str = r#"[time]
end = 0.1
cfl = 1.0
max_step = 0.02

[mesh]
kind = "box"
size = [1.0, 2.0, 0.25]
cells = [4, 16, 1]
stretching = ["uniform", { tanh = 1.5 }, "uniform"]
periodic = [true, false, true]

[fluid]
density = 1.0
viscosity = 0.5
initial = { kind = "poiseuille", bulk_velocity = [0.2, 0.0, 0.0] }
forcing = { kind = "pressure-gradient", value = [1.0, 0.0, 0.0] }
poisson = { tolerance = 1e-10 }

[fluid.boundaries]
y_min = { kind = "wall" }
y_max = { kind = "wall" }

[output]
vtk = { interval = 0.05 }
"#;

/// Steps [s] of a run, its log and the kinetic energy at the end.
fn run(bench: &Bench, diffusion: &str) -> (Vec<f64>, String, f64) {
    let set = format!("fluid.diffusion={diffusion}");
    let ended = bench.run(1, diffusion, &["--set", &set]);
    let ended = ended.expect("one rank needs no mpirun");
    assert!(ended.status.success(), "{}", ended.text);
    let read = |name: &str| std::fs::read_to_string(bench.path(diffusion).join(name));
    let series = read("series/fluid.csv").expect("series");
    let column = |line: &str, k: usize| -> f64 {
        line.split(',')
            .nth(k)
            .expect("column")
            .parse()
            .expect("number")
    };
    let lines: Vec<&str> = series.lines().skip(2).collect();
    let steps = lines.iter().map(|l| column(l, 2)).collect();
    // Steps land on the output times.
    assert!(lines.iter().any(|l| column(l, 1) == 0.05));
    let energy = bench.summary(diffusion)["fluid"]["kinetic_energy"].as_f64();
    (
        steps,
        read("run.log").expect("log"),
        energy.expect("energy"),
    )
}

#[test]
fn explicit_diffusion_limits_the_step_and_implicit_does_not() {
    let bench = Bench::new(env!("CARGO_BIN_EXE_program"), CASE);
    let (explicit, log, energy) = run(&bench, "explicit");
    assert!(
        log.contains("step 1: diffusion explicit") && log.contains("as set"),
        "{log}"
    );
    // The smallest spacing of the walls: ν Δt (4/h² and less across) below 2.51.
    let h = 2.0 * 0.5 * (1.0 - (1.5 * (1.0 - 2.0 / 16.0_f64)).tanh() / 1.5_f64.tanh());
    let largest = explicit.iter().fold(0.0, |m: f64, dt| m.max(*dt));
    println!(
        "{} steps of at most {largest:.2e} s, h²/2ν {:.2e}",
        explicit.len(),
        h * h
    );
    assert!(largest < 2.51 * h * h / (4.0 * 0.5) && explicit.len() > 10);
    let (implicit, log, same) = run(&bench, "implicit");
    assert!(log.contains("diffusion implicit"), "{log}");
    assert_eq!(implicit.len(), 6);
    assert!((energy / same - 1.0).abs() < 1e-3, "{energy} {same}");
    let (auto, log, _) = run(&bench, "auto");
    assert_eq!(auto, implicit);
    assert!(log.contains("outside the stability limit"), "{log}");
}
