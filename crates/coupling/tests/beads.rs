//! Beads in creeping flow: drag, rotation in shear, capillary force, energy, stiff chains.

use fibreflow_coupling::smooth_profile::Profile;
use fibreflow_coupling::{BeadSettings, Beads, Chain};
use fibreflow_fluid::{
    BoundaryCondition, Fluid, FluidSettings, Inertia, PhaseField, PhaseSettings, VelocityProfile,
};
use fibreflow_mesh::{BoxMesh, LocalMesh, geometry};
use std::f64::consts::{PI, SQRT_2};
use std::sync::Arc;

/// A plane of unit spacing, one element thick, between walls at y = 0 and the top that move at ∓ and ± `speed`, or periodic.
fn plane([nx, ny]: [usize; 2], spacing: f64, walls: Option<f64>) -> Fluid {
    fluid([nx, ny, 1], [spacing, spacing, 1.0], walls)
}

fn fluid(cells: [usize; 3], spacing: [f64; 3], walls: Option<f64>) -> Fluid {
    let mesh = BoxMesh {
        size: std::array::from_fn(|c| cells[c] as f64 * spacing[c]),
        cells,
        periodic: [true, walls.is_none(), true],
        ..BoxMesh::default()
    };
    let local = LocalMesh::single(mesh.build().expect("box"));
    let geometry = geometry::dual(&local).expect("geometry");
    let mut settings = FluidSettings::new(1.0, 1.0);
    settings.inertia = Inertia::Steady;
    let moving = |name: &String| {
        let speed = walls.unwrap_or(0.0);
        let u = if name == "y_max" { speed } else { -speed };
        BoundaryCondition::MovingWall {
            profile: VelocityProfile::Uniform([u, 0.0, 0.0]),
        }
    };
    settings.boundary = local.patches.iter().map(moving).collect();
    Fluid::new(Arc::new(local), Arc::new(geometry), settings).expect("fluid")
}

fn settings(radius: f64, width: f64) -> BeadSettings {
    BeadSettings::new(Profile {
        radius,
        width,
        // Far enough that nothing is cut off at all.
        cutoff: 8.0 * width,
    })
}

fn single(x: f64, y: f64) -> Chain {
    Chain {
        start: [x, y, 0.0],
        direction: [1.0, 0.0, 0.0],
        count: 1,
        psi_0: 0.0,
        youngs_modulus: 0.0,
        fixed: false,
    }
}

/// A flow past a fixed array of discs: Sangani & Acrivos 1982.
#[test]
fn a_bead_has_the_drag_of_a_disc() {
    for (radius, width) in [(6.0, 1.0), (6.0, 2.0), (8.0, 1.0)] {
        let (cells, speed) = (48, 0.3);
        let mut fluid = plane([cells, cells], 1.0, None);
        fluid.set_velocity(|_| [speed, 0.0, 0.0]).expect("flow");
        let fixed = Chain {
            fixed: true,
            ..single(20.3, 20.4)
        };
        let mut beads = Beads::new(&fluid, settings(radius, width), &[fixed]);
        beads.place(&fluid, None);
        beads.hold(&mut fluid, None, 1.0).expect("bodies");
        fluid.advance(1.0).expect("step");
        beads.follow(&mut fluid, 1.0);
        let share = PI * radius * radius / (cells * cells) as f64;
        let bracket =
            -0.5 * share.ln() - 0.738 + share - 0.887 * share.powi(2) + 2.038 * share.powi(3);
        let drag = beads.beads()[0].force.x / (4.0 * PI * speed / bracket);
        println!("r_b = {radius}, ξ = {width}: drag by that of a disc {drag:.4}");
        assert!((drag - 1.0).abs() < 0.02);
        assert!(beads.beads()[0].position.x == 20.3);
    }
}

/// A flow past a fixed cubic array of spheres: Sangani & Acrivos 1982, which is Hasimoto 1959 with more terms.
#[test]
fn a_bead_has_the_drag_of_a_sphere() {
    for (radius, width, cells) in [(5.0, 1.25, 32), (4.0, 1.6, 28)] {
        let speed = 0.3;
        let mut fluid = fluid([cells; 3], [1.0; 3], None);
        fluid.set_velocity(|_| [speed, 0.0, 0.0]).expect("flow");
        let profile = Profile {
            radius,
            width,
            cutoff: 5.0 * width,
        };
        let fixed = Chain {
            fixed: true,
            start: [13.3, 13.4, 13.1],
            ..single(0.0, 0.0)
        };
        let mut beads = Beads::new(&fluid, BeadSettings::new(profile), &[fixed]);
        beads.place(&fluid, None);
        beads.hold(&mut fluid, None, 1.0).expect("bodies");
        fluid.advance(1.0).expect("step");
        beads.follow(&mut fluid, 1.0);
        let share = 4.0 / 3.0 * PI * (radius / cells as f64).powi(3);
        let bracket = 1.0 - 1.7601 * share.cbrt() + share - 1.5593 * share.powi(2)
            + 3.9799 * share.powf(8.0 / 3.0)
            - 3.0734 * share.powf(10.0 / 3.0);
        let drag = beads.beads()[0].force.x / (6.0 * PI * radius * speed / bracket);
        println!("r_b = {radius}, ξ = {width}: drag by that of a sphere {drag:.4}");
        assert!((drag - 1.0).abs() < 0.02);
    }
}

