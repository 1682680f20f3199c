//! F10: a force on a periodic array of points (Hasimoto 1959) and a point force between walls (Liron & Mochon 1976), both
//! smeared by a Gaussian that the mesh resolves, against sums over Fourier modes of the same problem.

mod common;

use common::{fluid_on, of, settings};
use fibreflow_fluid::{BoundaryCondition, Fluid, FluidSettings, Inertia};
use fibreflow_mesh::{BoxElement, BoxMesh};
use std::f64::consts::PI;

const VISCOSITY: f64 = 0.7;
const DENSITY: f64 = 1.3;
/// Width of the Gaussian: 3 spacings of the hexahedra, 4 of the tetrahedra.
const SIGMA: f64 = 0.125;

fn stokes(inertia: Inertia) -> FluidSettings {
    let mut settings = settings(DENSITY, VISCOSITY, 1e-8);
    settings.inertia = inertia;
    settings.pressure.max_iterations = 200;
    settings.hold_mean_velocity = true;
    settings
}

/// Kernel weights V g of a Gaussian of width `sigma` around `centre`, of sum one; `size` where periodic, else infinite.
fn kernel(fluid: &Fluid, centre: [f64; 3], size: [f64; 3], sigma: f64) -> Vec<f64> {
    let volumes = &fluid.geometry().volumes;
    let weight = |i: usize| {
        let x = fluid.mesh().nodes[i];
        let square = |c: usize| {
            let d: f64 = x[c] - centre[c];
            let d = if size[c].is_finite() {
                d - size[c] * (d / size[c]).round()
            } else {
                d
            };
            d * d
        };
        volumes[i] * (-(square(0) + square(1) + square(2)) / (2.0 * sigma * sigma)).exp()
    };
    let weights: Vec<f64> = (0..fluid.mesh().owned()).map(weight).collect();
    let sum: f64 = weights.iter().sum();
    weights.into_iter().map(|w| w / sum).collect()
}

/// Applies a unit force along `axis` through the kernel.
fn push(fluid: &mut Fluid, kernel: &[f64], axis: usize) {
    let volumes = fluid.geometry().volumes.clone();
    for ((f, k), v) in fluid.body_force_mut().iter_mut().zip(kernel).zip(volumes) {
        *f = [0.0; 4];
        f[axis] = k / v;
    }
}

/// Velocity along `axis`, averaged by the kernel.
fn answer(fluid: &Fluid, kernel: &[f64], axis: usize) -> f64 {
    kernel
        .iter()
        .zip(fluid.velocity())
        .map(|(k, u)| k * u[axis])
        .sum()
}

/// μ U/F of the array after `time` (in units of side²/ν) from rest: Σ ⅔ |ĝ|² (1 − e^(−k²t))/k² over the modes of a box of
/// side one.
fn array_mobility(sigma: f64, time: f64) -> f64 {
    let reach = (6.0 / (2.0 * PI * sigma)).ceil() as i32;
    let mut sum = 0.0;
    for a in -reach..=reach {
        for b in -reach..=reach {
            for c in -reach..=reach {
                let square = 4.0 * PI * PI * f64::from(a * a + b * b + c * c);
                if square > 0.0 {
                    let grown = -(-square * time).exp_m1();
                    sum += 2.0 / 3.0 * (-square * sigma * sigma).exp() / square * grown;
                }
            }
        }
    }
    sum
}

/// Steps of 1e-2, 1 and 100 h²/ν: what is steady stays, in one step from another pressure as well, and four steps from
/// rest follow `exact`(t ν) as far as it is given. Largest relative error of each.
fn any_step(
    steady: &Fluid,
    mut fluid: Fluid,
    kernel: &[f64],
    h: f64,
    exact: impl Fn(f64) -> f64,
) -> [f64; 2] {
    let expected = answer(steady, kernel, 0);
    let mut worst = [0.0f64; 2];
    for factor in [1e-2, 1.0, 1e2] {
        let dt = factor * h * h * DENSITY / VISCOSITY;
        let mut state = steady.state();
        // A wrong pressure, so that there is something to solve.
        for (_, _, values) in state.node.iter_mut().filter(|n| n.0 == "fluid.pressure") {
            values.iter_mut().for_each(|p| *p *= 0.5);
        }
        fluid.restore(state).expect("state");
        push(&mut fluid, kernel, 0);
        let report = fluid.advance(dt).expect("step");
        let kept = answer(&fluid, kernel, 0) / expected - 1.0;
        fluid.set_velocity(|_| [0.0; 3]).expect("start");
        let mut iterations = 0;
        for _ in 0..4 {
            iterations += fluid.advance(dt).expect("step").poisson_iterations;
        }
        let grown = VISCOSITY * answer(&fluid, kernel, 0) / exact(4.0 * factor * h * h) - 1.0;
        println!(
            "Δt {factor} h²/ν: {} and {iterations} iterations, steady to {kept:.1e}, from rest {grown:.1e}",
            report.poisson_iterations
        );
        worst = [worst[0].max(kept.abs()), worst[1].max(grown.abs())];
    }
    worst
}

