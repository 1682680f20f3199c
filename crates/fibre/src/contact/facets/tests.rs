use super::*;

/// A strip of squares along x over heights z(x), cut into triangles.
fn strip(points: &[(f64, f64)], width: f64) -> Vec<[Vector3; 3]> {
    let at = |k: usize, y: f64| Vector3::new(points[k].0, y, points[k].1);
    (0..points.len() - 1)
        .flat_map(|k| {
            let [a, b] = [at(k, 0.0), at(k + 1, 0.0)];
            let [c, d] = [at(k + 1, width), at(k, width)];
            [[a, b, c], [a, c, d]]
        })
        .collect()
}

fn touching(facets: &Facets, axis: &[Vector3; 2], slot: usize, reach: f64) -> Vec<Near> {
    let (mut around, mut near) = (Vec::new(), Vec::new());
    facets.around(axis, reach, &mut around);
    let items: Vec<_> = around
        .iter()
        .map(|&(item, shift)| (item, axis.map(|x| x - shift)))
        .collect();
    facets.touch(&items, slot, &mut near);
    let found = near.into_iter().flatten();
    found.filter(|near| near.height < reach).collect()
}

fn flat() -> Facets {
    let points: Vec<_> = (0..5).map(|k| (f64::from(k), 0.0)).collect();
    Facets::new(&strip(&points, 2.0), &PeriodicBox::unbounded()).expect("a surface")
}

/// Symptom that must not appear: a kick where a fibre slides over an edge inside a flat wall.
#[test]
fn edges_inside_a_flat_wall_are_not_felt() {
    let facets = flat();
    for k in 0..400 {
        let x = 0.5 + 0.0073 * f64::from(k);
        // Over faces, along and across edges, exactly on edges and corners.
        for y in [0.5, 1.0, 0.0731 + 0.004 * f64::from(k), x.fract() * 2.0] {
            let axis = [Vector3::new(x, y, 0.1), Vector3::new(x + 0.3, y, 0.1)];
            let found = touching(&facets, &axis, 0, 0.15);
            assert_eq!(found.len(), 1, "{axis:?} {found:?}");
            assert!((found[0].normal - Vector3::z()).norm() < 1e-12);
            assert!((found[0].height - 0.1).abs() < 1e-12);
        }
    }
    for x in [1.0, 2.0, 3.0] {
        let axis = [Vector3::new(x, 1.0, 0.1), Vector3::new(x, 1.2, 0.1)];
        assert_eq!(touching(&facets, &axis, 0, 0.15).len(), 1);
        assert_eq!(touching(&facets, &axis, 1, 0.15).len(), 1);
    }
}

#[test]
fn a_ridge_holds_the_middle_of_a_segment_and_a_valley_both_sides_of_an_end() {
    let v = Vector3::new;
    let ridge = Facets::new(
        &strip(&[(-1.0, -1.0), (0.0, 0.0), (1.0, -1.0)], 2.0),
        &PeriodicBox::unbounded(),
    );
    let ridge = ridge.expect("a surface");
    let axis = [v(-0.5, 1.0, 0.05), v(0.7, 1.0, 0.05)];
    let found = touching(&ridge, &axis, 0, 0.1);
    assert_eq!(found.len(), 1);
    assert!((found[0].normal - Vector3::z()).norm() < 1e-12);
    assert!((found[0].height - 0.05).abs() < 1e-12 && (found[0].at - 0.5 / 1.2).abs() < 1e-12);
    assert!(touching(&ridge, &axis, 1, 0.1).is_empty());

    let valley = Facets::new(
        &strip(&[(-1.0, 1.0), (0.0, 0.0), (1.0, 1.0)], 2.0),
        &PeriodicBox::unbounded(),
    );
    let valley = valley.expect("a surface");
    let axis = [v(0.0, 0.8, 0.1), v(0.0, 1.1, 0.1)];
    let found = touching(&valley, &axis, 0, 0.2);
    assert_eq!(found.len(), 2);
    assert!(
        found
            .iter()
            .all(|near| (near.height - 0.1 / 2.0_f64.sqrt()).abs() < 1e-12)
    );
    assert!((found[0].normal + found[1].normal - v(0.0, 0.0, 2.0_f64.sqrt())).norm() < 1e-12);
}