#[test]
fn a_free_bead_turns_with_half_the_shear_rate() {
    let (height, speed) = (64.0, 0.5);
    let mut fluid = plane([64, 64], 1.0, Some(speed));
    let (x, y) = (31.7, 32.0);
    let mut beads = Beads::new(&fluid, settings(5.0, 1.0), &[single(x, y)]);
    beads.place(&fluid, None);
    beads.hold(&mut fluid, None, 1.0).expect("bodies");
    fluid.advance(1.0).expect("step");
    beads.follow(&mut fluid, 1.0);
    let (bead, rate) = (beads.beads()[0], 2.0 * speed / height);
    println!(
        "u = {:.1e}, ω = {:.5} of γ̇",
        bead.velocity.x,
        bead.spin.z / rate
    );
    assert!(bead.velocity.norm() < 1e-6 * speed);
    assert!((bead.spin.z / rate + 0.5).abs() < 0.015);
    assert!(bead.force.norm() < 1e-12 && bead.torque.norm() < 1e-12);
    assert!((bead.position.x - x - bead.velocity.x).abs() < 1e-12);
}

/// A bead of radius 5 at the lower interface of a wavy band of fluid A in a periodic box of 32.
fn at_interface(per_unit: usize, psi_0: f64) -> (Fluid, PhaseField, Beads) {
    let cells = 32 * per_unit;
    let fluid = plane([cells, cells], 1.0 / per_unit as f64, None);
    let phase = PhaseSettings::new(1.0, 1.0, 0.5);
    let mut field = PhaseField::new(&fluid, phase).expect("field");
    let band = |x: [f64; 3]| {
        let away = x[1] - 23.0 - (PI / 16.0 * x[0]).sin();
        ((8.0 - (away - 32.0 * (away / 32.0).round()).abs()) / SQRT_2).tanh()
    };
    field.set(&fluid, band).expect("start");
    let chain = Chain {
        psi_0,
        ..single(16.2, 16.3)
    };
    let mut beads = Beads::new(&fluid, settings(5.0, 1.0), &[chain]);
    beads.place(&fluid, Some(&mut field));
    (fluid, field, beads)
}

/// What the fluid and the bead take sums up to zero as the mesh is refined: both come from one stress.
#[test]
fn capillary_forces_of_fluid_and_bead_balance() {
    let residuals = [1, 2, 4].map(|per_unit| {
        let (mut fluid, mut field, mut beads) = at_interface(per_unit, 0.4);
        for _ in 0..20 {
            field.advance(&fluid, 0.5).expect("order parameter");
        }
        let mut force = vec![[0.0; 4]; fluid.mesh().total()];
        field.add_force(&fluid, &mut force);
        let volumes = &fluid.geometry().volumes;
        let on_fluid = |c: usize| -> f64 { force.iter().zip(volumes).map(|(f, v)| f[c] * v).sum() };
        let sums = [on_fluid(0), on_fluid(1)];
        // The force of the fluids on a bead at rest is the capillary one where nothing flows.
        let capillary = beads.capillary(&fluid, &field)[0];
        beads.hold(&mut fluid, Some(&field), 1.0).expect("bodies");
        let left = (sums[0] + capillary.x).hypot(sums[1] + capillary.y);
        println!(
            "{per_unit}: fluid {sums:.4?}, bead {:.4?}, left {left:.2e}",
            capillary.as_slice()
        );
        left / capillary.norm()
    });
    assert!(residuals[1] < 0.02 && residuals[1] / residuals[2] > 3.5);
}

