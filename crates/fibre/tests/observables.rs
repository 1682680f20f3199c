//! Statistics of directions and shapes against exact values.

use fibreflow_fibre::hydrodynamics::cox_aspect_ratio;
use fibreflow_fibre::{
    FOURTH, Fibre, FibreSettings, FibreSystem, Inside, Material, Shear, Vector3,
};
use fibreflow_parallel::Communicator;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::{PI, TAU};

fn material() -> Material {
    Material::new(0.01, 1e9, 0.3, 1000.0)
}

fn system(shapes: Vec<Vec<Vector3>>) -> FibreSystem {
    let fibres = shapes.into_iter().zip(0..);
    let fibres = fibres.map(|(nodes, id)| Fibre::new(id, material(), nodes));
    FibreSystem::new(
        Communicator::single(),
        FibreSettings::default(),
        fibres.collect(),
    )
    .expect("fibres")
}

fn straight(direction: Vector3, segments: usize, step: f64) -> Vec<Vector3> {
    let node = |k: usize| direction * (step * k as f64);
    (0..=segments).map(node).collect()
}

fn component(fourth: &[f64; 15], mut indices: [usize; 4]) -> f64 {
    indices.sort_unstable();
    let place = FOURTH.iter().position(|f| *f == indices);
    fourth[place.expect("listed")]
}

#[test]
fn moments_of_known_directions_are_weighted_by_length() {
    let p = Vector3::new(1.0, 2.0, -2.0) / 3.0;
    let moments = system(vec![straight(p, 3, 0.2)]).orientation_moments(&Inside::EVERYWHERE);
    assert!((moments.second - p * p.transpose()).amax() < 1e-14);
    for [i, j, k, l] in FOURTH {
        let exact = p[i] * p[j] * p[k] * p[l];
        assert!((component(&moments.fourth, [l, k, j, i]) - exact).abs() < 1e-14);
    }
    // One metre along x in five pieces, three along y in one.
    let mixed = vec![
        straight(Vector3::x(), 5, 0.2),
        straight(-Vector3::y(), 1, 3.0),
    ];
    let moments = system(mixed).orientation_moments(&Inside::EVERYWHERE);
    assert!((moments.second[(0, 0)] - 0.25).abs() < 1e-14);
    assert!((component(&moments.fourth, [1, 1, 1, 1]) - 0.75).abs() < 1e-14);
    assert!(component(&moments.fourth, [0, 0, 1, 1]).abs() < 1e-14);
}

#[test]
fn isotropic_directions_have_the_isotropic_fourth_moment() {
    let golden = PI * (3.0 - 5.0_f64.sqrt());
    let shapes = (0..4000).map(|k| {
        let z = 1.0 - (2.0 * f64::from(k) + 1.0) / 4000.0;
        let (sine, azimuth) = ((1.0 - z * z).sqrt(), golden * f64::from(k));
        straight(
            Vector3::new(sine * azimuth.cos(), sine * azimuth.sin(), z),
            1,
            1.0,
        )
    });
    let moments = system(shapes.collect()).orientation_moments(&Inside::EVERYWHERE);
    let trace: f64 = [0, 1, 2]
        .iter()
        .flat_map(|&i| [0, 1, 2].map(|j| [i, i, j, j]))
        .map(|indices| component(&moments.fourth, indices))
        .sum();
    assert!((trace - 1.0).abs() < 1e-12);
    assert!((component(&moments.fourth, [2, 2, 2, 2]) - 0.2).abs() < 1e-3);
    assert!((component(&moments.fourth, [0, 0, 1, 1]) - 1.0 / 15.0).abs() < 1e-3);
    assert!(component(&moments.fourth, [0, 0, 0, 1]).abs() < 1e-3);
}

#[test]
fn a_circular_arc_has_its_radius_chord_and_correlation() {
    let (radius, segments) = (0.5, 40);
    let turn = 1.5 * PI / f64::from(segments);
    let node = |k: i32| {
        let angle = turn * f64::from(k);
        Vector3::new(angle.sin(), 1.0 - angle.cos(), 0.0) * radius
    };
    let system = system(vec![(0..=segments).map(node).collect()]);
    let step = 2.0 * radius * (0.5 * turn).sin();
    let length = step * f64::from(segments);

    let exact = turn / step * length;
    let curvature = system.curvature_distribution(2.0 * exact, 21);
    // All of it in the middle bin.
    assert!((curvature.density[10] * 2.0 * exact / 21.0 - 1.0).abs() < 1e-12);
    assert_eq!(curvature.beyond, 0.0);

    let chord = 2.0 * radius * (0.75 * PI).sin() / length;
    let extension = system.extension_distribution(50);
    let filled = (chord * 50.0) as usize;
    assert!((extension.density[filled] - 50.0).abs() < 1e-9);

    for [lag, correlation] in system.tangent_correlation(40) {
        let exact = (1.5 * PI * lag).cos();
        assert!(
            (correlation - exact).abs() < 1e-12,
            "{lag}: {correlation} {exact}"
        );
    }
}

