//! Orbit of a stiff chain of discs in shear from two Stokes solves, along and across the flow: e² is the ratio of its rates of turning, and
//! γ̇T = 2π(e + 1/e), exactly for a rigid body with two mirror planes in an unbounded flow.
//! `cargo run --release -p fibreflow-coupling --example chain_orbit BEADS RADIUS WIDTH LENGTH HEIGHT`

use fibreflow_coupling::smooth_profile::Profile;
use fibreflow_coupling::{BeadSettings, Beads, Chain};
use fibreflow_fluid::{BoundaryCondition, Fluid, FluidSettings, Inertia, VelocityProfile};
use fibreflow_mesh::{BoxMesh, LocalMesh, geometry};
use std::f64::consts::TAU;
use std::sync::Arc;

/// A plane of unit spacing between walls that move with u = ±½ height.
fn fluid(cells: [usize; 2]) -> Fluid {
    let mesh = BoxMesh {
        size: [cells[0] as f64, cells[1] as f64, 1.0],
        cells: [cells[0], cells[1], 1],
        periodic: [true, false, true],
        ..BoxMesh::default()
    };
    let local = LocalMesh::single(mesh.build().expect("box"));
    let geometry = geometry::dual(&local).expect("geometry");
    let mut settings = FluidSettings::new(1.0, 1.0);
    settings.inertia = Inertia::Steady;
    settings.pressure.relative_tolerance = 1e-6;
    let moving = |name: &String| {
        let half = 0.5 * cells[1] as f64;
        let u = if name == "y_max" { half } else { -half };
        BoundaryCondition::MovingWall {
            profile: VelocityProfile::Uniform([u, 0.0, 0.0]),
        }
    };
    settings.boundary = local.patches.iter().map(moving).collect();
    Fluid::new(Arc::new(local), Arc::new(geometry), settings).expect("fluid")
}

fn main() {
    let numbers: Vec<f64> = std::env::args()
        .skip(1)
        .map(|a| a.parse().expect("a number"))
        .collect();
    let &[count, radius, width, length, height] = &numbers[..] else {
        eprintln!("BEADS RADIUS WIDTH LENGTH HEIGHT");
        std::process::exit(2);
    };
    let mut iterations = 0;
    let rates = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]].map(|direction| {
        let mut fluid = fluid([length as usize, height as usize]);
        let half = radius * (count - 1.0);
        let chain = Chain {
            start: [
                0.5 * length - half * direction[0],
                0.5 * height - half * direction[1],
                0.0,
            ],
            direction,
            count: count as usize,
            psi_0: 0.0,
            youngs_modulus: 1e4,
            fixed: false,
        };
        let profile = Profile {
            radius,
            width,
            cutoff: 3.0 * width,
        };
        let mut beads = Beads::new(&fluid, BeadSettings::new(profile), &[chain]);
        beads.place(&fluid, None);
        beads.hold(&mut fluid, None, 1.0).expect("bodies");
        iterations = fluid.advance(1.0).expect("step").poisson_iterations;
        beads.follow(&mut fluid, 0.0);
        let (first, last) = (beads.beads()[0], beads.beads()[count as usize - 1]);
        let (span, change) = (
            last.position - first.position,
            last.velocity - first.velocity,
        );
        span.cross(&change).z / span.norm_squared()
    });
    let e = (rates[1] / rates[0]).sqrt();
    println!(
        "N_b = {count}, r_b = {radius}, ξ = {width}, {length} × {height}: e = {e:.4}, γ̇T = {:.3}; {iterations} iterations",
        TAU * (e + 1.0 / e)
    );
}