#[test]
fn the_free_energy_falls_while_a_bead_moves_and_flow_and_bead_come_to_rest() {
    let (mut fluid, mut field, mut beads) = at_interface(1, 0.4);
    let mut energy = field.energy(&fluid).total();
    let mut fastest = 0.0;
    for step in 0..60 {
        let dt = 0.5 * (1.0 + f64::from(step) / 10.0);
        field.advance(&fluid, dt).expect("order parameter");
        let force = fluid.body_force_mut();
        force.fill([0.0; 4]);
        let mut force = force.to_vec();
        field.add_force(&fluid, &mut force);
        fluid.body_force_mut().copy_from_slice(&force);
        beads.hold(&mut fluid, Some(&field), dt).expect("bodies");
        fluid.advance(dt).expect("flow");
        beads.follow(&mut fluid, dt);
        beads.place(&fluid, Some(&mut field));
        let now = field.energy(&fluid).total();
        assert!(now < energy, "step {step}: {energy} → {now}");
        energy = now;
        fastest = beads.beads()[0].velocity.norm();
    }
    let bead = beads.beads()[0];
    println!(
        "F = {energy:.4}, bead at {:.3}, speed {fastest:.2e}",
        bead.position.y
    );
    assert!(bead.position.y > 16.3 && fastest < 0.01);
}

/// Two beads of four in a band of fluid A, and a chain beside it; the amount in the band but for its soft edges.
#[test]
fn what_fluid_a_wets_and_holds() {
    let fluid = plane([64, 80], 0.5, None);
    let mut field = PhaseField::new(&fluid, PhaseSettings::new(1.0, 1.0, 0.5)).expect("field");
    let band = |x: [f64; 3]| ((9.0 - (x[1] - 9.0).abs()) / SQRT_2).tanh();
    field.set(&fluid, band).expect("start");
    let across = Chain {
        direction: [0.0, 1.0, 0.0],
        count: 4,
        ..single(8.0, 9.0)
    };
    let above = Chain {
        start: [24.0, 27.0, 0.0],
        direction: [0.0, 1.0, 0.0],
        count: 1,
        ..across
    };
    let mut beads = Beads::new(&fluid, settings(4.0, 1.0), &[across, above]);
    beads.place(&fluid, Some(&mut field));
    assert_eq!(beads.wetted(&fluid, &field), [0.5, 0.0]);
    assert_eq!(beads.radii(), [f64::INFINITY; 2]);

    // ∫ tanh(s/√2) from ψ = ½ on, of two edges, in a box that is 32 wide.
    let edge = |psi: f64| SQRT_2 * psi.atanh().cosh().ln();
    let wanted = 2.0 * (edge((9.0 / SQRT_2).tanh()) - edge(0.5)) * 32.0;
    let found = field.in_drops(&fluid);
    assert!((found / wanted - 1.0).abs() < 0.03, "{found} {wanted}");
}

/// Beams of any stiffness in steps of one size: a bent chain straightens, faster the stiffer it is, and keeps its length.
#[test]
fn stiff_chains_need_no_smaller_steps() {
    let ends = [10.0, 1e3, 1e7].map(|youngs_modulus| {
        let mut fluid = plane([64, 64], 1.0, Some(0.5));
        let chain = Chain {
            count: 5,
            youngs_modulus,
            start: [32.0, 18.0, 0.0],
            direction: [0.2, 1.0, 0.0],
            ..single(0.0, 0.0)
        };
        let mut beads = Beads::new(&fluid, settings(3.0, 0.75), &[chain]);
        let mut iterations = 0;
        for _ in 0..12 {
            beads.place(&fluid, None);
            beads.hold(&mut fluid, None, 4.0).expect("bodies");
            iterations = fluid.advance(4.0).expect("step").poisson_iterations;
            beads.follow(&mut fluid, 4.0);
        }
        let positions: Vec<_> = beads.beads().iter().map(|b| b.position).collect();
        let chords = positions.windows(2).map(|p| (p[1] - p[0]).norm());
        let stretch = chords.map(|l| (l / 6.0 - 1.0).abs()).fold(0.0, f64::max);
        let span = positions[4] - positions[0];
        let bow = (positions[2] - positions[0]).cross(&span).norm() / span.norm();
        let angle = span.x.atan2(span.y);
        println!(
            "E = {youngs_modulus:e}: stretched by {stretch:.1e}, bow {bow:.3}, turned by {angle:.3}, {iterations} iterations"
        );
        (stretch, bow, angle, iterations)
    });
    assert!(ends[2].0 < 0.02 && ends[2].1 < ends[0].1 && ends[2].1 < 0.05);
    assert!(ends[2].3 <= ends[0].3 + 3);
    // Stiff beams do not slow a chain down.
    assert!((ends[1].2 - ends[2].2).abs() < 0.02 * ends[2].2);
}