#[test]
fn array_of_forces_settles_as_hasimoto_says() {
    for (element, cells, jitter) in [
        (BoxElement::Hexahedron, 24, 0.0),
        (BoxElement::Tetrahedron, 32, 0.2),
    ] {
        let mesh = BoxMesh {
            periodic: [true; 3],
            ..of(element, [1.0; 3], [cells; 3], jitter)
        };
        let h = 1.0 / cells as f64;
        let build = |inertia| fluid_on(&mesh, stokes(inertia), |_| unreachable!("no patches"));
        let mut fluid = build(Inertia::Steady);
        let kernel = kernel(&fluid, [0.5; 3], [1.0; 3], SIGMA);
        push(&mut fluid, &kernel, 0);
        let report = fluid.advance(1.0).expect("step");
        let found = VISCOSITY * answer(&fluid, &kernel, 0);
        let exact = array_mobility(SIGMA, f64::INFINITY);
        // Hasimoto: F/(6πμaU) = 1/(1 − 1.7601 φ^⅓ + φ − …), for the sphere a = σ√π of the same mobility alone.
        let radius = SIGMA * PI.sqrt();
        let phi = 4.0 / 3.0 * PI * radius.powi(3);
        let ratio = exact * 6.0 * PI * radius;
        let hasimoto = 1.0 - 1.7601 * phi.cbrt() + phi;
        println!(
            "{element:?}: {} iterations, mobility {found:.6}, modes {exact:.6} (error {:.2e}), {ratio:.4} of a free one, \
             Hasimoto {hasimoto:.4}",
            report.poisson_iterations,
            found / exact - 1.0
        );
        assert!((ratio - hasimoto).abs() < 0.01);
        assert!((found / exact - 1.0).abs() < 0.01);
        assert!(fluid.divergence_max() < 1e-6 * found / h);
        assert!(fluid.bulk_velocity().iter().all(|u| u.abs() < 1e-12));
        let [kept, grown] = any_step(&fluid, build(Inertia::Linear), &kernel, h, |t| {
            array_mobility(SIGMA, t)
        });
        assert!(kept < 1e-3 && grown < 0.01);
    }
}

/// μ U/F for a Gaussian force between walls at y = 0 and 1, periodic with sides `size` in x and z, along the walls and
/// across: modes in x and z, fine differences in y.
fn wall_mobility(size: f64, height: f64, sigma: f64) -> [f64; 2] {
    const N: usize = 800;
    let dy = 1.0 / N as f64;
    let y = |j: usize| j as f64 * dy;
    let gauss = |j: usize| {
        (-(y(j) - height).powi(2) / (2.0 * sigma * sigma)).exp() / (sigma * (2.0 * PI).sqrt())
    };
    let g: Vec<f64> = (0..=N).map(gauss).collect();
    let slope: Vec<f64> = (1..N).map(|j| (g[j + 1] - g[j - 1]) / (2.0 * dy)).collect();
    let inner: Vec<f64> = g[1..N].to_vec();
    let reach = (5.0 * size / (2.0 * PI * sigma)).ceil() as i32;
    let mut sums = [0.0; 2];
    // One quarter of the modes with multiplicity; those of equal wavenumber share their answer.
    let mut known = std::collections::BTreeMap::new();
    for a in 0..=reach {
        for b in 0..=reach {
            let times = f64::from((1 + i32::from(a > 0)) * (1 + i32::from(b > 0)));
            let k = 2.0 * PI / size * f64::from(a * a + b * b).sqrt();
            let [transverse, longitudinal, normal] =
                *known.entry(a * a + b * b).or_insert_with(|| {
                    let dot = |u: &[f64], v: &[f64]| {
                        u.iter().zip(v).map(|(a, b)| a * b).sum::<f64>() * dy
                    };
                    let t = diffused(&inner, k, dy);
                    if k == 0.0 {
                        return [dot(&t, &inner), dot(&t, &inner), 0.0];
                    }
                    let v = biharmonic(&slope, k, dy);
                    // u_l = −V', ∫ g u_l = ∫ g' V.
                    let w = biharmonic(&inner, k, dy);
                    [dot(&t, &inner), dot(&slope, &v), k * k * dot(&w, &inner)]
                });
            let along = if a + b > 0 {
                f64::from(a * a) / f64::from(a * a + b * b)
            } else {
                1.0
            };
            let weight = times * (-k * k * sigma * sigma).exp() / (size * size);
            sums[0] += weight * (along * longitudinal + (1.0 - along) * transverse);
            sums[1] += weight * normal;
        }
    }
    sums
}

