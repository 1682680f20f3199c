//! The slip of points that are held in a creeping flow, solved with the flow through `Fluid::begin_step`: the equation
//! (1/β + S R Sᵀ) F = −S u(0) for the forces on the fluid is symmetric, so that conjugate gradients solve it where taking
//! the forces of the last answer runs away.

use fibreflow_coupling::Coupling;
use fibreflow_fibre::{Ambient, Reaction};
use fibreflow_fluid::{
    BoundaryCondition, CreepingStep, Fluid, FluidSettings, Inertia, VelocityProfile,
};
use fibreflow_mesh::{BoxElement, BoxMesh, distribute, geometry};
use fibreflow_parallel::Communicator;
use nalgebra::Vector3;
use std::sync::Arc;

const DENSITY: f64 = 1.2;
const VISCOSITY: f64 = 0.8;
/// Force by slip \[N·s/m\]: far beyond what the mobility of a node bears if forces lag.
const DRAG: f64 = 3.0;
const CELLS: usize = 10;

type Vectors = Vec<Vector3<f64>>;

/// A sheared gap with a row of points across the flow.
struct Held {
    fluid: Fluid,
    coupling: Coupling,
    points: Vectors,
}

fn held(inertia: Inertia, element: BoxElement) -> Held {
    let mesh = BoxMesh {
        size: [1.0; 3],
        cells: [CELLS; 3],
        periodic: [true, false, true],
        element,
        ..BoxMesh::default()
    };
    let mesh = distribute(&Communicator::single(), Some(mesh.build().expect("box")));
    let mesh = Arc::new(mesh.expect("mesh"));
    let geometry = Arc::new(geometry::dual(&mesh).expect("geometry"));
    let mut settings = FluidSettings::new(DENSITY, VISCOSITY);
    settings.inertia = inertia;
    settings.pressure.relative_tolerance = 1e-9;
    settings.boundary = vec![
        BoundaryCondition::WALL,
        BoundaryCondition::MovingWall {
            profile: VelocityProfile::Uniform([1.0, 0.0, 0.0]),
        },
    ];
    let no_slip = (0..mesh.owned()).map(|i| mesh.nodes[i][1].fract() == 0.0);
    let coupling = Coupling::new(mesh.clone(), geometry.clone(), no_slip.collect());
    let mut fluid = Fluid::new(mesh, geometry, settings).expect("fluid");
    fluid.set_velocity(|x| [x[1], 0.0, 0.0]).expect("start");
    Held {
        coupling: coupling.expect("coupling"),
        fluid,
        points: (0..7)
            .map(|k| Vector3::new(0.43, 0.52, 0.11 * f64::from(k) + 0.08))
            .collect(),
    }
}

/// Velocities at the points under forces on the fluid there.
fn answer(
    step: &mut CreepingStep<'_>,
    coupling: &mut Coupling,
    points: &Vectors,
    forces: &Vectors,
) -> Vectors {
    let mut ambient = Ambient::default();
    coupling
        .sample(step.velocity(), points, &mut ambient)
        .expect("sample");
    let reaction = Reaction {
        force: forces.clone(),
        torque: vec![Vector3::zeros(); forces.len()],
    };
    step.body_force_mut().fill([0.0; 4]);
    coupling
        .spread(&reaction, step.body_force_mut())
        .expect("spread");
    step.solve().expect("solve");
    coupling
        .sample(step.velocity(), points, &mut ambient)
        .expect("sample");
    ambient.velocity
}

fn dot(a: &Vectors, b: &Vectors) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(b)).sum()
}

/// a + s b.
fn plus(a: &Vectors, s: f64, b: &Vectors) -> Vectors {
    a.iter().zip(b).map(|(a, b)| a + s * b).collect()
}

/// Forces on the fluid by conjugate gradients to 1e-6, and the iterations.
fn solve_slip(
    step: &mut CreepingStep<'_>,
    coupling: &mut Coupling,
    points: &Vectors,
) -> (Vectors, usize) {
    let none = vec![Vector3::zeros(); points.len()];
    let free = answer(step, coupling, points, &none);
    let mut forces = none.clone();
    let mut left = plus(&none, -1.0, &free);
    let (mut direction, start) = (left.clone(), dot(&left, &left));
    let mut size = start;
    let mut iterations = 0;
    while size > 1e-14 * start {
        assert!(iterations < 30, "no answer after {iterations} iterations");
        let moved = plus(&answer(step, coupling, points, &direction), -1.0, &free);
        let image = plus(&moved, 1.0 / DRAG, &direction);
        let along = size / dot(&direction, &image);
        forces = plus(&forces, along, &direction);
        left = plus(&left, -along, &image);
        let next = dot(&left, &left);
        direction = plus(&left, next / size, &direction);
        (size, iterations) = (next, iterations + 1);
    }
    (forces, iterations)
}

#[test]
fn the_slip_of_held_points_is_solved_with_the_flow() {
    let h = 1.0 / CELLS as f64;
    let slow = 100.0 * h * h * DENSITY / VISCOSITY;
    for (inertia, element, dt) in [
        (Inertia::Steady, BoxElement::Hexahedron, 1.0),
        (Inertia::Steady, BoxElement::Tetrahedron, 1.0),
        (Inertia::Linear, BoxElement::Hexahedron, slow),
        // Δt β/(ρ V) of the volume of a node.
        (
            Inertia::Linear,
            BoxElement::Hexahedron,
            10.0 * DENSITY * h.powi(3) / DRAG,
        ),
    ] {
        let Held {
            mut fluid,
            mut coupling,
            points,
        } = held(inertia, element);
        let mut step = fluid.begin_step(dt).expect("step");
        let (forces, iterations) = solve_slip(&mut step, &mut coupling, &points);
        let slip = answer(&mut step, &mut coupling, &points, &forces);
        step.finish().expect("finish");
        let size = dot(&forces, &forces).sqrt();
        let law = plus(&forces, DRAG, &slip);
        let off = dot(&law, &law).sqrt() / size;
        // Forces of the last answer instead: each round multiplies the error by the gain.
        let mut lagged = forces.iter().map(|f| 1.001 * f).collect();
        let mut step = fluid.begin_step(dt).expect("step");
        let rounds: Vec<f64> = (0..3)
            .map(|_| {
                let velocity = answer(&mut step, &mut coupling, &points, &lagged);
                lagged = velocity.iter().map(|u| -DRAG * u).collect();
                let error = plus(&lagged, -1.0, &forces);
                dot(&error, &error).sqrt() / size
            })
            .collect();
        println!(
            "{inertia:?}, {element:?}, Δt {dt:.1e}: {iterations} iterations, drag law off by {off:.1e}; lagged, wrong by {rounds:.4?}"
        );
        assert!(iterations <= 12 && off < 3e-6);
        assert!(
            forces.iter().all(|f| f.x < 0.0),
            "held points hold the flow back"
        );
        if inertia == Inertia::Steady || dt == slow {
            assert!(
                rounds[1] > 3.0 * rounds[0] && rounds[2] > 3.0 * rounds[1],
                "lagging would do: {rounds:?}"
            );
        }
    }
}
