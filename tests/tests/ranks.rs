//! The same run on 1, 2, 3 and 4 ranks: velocity and fibre positions agree to 1e-8.

use fibreflow_tests::program::Bench;
use fibreflow_tests::state::State;

/// Fourth order reaches three nodes far.
#[test]
fn fourth_order_with_either_number_of_pressure_solves_does_not_depend_on_the_ranks() {
    for solves in [1, 3] {
        compare(
            &[
                "--steps=12",
                "--set=mesh.cells=[12, 12, 10]",
                "--set=fluid.order=4",
                &format!("--set=fluid.poisson.solves_per_step={solves}"),
            ],
            12 * 13 * 10,
        );
    }
}

/// Thin cells at the walls: diffusion is implicit along lines that are cut between ranks.
#[test]
fn diffusion_along_lines_does_not_depend_on_the_ranks() {
    let thin = "--set=mesh.stretching=[\"uniform\", { tanh = 3.0 }, \"uniform\"]";
    compare(
        &["--steps=12", "--set=fluid.viscosity=0.1", thin],
        8 * 11 * 6,
    );
}

#[test]
fn fibres_in_contact_in_a_channel_do_not_depend_on_the_ranks() {
    compare(&["--steps=40"], 8 * 11 * 6);
}

/// Mass is corrected on tetrahedra: by an exchange a sub-step where diffusion is explicit, in two solves where not.
#[test]
fn corrected_mass_does_not_depend_on_the_ranks() {
    for diffusion in ["explicit", "implicit"] {
        let diffusion = format!("--set=fluid.diffusion={diffusion}");
        let arguments = ["--steps=20", "--set=mesh.element=tetrahedron", &diffusion];
        compare(&arguments, 8 * 11 * 6);
    }
}

/// Laminar, so that differences do not grow by themselves: 1,000 steps in which every fibre passes the box, and with it the
/// ranks, many times.
#[test]
fn trajectories_through_rank_and_periodic_boundaries_do_not_depend_on_the_ranks() {
    let set = [
        "--steps=1000",
        "--set=fluid.viscosity=0.5",
        "--set=fluid.initial.intensity=0.02",
        "--set=fibres.0.placement.count=30",
        "--set=contact.friction=0",
        "--set=output.checkpoint.every=1000",
    ];
    compare(&set, 8 * 11 * 6);
}

fn compare(arguments: &[&str], nodes: usize) {
    let bench = Bench::new(
        env!("CARGO_BIN_EXE_program"),
        include_str!("../src/channel.toml"),
    );
    let run = |ranks: usize| {
        let name = format!("ranks-{ranks}");
        let ended = bench.run(ranks, &name, arguments)?;
        assert!(ended.status.success(), "{}", ended.text);
        Some(State::of(&bench.path(&name), nodes))
    };
    let one = run(1).expect("one rank needs no mpirun");
    for ranks in [2, 3, 4] {
        let Some(several) = run(ranks) else {
            return;
        };
        let [velocity, fibres] = one.difference(&several);
        println!("{ranks} ranks: velocity {velocity:.2e}, fibres {fibres:.2e}");
        assert!(
            velocity < 1e-8,
            "{ranks} ranks: velocity differs by {velocity:e}"
        );
        assert!(fibres < 1e-8, "{ranks} ranks: fibres differ by {fibres:e}");
    }
}
