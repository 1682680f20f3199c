//! The matrix of Newton's iteration against differences of its residual, for every law.

use super::{Action, Base, ImplicitSettings, Workspace};
use crate::hydrodynamics::{
    DragModel, FluidProperties, SlenderConstants, SpheroidRatio, TorqueModel,
};
use crate::integrate::{Batch, Flow};
use crate::{
    Ambient, Fibre, FibreSettings, FibreSystem, Hydrodynamics, Material, Matrix3, Vector3,
};
use fibreflow_parallel::Communicator;
use nalgebra::Vector6;

const TAU: f64 = 0.3;

/// A soft fibre of four segments, a little bent in space, end to end 0.97 of its length.
fn system(drag: DragModel, torque: TorqueModel) -> FibreSystem {
    let place = |i: usize| {
        let s = 0.25 * i as f64;
        Vector3::new(s, 0.2 * s * s, 0.1 * s * s * s)
    };
    let fibre = Fibre::new(
        0,
        Material::new(0.02, 30.0, 0.3, 0.5),
        (0..5).map(place).collect(),
    );
    let law = Hydrodynamics {
        fluid: FluidProperties {
            density: 1.0,
            viscosity: 0.1,
        },
        drag,
        torque,
        point_spacing: f64::INFINITY,
    };
    let settings = FibreSettings {
        hydrodynamics: Some(law),
        ..FibreSettings::default()
    };
    FibreSystem::new(Communicator::single(), settings, vec![fibre]).expect("valid")
}

fn flow(speed: f64, x: &Vector3) -> (Vector3, Matrix3) {
    let gradient = Matrix3::new(0.3, -1.2, 0.5, 0.7, 0.1, -0.4, 0.9, 0.2, -0.4) * speed;
    (
        gradient * x + Vector3::new(0.4, 1.0, -0.3) * speed,
        gradient,
    )
}

/// Largest difference between a column of the matrix and that of the residual's differences, by the column's length.
fn worst_column(drag: DragModel, torque: TorqueModel, speed: f64, inertia: bool) -> f64 {
    let mut system = system(drag, torque);
    let law = system.settings.hydrodynamics.expect("a law");
    let formula = move |x: &Vector3, _: f64| flow(speed, x);
    let ambient = Ambient::default();
    let action = Action {
        model: &system.model,
        flow: Some(Flow {
            law: &law,
            ambient: &ambient,
            formula: Some(&formula),
            inertia,
            dt: 1.0,
        }),
        settings: &ImplicitSettings::DEFAULT,
        symmetric: false,
    };
    for (i, v) in system.motion.velocity.iter_mut().enumerate() {
        *v = Vector3::new(0.1, -0.2, 0.3) * (i as f64 * 0.3 * speed);
    }
    let start = system.motion.clone();
    let (motion, scratch) = (&mut system.motion, &mut system.scratch);
    let mut fibre = Batch::all(action.model, motion, scratch, &mut system.reaction);
    let mut work = Workspace::default();
    let nodes = start.position.len();
    work.resize(nodes, false);
    for i in 0..nodes {
        work.base[i] = Base {
            position: start.position[i],
            velocity: Vector3::zeros(),
            orientation: start.orientation[i],
            spin: Vector3::zeros(),
        };
    }
    fibre.assemble(&action, &mut work, TAU, 1.0);
    let rows = work.rows.clone();
    let (share, response) = (work.low_rank.share.clone(), work.low_rank.response.clone());
    let mut residual = |node: usize, c: usize, step: f64| {
        fibre.position.copy_from_slice(&start.position);
        fibre.velocity.copy_from_slice(&start.velocity);
        fibre.orientation.copy_from_slice(&start.orientation);
        fibre
            .angular_velocity
            .copy_from_slice(&start.angular_velocity);
        work.rhs.fill(Vector6::zeros());
        work.rhs[node][c] = step;
        fibre.change(&action.model.nodes, &work, TAU, 1.0);
        fibre.assemble(&action, &mut work, TAU, 1.0);
        work.rhs.clone()
    };
    let mut worst = 0.0_f64;
    for node in 0..nodes {
        for c in 0..6 {
            let h = 3e-6;
            let (up, down) = (residual(node, c, h), residual(node, c, -h));
            let (mut error, mut size) = (0.0, 0.0);
            for i in 0..nodes {
                let mut column = match i as i64 - node as i64 {
                    0 => rows[i].diagonal.column(c).into_owned(),
                    1 => rows[i].lower.column(c).into_owned(),
                    -1 => rows[i].upper.column(c).into_owned(),
                    _ => Vector6::zeros(),
                };
                if c < 3 {
                    for k in 0..3 {
                        column[k] -= share[i] * response[node][(k, c)];
                    }
                }
                error += ((down[i] - up[i]) / (2.0 * h) - column).norm_squared();
                size += column.norm_squared();
            }
            worst = worst.max((error / size).sqrt());
        }
    }
    worst
}

#[test]
fn newtons_matrix_is_the_derivative_of_the_residual() {
    let jeffery = TorqueModel::Jeffery(SlenderConstants::Split);
    let auto = DragModel::Auto(SlenderConstants::Batchelor);
    let cox = SpheroidRatio::Cox;
    for (drag, torque, speed) in [
        (DragModel::None, TorqueModel::None, 1.0),
        (
            DragModel::SlenderBody(SlenderConstants::Batchelor),
            TorqueModel::Kunhappan,
            1.0,
        ),
        (
            DragModel::SlenderBody(SlenderConstants::Split),
            jeffery,
            1.0,
        ),
        (DragModel::SlenderBody(SlenderConstants::Ends), jeffery, 1.0),
        (DragModel::InfiniteCylinder, jeffery, 1.0),
        (DragModel::InfiniteCylinder, jeffery, 10.0),
        (auto, jeffery, 1e-3),
        (auto, jeffery, 0.1),
        (auto, jeffery, 10.0),
        // Where the cylinder's law begins to act, the change of Δ with the slip is not in the matrix.
        (DragModel::Auto(SlenderConstants::Split), jeffery, 1e-3),
        (
            DragModel::ProlateSpheroid(cox),
            TorqueModel::ProlateSpheroid(cox),
            1.0,
        ),
    ] {
        let worst = worst_column(drag, torque, speed, false);
        println!("{drag:?}, {torque:?}, speed {speed}: {worst:.1e}");
        assert!(worst < 1e-6, "{drag:?}, {torque:?}, {speed}: {worst:e}");
    }
}

#[test]
fn the_fluids_inertia_is_in_newtons_matrix() {
    let worst = worst_column(DragModel::None, TorqueModel::None, 1.0, true);
    println!("inertia: {worst:.1e}");
    assert!(worst < 1e-6, "{worst:e}");
}