/// Freely rotating chains, worm-like with ℓ_p = −a/ln cos θ: ⟨t·t'⟩ = cosⁿθ after n segments, and
/// ⟨R²⟩ = N a² ((1 + c)/(1 − c) − 2c(1 − cᴺ)/(N(1 − c)²)) with c = cos θ (Flory).
#[test]
fn worm_like_chains_have_their_persistence_length_and_extension() {
    let (segments, theta) = (32, 0.35_f64);
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let mut chain = || {
        let mut tangent = Vector3::x();
        let mut nodes = vec![Vector3::zeros()];
        for k in 0..segments {
            nodes.push(nodes[k] + tangent);
            let first = tangent
                .cross(&Vector3::ith(tangent.iamin(), 1.0))
                .normalize();
            let azimuth = TAU * random.random::<f64>();
            let across = first * azimuth.cos() + tangent.cross(&first) * azimuth.sin();
            tangent = tangent * theta.cos() + across * theta.sin();
        }
        nodes
    };
    let system = system((0..4000).map(|_| chain()).collect());
    let c = theta.cos();
    for (n, [lag, correlation]) in system.tangent_correlation(segments).iter().enumerate() {
        assert!((lag * segments as f64 - n as f64).abs() < 1e-9);
        assert!(
            (correlation - c.powi(n as i32)).abs() < 0.02,
            "{n}: {correlation}"
        );
    }
    let bins = 200;
    let extension = system.extension_distribution(bins);
    let squares = extension.density.iter().enumerate().map(|(k, density)| {
        let middle = (k as f64 + 0.5) / bins as f64;
        density / bins as f64 * middle * middle
    });
    let n = segments as f64;
    let exact =
        ((1.0 + c) / (1.0 - c) - 2.0 * c * (1.0 - c.powi(32)) / (n * (1.0 - c).powi(2))) / n;
    let mean: f64 = squares.sum();
    assert!((mean / exact - 1.0).abs() < 0.02, "{mean} {exact}");
    let total: f64 = extension.density.iter().sum::<f64>() / bins as f64;
    assert!((total + extension.beyond - 1.0).abs() < 1e-12);
}

#[test]
fn orbit_constants_are_binned_by_their_bounded_form() {
    let (flow, gradient) = (Vector3::z(), Vector3::x());
    let ratio = cox_aspect_ratio(1.0 / 0.02);
    // C = 3, at three phases, and one fibre along the vorticity.
    let on_orbit = |phase: f64| {
        let p = flow * (3.0 * ratio * phase.sin()) + gradient * (3.0 * phase.cos()) + Vector3::y();
        straight(p.normalize(), 2, 0.5)
    };
    let mut shapes: Vec<_> = [0.1, 1.5, 4.0].map(on_orbit).to_vec();
    shapes.push(straight(Vector3::y(), 1, 1.0));
    let (orbits, mean) =
        system(shapes).orbit_distribution(&Shear { flow, gradient }, &Inside::EVERYWHERE, 10);
    assert!((mean - 0.75 * 0.75).abs() < 1e-12);
    assert!((orbits.density[7] - 7.5).abs() < 1e-12 && (orbits.density[0] - 2.5).abs() < 1e-12);
}

#[test]
fn phases_are_counted_once_and_fibres_near_walls_are_not() {
    let shear = Shear::new(&Vector3::x(), &Vector3::new(3.0, 2.0, 0.0));
    assert_eq!(shear.vorticity(), Vector3::z());
    let mut shapes = Vec::new();
    for k in 0..40 {
        // Heads to either side count the same: 40 angles, 20 bins.
        let angle = PI / 40.0 * (f64::from(k) + 0.5);
        let p = Vector3::new(angle.sin(), angle.cos(), 0.4).normalize();
        shapes.push(straight(if k % 3 == 0 { -p } else { p }, 2, 0.5));
    }
    let count = shapes.len();
    // Beyond the wall at y = 9, all along the vorticity's axis.
    for _ in 0..25 {
        let nodes = straight(Vector3::z(), 2, 0.5);
        shapes.push(nodes.iter().map(|x| x + Vector3::y() * 9.5).collect());
    }
    let system = system(shapes);
    let inside = Inside {
        high: Vector3::new(f64::INFINITY, 9.0, f64::INFINITY),
        ..Inside::EVERYWHERE
    };
    let phases = system.phase_distribution(&shear, &inside, 20);
    assert!(phases.density.iter().all(|d| (d * PI - 1.0).abs() < 1e-12));
    assert_eq!(phases.beyond, 0.0);
    // From the gradient towards the flow, whichever end is the head.
    let p = Vector3::new((0.3 * PI).sin(), (0.3 * PI).cos(), 0.7).normalize();
    let pair = self::system(vec![straight(p, 2, 0.5), straight(-p, 2, 0.5)]);
    let phases = pair.phase_distribution(&shear, &Inside::EVERYWHERE, 100);
    assert!((phases.density[30] * PI / 100.0 - 1.0).abs() < 1e-12);
    let moments = system.orientation_moments(&inside);
    let vertical = 0.16 / 1.16;
    assert!((moments.second[(2, 2)] - vertical).abs() < 1e-12);
    let all = system.orientation_moments(&Inside::EVERYWHERE).second[(2, 2)];
    let (near, far) = (25.0, count as f64);
    assert!((all - (far * vertical + near) / (far + near)).abs() < 1e-12);
    let (orbits, mean) = system.orbit_distribution(&shear, &inside, 10);
    assert_eq!(orbits.density[0], 0.0);
    let orbit = |angle: f64| {
        let ratio = cox_aspect_ratio(1.0 / 0.02);
        let c = 2.5 * (angle.cos().powi(2) + (angle.sin() / ratio).powi(2)).sqrt();
        c / (1.0 + c) / far
    };
    let expected: f64 = (0..40)
        .map(|k| orbit(PI / 40.0 * (f64::from(k) + 0.5)))
        .sum();
    assert!((mean - expected).abs() < 1e-12, "{mean} {expected}");
}