/// (k² − D²) u = f, u = 0 at the ends.
fn diffused(f: &[f64], k: f64, dy: f64) -> Vec<f64> {
    let (off, centre) = (-1.0 / (dy * dy), k * k + 2.0 / (dy * dy));
    banded(f, |_, d| {
        if d == 0 {
            centre
        } else if d == 1 {
            off
        } else {
            0.0
        }
    })
}

/// (D² − k²)² v = f, v = v' = 0 at the ends.
fn biharmonic(f: &[f64], k: f64, dy: f64) -> Vec<f64> {
    let (h2, n) = (dy * dy, f.len());
    banded(f, |i, d| match d {
        0 => {
            let end = if i == 0 || i == n - 1 { 1.0 } else { 0.0 };
            (6.0 + end) / (h2 * h2) + 4.0 * k * k / h2 + k.powi(4)
        }
        1 => -4.0 / (h2 * h2) - 2.0 * k * k / h2,
        _ => 1.0 / (h2 * h2),
    })
}

/// Symmetric pentadiagonal system by L D Lᵀ; `entry(i, d)` is A[i][i + d].
fn banded(f: &[f64], entry: impl Fn(usize, usize) -> f64) -> Vec<f64> {
    let n = f.len();
    let (mut diagonal, mut lower) = (vec![0.0; n], vec![[0.0; 2]; n]);
    let mut x = f.to_vec();
    for i in 0..n {
        let second = if i >= 2 {
            entry(i - 2, 2) / diagonal[i - 2]
        } else {
            0.0
        };
        let mut first = if i >= 1 { entry(i - 1, 1) } else { 0.0 };
        if i >= 2 {
            first -= second * diagonal[i - 2] * lower[i - 1][0];
        }
        let first = if i >= 1 { first / diagonal[i - 1] } else { 0.0 };
        let mut pivot = entry(i, 0);
        if i >= 1 {
            pivot -= first * first * diagonal[i - 1];
            x[i] -= first * x[i - 1];
        }
        if i >= 2 {
            pivot -= second * second * diagonal[i - 2];
            x[i] -= second * x[i - 2];
        }
        (diagonal[i], lower[i]) = (pivot, [first, second]);
    }
    for i in (0..n).rev() {
        x[i] /= diagonal[i];
        if i + 1 < n {
            x[i] -= lower[i + 1][0] * x[i + 1];
        }
        if i + 2 < n {
            x[i] -= lower[i + 2][1] * x[i + 2];
        }
    }
    x
}

#[test]
fn force_between_walls_is_screened() {
    let height = 0.35;
    for (element, cells, size, jitter) in [
        (BoxElement::Hexahedron, 24, 2.0, 0.0),
        (BoxElement::Tetrahedron, 32, 1.0, 0.15),
    ] {
        let h = 1.0 / cells as f64;
        let across = (size * cells as f64) as usize;
        let mesh = BoxMesh {
            periodic: [true, false, true],
            ..of(element, [size, 1.0, size], [across, cells, across], jitter)
        };
        let build = |inertia| fluid_on(&mesh, stokes(inertia), |_| BoundaryCondition::WALL);
        let mut fluid = build(Inertia::Steady);
        let kernel = kernel(
            &fluid,
            [0.5 * size, height, 0.5 * size],
            [size, f64::INFINITY, size],
            SIGMA,
        );
        let exact = wall_mobility(size, height, SIGMA);
        for axis in [1, 0] {
            push(&mut fluid, &kernel, axis);
            let clock = std::time::Instant::now();
            let report = fluid.advance(1.0).expect("step");
            let spent = clock.elapsed().as_secs_f64() / fluid.mesh().owned() as f64;
            let found = VISCOSITY * answer(&fluid, &kernel, axis);
            let free = 1.0 / (6.0 * PI.powf(1.5) * SIGMA);
            println!(
                "{element:?} along {axis}: {} iterations, {:.1} µs per node, mobility {found:.6}, modes {:.6} (error {:.2e}), {:.3} of a free one",
                report.poisson_iterations,
                1e6 * spent,
                exact[axis],
                found / exact[axis] - 1.0,
                exact[axis] / free,
            );
            assert!((found / exact[axis] - 1.0).abs() < 0.01);
        }
        let loads = fluid.patch_loads([0.0; 3]);
        let wall: f64 = loads.iter().map(|l| l.force()[0]).sum();
        assert!((wall - 1.0).abs() < 1e-6, "the walls take {wall}");
        if element == BoxElement::Hexahedron {
            // Without a sum for the growth: it is compared with the steady end after the longest steps alone.
            let end = |t: f64| {
                if t > 100.0 * h * h {
                    exact[0]
                } else {
                    f64::INFINITY
                }
            };
            let [kept, _] = any_step(&fluid, build(Inertia::Linear), &kernel, h, end);
            assert!(kept < 1e-3);
        }
    }
}
