//! Errors against exact answers.

use super::Scene;
use super::initial::Channel;
use crate::case::{AmbientFlow, Case, Exact, Fluid as FluidCase, Forcing, Initial};
use crate::clock::Clock;
use fibreflow_fibre::hydrodynamics::cox_aspect_ratio;
use fibreflow_fluid::Fluid;
use fibreflow_fluid::initial::TaylorGreen;
use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};
use std::path::Path;

/// Relative errors at the end of a run, by name; empty where the case has no exact answer. Collective.
///
/// `folder` is that of the output: the period of an orbit is read from the series.
pub fn errors(scene: &Scene, case: &Case, clock: &Clock, folder: &Path) -> BTreeMap<String, f64> {
    let found = match (case.exact, &case.fluid, scene.flow.fluid()) {
        (Some(Exact::TaylorGreen), Some(about), Some(fluid)) => {
            taylor_green(scene, about, fluid, clock)
        }
        (Some(Exact::Poiseuille), Some(about), Some(fluid)) => {
            poiseuille(scene, case, about, fluid)
        }
        (Some(Exact::Cantilever), _, _) => cantilever(scene, case),
        (Some(Exact::Jeffery), _, _) => jeffery(case, folder),
        _ => Vec::new(),
    };
    found
        .into_iter()
        .map(|(name, value)| (name.to_owned(), value))
        .collect()
}

