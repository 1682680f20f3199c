use super::*;
use crate::PeriodicBox;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

struct Cloud {
    ids: Vec<u64>,
    node: Vec<u32>,
    /// Start and end of each segment.
    position: Vec<Vector3>,
    radius: Vec<f64>,
    mass: Vec<f64>,
}

impl Cloud {
    /// Random segments of two per fibre in a cube, some of them in far images of it.
    fn random(count: usize, edge: f64, repeats: [bool; 3], seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut vector = |scale: f64| Vector3::from_fn(|_, _| scale * rng.random_range(-0.5..0.5));
        let start: Vec<_> = (0..count)
            .map(|_| {
                let images = vector(7.0).map(f64::round);
                vector(edge)
                    + Vector3::from_fn(|i, _| if repeats[i] { images[i] * edge } else { 0.0 })
            })
            .collect();
        let position = start.iter().flat_map(|x| [*x, x + vector(1.2)]).collect();
        let radius = (0..count)
            .map(|_| 0.05 + 0.1 * vector(1.0).x.abs())
            .collect();
        Self {
            ids: (0..count as u64)
                .map(|i| (i / 2) << SEGMENT_BITS | (i % 2))
                .collect(),
            node: (0..count as u32).map(|i| 2 * i).collect(),
            position,
            radius,
            mass: vec![1.0; count],
        }
    }

    fn segments(&self) -> Segments<'_> {
        Segments {
            ids: &self.ids,
            stems: &self.ids,
            node: &self.node,
            position: &self.position,
            velocity: &[],
            angular_velocity: &[],
            radius: &self.radius,
            mass: &self.mass,
        }
    }

    /// All pairs by comparing everything with all 27 images; the box above is `ahead` along x.
    fn brute_force(&self, periodic: &PeriodicBox, ahead: f64, skin: f64) -> Vec<[u64; 2]> {
        let mut pairs = Vec::new();
        let length = |axis: usize| periodic.lengths[axis].unwrap_or(0.0);
        for i in 0..self.ids.len() {
            for j in i + 1..self.ids.len() {
                if self.ids[i] >> SEGMENT_BITS == self.ids[j] >> SEGMENT_BITS {
                    continue;
                }
                let (a, b) = (self.segments().ends(i), self.segments().ends(j));
                let layers = periodic.nearest_period(&(b[0] - a[0])).y;
                let tilt = periodic.lengths[1].map_or(0.0, |l| ahead / l);
                let above = Vector3::new(layers * tilt, layers, 0.0);
                let nearest = above + periodic.nearest_period(&(b[0] - a[0] - above));
                let step = |k: i32| f64::from(k % 3 - 1);
                let distance = (0..27)
                    .map(|k| {
                        let x = step(k) * length(0) + step(k / 3) * ahead;
                        let image =
                            Vector3::new(x, step(k / 3) * length(1), step(k / 9) * length(2));
                        closest_points(&a, &b.map(|x| x - nearest + image)).distance
                    })
                    .fold(f64::INFINITY, f64::min);
                if distance < self.radius[i] + self.radius[j] + skin {
                    pairs.push([self.ids[i], self.ids[j]]);
                }
            }
        }
        pairs
    }
}

fn upright(periodic: &PeriodicBox) -> Images {
    Images::new(periodic, 0.0, 0.0)
}

fn cube(edge: f64, repeats: [bool; 3]) -> PeriodicBox {
    PeriodicBox {
        origin: Vector3::new(0.3, -2.0, 11.0),
        lengths: repeats.map(|r| r.then_some(edge)),
    }
}

#[test]
fn the_pairs_are_those_of_brute_force() {
    let one = Communicator::single();
    for (seed, repeats) in [
        [true, true, true],
        [true, false, true],
        [false, true, false],
        [false, false, false],
    ]
    .into_iter()
    .enumerate()
    {
        // The smallest box allowed, and larger ones.
        for edge in [3.4, 4.1, 7.3] {
            let cloud = Cloud::random(300, edge, repeats, seed as u64);
            let periodic = cube(edge, repeats);
            let found = search(&one, &cloud.segments(), &upright(&periodic), 0.1).expect("search");
            let ids: Vec<_> = found.pairs.iter().map(|p| p.ids).collect();
            let expected = cloud.brute_force(&periodic, 0.0, 0.1);
            assert!(expected.len() > 20, "{} pairs", expected.len());
            assert_eq!(ids, expected);
        }
    }
}