/// All that is in front of a cube, by comparing with the distance to the box itself.
#[test]
fn around_a_cube_the_nearest_feature_has_the_distance_of_the_cube() {
    let corner = |k: usize| Vector3::from_fn(|axis, _| f64::from(u8::from(k >> axis & 1 == 1)));
    let quads = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    let triangles: Vec<_> = quads
        .iter()
        .flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]])
        .map(|t| t.map(corner))
        .collect();
    let cube = Facets::new(&triangles, &PeriodicBox::unbounded()).expect("a surface");
    assert_eq!(cube.edges.iter().filter(|e| e.protrudes).count(), 12);
    let mut kinds = [0; 3];
    for k in 0..4000 {
        let angle = |a: f64| (a * f64::from(k)).fract() * 2.0 - 0.5;
        let x = Vector3::new(angle(0.6180), angle(0.7549), angle(0.5698));
        let box_point = x.map(|c| c.clamp(0.0, 1.0));
        let distance = (x - box_point).norm();
        if distance == 0.0 {
            continue;
        }
        let axis = [x, x + Vector3::new(1e-3, 0.0, 0.0)];
        let found = touching(&cube, &axis, 0, 2.0);
        let ends: Vec<_> = found
            .iter()
            .filter(|near| near.at == 0.0 && near.height > 0.0)
            .collect();
        let nearest = ends
            .iter()
            .map(|near| near.height)
            .fold(f64::INFINITY, f64::min);
        assert!(
            (nearest - distance).abs() < 1e-12,
            "{x:?}: {nearest} {distance}"
        );
        let in_front = ends
            .iter()
            .filter(|near| (near.height - distance).abs() < 1e-12);
        assert_eq!(in_front.count(), 1, "{x:?}");
        kinds[(0..3).filter(|&c| x[c] != box_point[c]).count() - 1] += 1;
    }
    assert!(kinds.iter().all(|&n| n > 100), "{kinds:?}");
}

#[test]
fn a_surface_goes_on_through_a_periodic_boundary() {
    let periodic = PeriodicBox {
        origin: Vector3::zeros(),
        lengths: [Some(4.0), Some(2.0), None],
    };
    let points: Vec<_> = (0..5).map(|k| (f64::from(k), 0.0)).collect();
    let facets = Facets::new(&strip(&points, 2.0), &periodic).expect("a surface");
    // Every edge has two faces: 8 faces, 12 edges.
    assert_eq!(facets.edges.len(), 12);
    for (x, y) in [
        (0.0, 0.0),
        (4.0, 1.0),
        (-7.99, 0.0),
        (12.3, 5.999),
        (2.0, -2.0),
    ] {
        let axis = [Vector3::new(x, y, 0.1), Vector3::new(x + 0.2, y + 0.1, 0.1)];
        for slot in 0..2 {
            let found = touching(&facets, &axis, slot, 0.15);
            assert_eq!(found.len(), 1, "{x} {y}");
            assert!((found[0].height - 0.1).abs() < 1e-12);
        }
    }
}

#[test]
fn what_is_no_surface_is_refused() {
    let v = Vector3::new;
    let open = PeriodicBox::unbounded();
    assert_eq!(Facets::new(&[], &open).err(), Some(Flaw::Empty));
    let line = [v(0.0, 0.0, 0.0), v(1.0, 0.0, 0.0), v(2.0, 0.0, 0.0)];
    assert_eq!(Facets::new(&[line], &open).err(), Some(Flaw::NoArea));
    let fin = |y: f64, z: f64| [v(0.0, 0.0, 0.0), v(1.0, 0.0, 0.0), v(0.0, y, z)];
    let three = [fin(1.0, 0.0), fin(0.0, 1.0), fin(-1.0, 0.0)];
    assert_eq!(Facets::new(&three, &open).err(), Some(Flaw::ManyFaces));
}
