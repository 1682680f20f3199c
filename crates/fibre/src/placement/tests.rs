use super::*;
use crate::contact::closest_points;

fn settings() -> PlacementSettings {
    PlacementSettings {
        amount: Amount::VolumeFraction(0.03),
        length: 2.0,
        radius: 0.05,
        centre_line: CentreLine::Straight,
        segments: 5,
        domain: PlacementDomain {
            origin: Vector3::new(-1.0, 2.0, 0.0),
            size: Vector3::new(5.0, 4.0, 6.0),
            periodic: [true; 3],
        },
        wall_clearance: 0.0,
        gap: 0.0,
        orientation: Orientation::Isotropic,
        seed: 7,
        max_attempts: 10_000,
    }
}

/// Smallest distance between axes of straight fibres over all images, also of a fibre from its own images.
fn nearest(settings: &PlacementSettings, fibres: &[PlacedFibre]) -> f64 {
    let ends = |f: &PlacedFibre| [-0.5, 0.5].map(|s| f.centre + f.direction * s * settings.length);
    let mut least = f64::INFINITY;
    let range = |axis: usize| {
        let length = settings.domain.size[axis];
        let most = (settings.length / length).ceil() as i32 + 1;
        let most = if settings.domain.periodic[axis] {
            most
        } else {
            0
        };
        (-most..=most).map(move |k| f64::from(k) * length)
    };
    for (i, a) in fibres.iter().enumerate() {
        for (j, b) in fibres.iter().enumerate().take(i + 1) {
            for x in range(0) {
                for y in range(1) {
                    for z in range(2) {
                        let shift = Vector3::new(x, y, z);
                        if i != j || shift != Vector3::zeros() {
                            let image = ends(b).map(|e| e + shift);
                            least = least.min(closest_points(&ends(a), &image).distance);
                        }
                    }
                }
            }
        }
    }
    least
}

#[test]
fn fibres_do_not_overlap_in_any_image() {
    for (seed, periodic) in [[true; 3], [true, false, true], [false; 3]]
        .into_iter()
        .enumerate()
    {
        let mut settings = settings();
        settings.domain.periodic = periodic;
        settings.seed = seed as u64;
        settings.gap = 0.01;
        settings.wall_clearance = 0.02;
        let fibres = place_random(&settings).expect("placed");
        assert_eq!(fibres.len(), 229);
        assert!(nearest(&settings, &fibres) >= 0.11 - 1e-12);
        let line = settings.centre_line.nodes(2.0, 5);
        let (low, high) = (
            settings.domain.origin,
            settings.domain.origin + settings.domain.size,
        );
        for node in fibres.iter().flat_map(|f| f.nodes(&line)) {
            for axis in (0..3).filter(|&axis| !periodic[axis]) {
                assert!(node[axis] - low[axis] >= 0.07 && high[axis] - node[axis] >= 0.07);
            }
        }
    }
}

/// Fibres two and three times as long as the box: their own images are obstacles too.
#[test]
fn a_fibre_longer_than_the_box_does_not_meet_itself() {
    let settings = PlacementSettings {
        amount: Amount::Count(12),
        length: 3.0,
        radius: 0.02,
        domain: PlacementDomain {
            origin: Vector3::zeros(),
            size: Vector3::new(1.0, 1.5, 1.0),
            periodic: [true; 3],
        },
        ..settings()
    };
    let fibres = place_random(&settings).expect("placed");
    assert!(nearest(&settings, &fibres) >= 0.04 - 1e-12);
    let along = PlacementSettings {
        orientation: Orientation::Aligned(Vector3::x()),
        max_attempts: 100,
        ..settings
    };
    let error = place_random(&along).expect_err("every fibre meets itself");
    assert!(matches!(error, PlacementError::NoRoom { placed: 0, .. }));
}

#[test]
fn the_seed_decides_and_orientations_follow_their_distribution() {
    let mut settings = settings();
    settings.amount = Amount::Count(3000);
    settings.radius = 0.002;
    let fibres = place_random(&settings).expect("placed");
    assert_eq!(place_random(&settings).expect("placed"), fibres);
    settings.seed += 1;
    assert_ne!(place_random(&settings).expect("placed"), fibres);

    let moment = |fibres: &[PlacedFibre], i: usize, j: usize| {
        let sum: f64 = fibres.iter().map(|f| f.direction[i] * f.direction[j]).sum();
        sum / fibres.len() as f64
    };
    for i in 0..3 {
        for j in 0..3 {
            let expected = if i == j { 1.0 / 3.0 } else { 0.0 };
            assert!((moment(&fibres, i, j) - expected).abs() < 0.03);
        }
    }
    settings.orientation = Orientation::InPlane(Vector3::new(0.0, 0.0, 5.0));
    let fibres = place_random(&settings).expect("placed");
    assert!((moment(&fibres, 0, 0) - 0.5).abs() < 0.03 && moment(&fibres, 2, 2) < 1e-24);
    settings.orientation = Orientation::Aligned(Vector3::new(3.0, 0.0, 4.0));
    let fibres = place_random(&settings).expect("placed");
    assert!((moment(&fibres, 0, 2) - 0.48).abs() < 1e-12);
    for f in &fibres {
        assert!(f.normal.dot(&f.direction).abs() < 1e-14 && (f.normal.norm() - 1.0).abs() < 1e-14);
    }
}

#[test]
fn curved_fibres_keep_apart_and_keep_their_length() {
    let mut settings = settings();
    settings.centre_line = CentreLine::U { opening_angle: 0.5 };
    let fibres = place_random(&settings).expect("placed");
    let line = settings
        .centre_line
        .nodes(settings.length, settings.segments);
    let nodes: Vec<_> = fibres.iter().map(|f| f.nodes(&line)).collect();
    let periodic = settings.domain.periodic_box();
    for (i, a) in nodes.iter().enumerate() {
        for b in &nodes[..i] {
            for p in a.windows(2) {
                for q in b.windows(2) {
                    let shift = periodic.nearest_period(&(q[0] - p[0]));
                    let (p, q) = ([p[0], p[1]], [q[0] - shift, q[1] - shift]);
                    assert!(closest_points(&p, &q).distance >= 0.1 - 1e-12);
                }
            }
        }
        let length: f64 = a.windows(2).map(|n| (n[1] - n[0]).norm()).sum();
        assert!((length - 2.0).abs() < 1e-12);
    }
}

#[test]
fn errors_say_what_was_reached_and_what_is_wrong() {
    let mut crowded = settings();
    crowded.amount = Amount::VolumeFraction(0.4);
    crowded.max_attempts = 200;
    let error = place_random(&crowded).expect_err("no room");
    let PlacementError::NoRoom {
        placed,
        wanted,
        volume_fraction,
        ..
    } = error
    else {
        panic!("{error}");
    };
    assert!(placed > 100 && placed < wanted);
    assert!(volume_fraction > 0.01 && volume_fraction < 0.4);

    let refused = |change: &dyn Fn(&mut PlacementSettings)| {
        let mut wrong = settings();
        change(&mut wrong);
        place_random(&wrong).expect_err("refused").to_string()
    };
    assert!(refused(&|s| s.radius = 0.0).contains("radius is 0"));
    assert!(refused(&|s| s.length = f64::NAN).contains("length is NaN"));
    assert!(refused(&|s| s.amount = Amount::VolumeFraction(1.5)).contains("1.5"));
    assert!(
        refused(&|s| s.orientation = Orientation::Aligned(Vector3::zeros())).contains("aligned")
    );
    assert!(refused(&|s| s.domain.size.y = 0.3).contains("0.3 m long along y"));
}