#[test]
fn the_pairs_in_a_sheared_box_are_those_of_brute_force() {
    let one = Communicator::single();
    for (seed, repeats) in [[true; 3], [false, true, true], [true, true, false]]
        .into_iter()
        .enumerate()
    {
        for strain in [0.0, 0.21, 0.49, 0.5, 0.8, -3.3] {
            let edge = 3.7;
            let cloud = Cloud::random(300, edge, repeats, 40 + seed as u64);
            let periodic = cube(edge, repeats);
            let images = Images::new(&periodic, 1.0, strain);
            let found = search(&one, &cloud.segments(), &images, 0.1).expect("search");
            let ids: Vec<_> = found.pairs.iter().map(|p| p.ids).collect();
            let whole = if repeats[0] { f64::round(strain) } else { 0.0 };
            let expected = cloud.brute_force(&periodic, edge * (strain - whole), 0.1);
            assert!(expected.len() > 20, "{} pairs", expected.len());
            assert_eq!(ids, expected, "strain {strain}");
        }
    }
}

#[test]
fn the_cost_is_linear_in_the_number_of_segments() {
    let one = Communicator::single();
    let cost = |count: usize| {
        let edge = (count as f64 / 2.0).cbrt();
        let cloud = Cloud::random(count, edge, [true; 3], 5);
        let found = search(
            &one,
            &cloud.segments(),
            &upright(&cube(edge, [true; 3])),
            0.1,
        );
        found.expect("search").tests as f64 / count as f64
    };
    let (few, many) = (cost(2_000), cost(32_000));
    assert!(many < 1.2 * few, "{few} tests a segment became {many}");
}

#[test]
fn neighbours_along_a_fibre_are_left_out_and_distant_segments_are_not() {
    // A hairpin of ten segments of one diameter each; its legs are 1.05 diameters apart.
    let position = |i: usize| match i {
        0..=5 => Vector3::new(i as f64, 0.0, 0.0),
        _ => Vector3::new(11.0 - i as f64, 1.05, 0.0),
    };
    let count = 11;
    let cloud = Cloud {
        ids: (0..count as u64).map(|i| 7 << SEGMENT_BITS | i).collect(),
        node: (0..count as u32).collect(),
        position: (0..=count).map(position).collect(),
        radius: vec![0.5; count],
        mass: vec![1.0; count],
    };
    let periodic = PeriodicBox::unbounded();
    let found = search(
        &Communicator::single(),
        &cloud.segments(),
        &upright(&periodic),
        0.1,
    );
    let found = found.expect("search").pairs;
    let index = |id: u64| id & ((1 << SEGMENT_BITS) - 1);
    let has = |a: u64, b: u64| {
        let wanted = [a, b];
        found.iter().any(|p| p.ids.map(index) == wanted)
    };
    assert!(has(0, 10) && has(1, 9) && has(3, 7));
    assert!(!has(3, 4) && !has(3, 5) && !has(4, 6));
}

#[test]
fn a_box_in_which_two_images_could_touch_is_refused() {
    let cloud = Cloud::random(10, 3.0, [false; 3], 3);
    let error = search(
        &Communicator::single(),
        &cloud.segments(),
        &upright(&cube(1.5, [false, true, false])),
        0.1,
    );
    assert!(matches!(
        error.err(),
        Some(ContactError::PeriodicTooShort { axis: 'y', .. })
    ));
    let mut cloud = Cloud::random(10, 3.0, [false; 3], 3);
    cloud.position[9].z = f64::NAN;
    let error = search(
        &Communicator::single(),
        &cloud.segments(),
        &upright(&PeriodicBox::unbounded()),
        0.1,
    );
    assert_eq!(error.err(), Some(ContactError::NonFinite));
}