type Errors = Vec<(&'static str, f64)>;

/// Volume-weighted L2 and largest error of the velocity, both by `scale` \[m/s\].
fn velocity_errors(
    scene: &Scene,
    fluid: &Fluid,
    scale: f64,
    exact: impl Fn([f64; 3]) -> [f64; 3],
) -> Errors {
    let (mesh, volumes) = (fluid.mesh(), &fluid.geometry().volumes);
    let (mut square, mut volume, mut largest) = (0.0, 0.0, 0.0_f64);
    for i in 0..mesh.owned() {
        let (u, wanted) = (fluid.velocity()[i], exact(mesh.nodes[i]));
        let error: f64 = (0..3).map(|c| (u[c] - wanted[c]).powi(2)).sum();
        square += volumes[i] * error;
        volume += volumes[i];
        largest = largest.max(error.sqrt());
    }
    let mut sums = [square, volume];
    scene.communicator.sum_slice(&mut sums);
    let largest = scene.communicator.max(largest);
    vec![
        ("velocity_l2", (sums[0] / sums[1]).sqrt() / scale),
        ("velocity_max", largest / scale),
    ]
}

fn taylor_green(scene: &Scene, about: &FluidCase, fluid: &Fluid, clock: &Clock) -> Errors {
    let Initial::TaylorGreen {
        amplitude,
        wavelength,
        drift,
    } = about.initial
    else {
        return Vec::new();
    };
    let exact = TaylorGreen {
        amplitude,
        wave_number: TAU / wavelength,
        drift,
        kinematic_viscosity: about.viscosity / about.density,
    };
    velocity_errors(scene, fluid, amplitude, |x| exact.velocity(clock.time, x))
}

/// u = G h² (1 − η²) / 2μ.
fn poiseuille(scene: &Scene, case: &Case, about: &FluidCase, fluid: &Fluid) -> Errors {
    let Forcing::PressureGradient {
        value,
        factor: None,
    } = about.forcing
    else {
        return Vec::new();
    };
    let Ok(channel) = Channel::new(case.domain().as_ref()) else {
        return Vec::new();
    };
    let half = 0.5 * (channel.high - channel.low);
    let peak = value.map(|g| g * half * half / (2.0 * about.viscosity));
    let scale = peak.iter().map(|u| u * u).sum::<f64>().sqrt();
    velocity_errors(scene, fluid, scale, |x| {
        let eta = (x[channel.across] - channel.low) / half - 1.0;
        peak.map(|u| u * (1.0 - eta * eta))
    })
}

/// Tip deflection P L³/3EI of Euler and Bernoulli, for loads across the fibre on its last node.
fn cantilever(scene: &Scene, case: &Case) -> Errors {
    let (Some(group), Some(fibres)) = (case.fibres.first(), &scene.fibres) else {
        return Vec::new();
    };
    let force: [f64; 3] = [0, 1, 2].map(|c| group.point_loads.iter().map(|l| l.force[c]).sum());
    let load = force.iter().map(|f| f * f).sum::<f64>().sqrt();
    let mut values = [0.0; 3];
    if let Some(fibre) = fibres.find(0) {
        let nodes = &fibres.positions()[fibres.offsets()[fibre]..fibres.offsets()[fibre + 1]];
        let across = nalgebra::Vector3::from(force) / load;
        let stiffness = fibres.material(fibre).bending_stiffness();
        let deflection = (nodes[nodes.len() - 1] - nodes[0]).dot(&across);
        values = [deflection, fibres.length(fibre), stiffness];
    }
    scene.communicator.sum_slice(&mut values);
    let [deflection, length, stiffness] = values;
    let exact = load * length.powi(3) / (3.0 * stiffness);
    vec![("tip_deflection", (deflection / exact - 1.0).abs())]
}

/// Period of the tracked fibre against 2π(r + 1/r)/γ̇ with the equivalent aspect ratio of Cox.
fn jeffery(case: &Case, folder: &Path) -> Errors {
    let (Some(group), Some(ambient)) = (case.fibres.first(), &case.ambient) else {
        return Vec::new();
    };
    let AmbientFlow::Shear { rate } = ambient.flow else {
        return Vec::new();
    };
    let text = std::fs::read_to_string(folder.join("series/fibre_0.csv")).unwrap_or_default();
    let orbit: Vec<(f64, f64)> = text.lines().skip(1).filter_map(phase).collect();
    let (Some(length), Some(period)) = (super::fibres::length(group), measured_period(&orbit))
    else {
        return Vec::new();
    };
    let r = cox_aspect_ratio(length / group.diameter);
    let exact = TAU * (r + 1.0 / r) / rate.abs();
    vec![("period", (period / exact - 1.0).abs())]
}

/// Time and angle of the end-to-end vector in the plane of shear, from a line of a track.
fn phase(line: &str) -> Option<(f64, f64)> {
    let values: Vec<f64> = line.split(',').filter_map(|v| v.parse().ok()).collect();
    let [_, time, .., x, y, _] = values[..] else {
        return None;
    };
    Some((time, y.atan2(x)))
}

/// Mean time between passages of the gradient direction, two of which make a period.
fn measured_period(orbit: &[(f64, f64)]) -> Option<f64> {
    let mut passages = Vec::new();
    for pair in orbit.windows(2) {
        let [(t0, a0), (t1, a1)] = [pair[0], pair[1]];
        // Angle from the gradient direction, modulo half a turn.
        let from = |a: f64| a.rem_euclid(PI) - 0.5 * PI;
        let (d0, d1) = (from(a0), from(a1));
        if d0 * d1 <= 0.0 && (d0 - d1).abs() < 0.5 * PI && d0 != d1 {
            passages.push(t0 + (t1 - t0) * d0 / (d0 - d1));
        }
    }
    passages.dedup_by(|a, b| (*a - *b).abs() < 1e-9);
    let (first, last) = (passages.first()?, passages.last()?);
    (passages.len() > 2).then(|| 2.0 * (last - first) / (passages.len() - 1) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_period_of_an_exact_orbit_is_found() {
        let (r, rate) = (12.0, 2.0);
        let exact = TAU * (r + 1.0 / r) / rate;
        // Jeffery: tan φ = r tan(2πt/T), φ from the gradient direction towards the flow.
        let at = |k: usize| {
            let t = 0.05 * k as f64;
            let turn = TAU * t / exact;
            let phi = (r * turn.sin()).atan2(turn.cos());
            (t, (0.5 * PI - phi).sin().atan2((0.5 * PI - phi).cos()))
        };
        let orbit: Vec<(f64, f64)> = (0..4000).map(at).collect();
        let period = measured_period(&orbit).expect("passages");
        assert!((period / exact - 1.0).abs() < 1e-3, "{period} {exact}");
    }
}
