//! Set-ups that several tests share.
#![allow(dead_code)]

use fibreflow_fluid::{BoundaryCondition, Fluid, FluidSettings, Mass};
use fibreflow_mesh::{BoxElement, BoxMesh, Image, LocalMesh, Mesh, Periods, geometry};
use fibreflow_solve::CgSettings;
use std::sync::Arc;

/// Fluid on a box, with a condition for each patch by name.
pub fn fluid_on(
    mesh: &BoxMesh,
    settings: FluidSettings,
    condition: impl Fn(&str) -> BoundaryCondition,
) -> Fluid {
    fluid_in(mesh.build().expect("box"), settings, condition)
}

/// Fluid of density 1 in a periodic box.
pub fn periodic(mesh: &BoxMesh, viscosity: f64, tolerance: f64) -> Fluid {
    let mesh = BoxMesh {
        periodic: [true; 3],
        ..mesh.clone()
    };
    fluid_on(&mesh, settings(1.0, viscosity, tolerance), |_| {
        unreachable!("no patches")
    })
}

pub fn settings(density: f64, viscosity: f64, tolerance: f64) -> FluidSettings {
    let solver = CgSettings {
        relative_tolerance: tolerance,
        absolute_tolerance: 0.0,
        max_iterations: 5000,
    };
    FluidSettings {
        momentum: solver,
        pressure: solver,
        ..FluidSettings::new(density, viscosity)
    }
}

/// A box of one kind of element.
pub fn of(element: BoxElement, size: [f64; 3], cells: [usize; 3], jitter: f64) -> BoxMesh {
    BoxMesh {
        size,
        cells,
        element,
        jitter,
        seed: 3,
        ..BoxMesh::default()
    }
}

/// Volume-weighted root mean square and largest magnitude of the velocity error.
pub fn errors(fluid: &Fluid, exact: impl Fn([f64; 3]) -> [f64; 3]) -> [f64; 2] {
    let (mesh, volumes) = (fluid.mesh(), &fluid.geometry().volumes);
    let (mut square, mut volume, mut largest) = (0.0, 0.0, 0.0f64);
    for i in 0..mesh.owned() {
        let (u, wanted) = (fluid.velocity()[i], exact(mesh.nodes[i]));
        let error: f64 = (0..3).map(|c| (u[c] - wanted[c]).powi(2)).sum();
        square += volumes[i] * error;
        volume += volumes[i];
        largest = largest.max(error.sqrt());
    }
    [(square / volume).sqrt(), largest]
}

/// What skew convection conserves \[J\]: ½ ρ uᵀB⁻¹u with the map B = (I + A + A²)V⁻¹, A = V⁻¹(V − M), from forces to rates
/// of velocity. Where mass is lumped that is the kinetic energy.
pub fn conserved_energy(fluid: &Fluid) -> f64 {
    let (geometry, u) = (fluid.geometry(), fluid.velocity());
    if geometry.orthogonal || fluid.settings().mass == Mass::Lumped {
        return fluid.kinetic_energy();
    }
    let volumes = &geometry.volumes;
    let lumped = |x: &[[f64; 4]]| -> Vec<[f64; 4]> {
        let row = |i: usize| {
            std::array::from_fn(|c| {
                let share = |e: usize| {
                    let j = geometry.columns[e] as usize;
                    f64::from(geometry.masses[e]) * (x[i][c] - x[j][c])
                };
                geometry.row(i).map(share).sum::<f64>() / volumes[i]
            })
        };
        (0..x.len()).map(row).collect()
    };
    // B⁻¹u = V y with (I + A + A²) y = u, 1 ≤ I + A + A² ≤ 3.
    let mut y = u.to_vec();
    for _ in 0..60 {
        let first = lumped(&y);
        let second = lumped(&first);
        for i in 0..y.len() {
            for c in 0..3 {
                y[i][c] += 0.5 * (u[i][c] - y[i][c] - first[i][c] - second[i][c]);
            }
        }
    }
    let pairs = u.iter().zip(&y).zip(volumes);
    let energy = |((u, y), v): ((&[f64; 4], &[f64; 4]), &f64)| -> f64 {
        (0..3).map(|c| 0.5 * v * u[c] * y[c]).sum()
    };
    fluid.settings().density * pairs.map(energy).sum::<f64>()
}

/// Least-squares slope of ln(error) over ln(n), as a positive order.
pub fn order(sizes: &[f64], errors: &[f64]) -> f64 {
    let mean = |v: &[f64]| v.iter().map(|x| x.ln()).sum::<f64>() / v.len() as f64;
    let (x0, y0) = (mean(sizes), mean(errors));
    let pairs = sizes.iter().zip(errors);
    let (mut xy, mut xx) = (0.0, 0.0);
    for (x, y) in pairs {
        xy += (x.ln() - x0) * (y.ln() - y0);
        xx += (x.ln() - x0).powi(2);
    }
    -xy / xx
}

/// Runs to `end` in equal steps as close to `dt` as possible.
pub fn run_to(fluid: &mut Fluid, end: f64, dt: f64) -> usize {
    let steps = (end / dt).ceil() as usize;
    let mut iterations = 0;
    for _ in 0..steps {
        let report = fluid.advance(end / steps as f64).expect("step");
        iterations += report.poisson_iterations;
    }
    iterations / steps.max(1)
}

/// A ring around the z axis: `cells` along angle, radius and z; its patches are `inner`, `outer`, `z_min`, `z_max`.
pub fn ring(element: BoxElement, [inner, outer]: [f64; 2], height: f64, cells: [usize; 3]) -> Mesh {
    let unrolled = BoxMesh {
        periodic: [true, false, false],
        ..of(
            element,
            [std::f64::consts::TAU, outer - inner, height],
            cells,
            0.0,
        )
    };
    let mut mesh = unrolled.build().expect("box");
    for x in &mut mesh.nodes {
        let (angle, radius) = (-x[0], inner + x[1]);
        (x[0], x[1]) = (radius * angle.cos(), radius * angle.sin());
    }
    // Once around is the node itself.
    mesh.elements.images.fill(Image::ZERO);
    mesh.boundary
        .iter_mut()
        .for_each(|face| face.images = [Image::ZERO; 4]);
    mesh.periods = Periods::default();
    mesh.patches = ["inner", "outer", "z_min", "z_max"]
        .map(String::from)
        .to_vec();
    mesh
}

/// Fluid on any mesh of one rank.
pub fn fluid_in(
    mesh: Mesh,
    settings: FluidSettings,
    condition: impl Fn(&str) -> BoundaryCondition,
) -> Fluid {
    fluid_of(2, mesh, settings, condition)
}

/// Fluid of second or fourth order on any mesh of one rank.
pub fn fluid_of(
    order: u8,
    mesh: Mesh,
    mut settings: FluidSettings,
    condition: impl Fn(&str) -> BoundaryCondition,
) -> Fluid {
    let local = Arc::new(LocalMesh::single(mesh));
    let dual = match order {
        4 => geometry::fourth(&local),
        _ => geometry::dual(&local),
    };
    let dual = Arc::new(dual.expect("dual geometry"));
    settings.boundary = local.patches.iter().map(|p| condition(p)).collect();
    Fluid::new(local, dual, settings).expect("fluid")
}

/// Index of a patch.
pub fn patch(fluid: &Fluid, name: &str) -> usize {
    let found = fluid.mesh().patches.iter().position(|p| p == name);
    found.expect("patch")
}
