//! Contacts of segments that different ranks own.

use super::{Outcome, ensure};
use fibreflow_fibre::contact::{
    ContactError, ContactSettings, ContactStatistics, ContactSystem, FrictionRecord, Lubrication,
    LubricationModel, NormalDamping, Repulsion, SegmentLoad, Segments, VanDerWaals, Wall,
};
use fibreflow_fibre::{PeriodicBox, Vector3};
use fibreflow_parallel::Communicator;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

const EDGE: f64 = 4.0;

/// Segments and their motion, all of them or those of a rank.
#[derive(Clone, Default)]
struct Cloud {
    ids: Vec<u64>,
    node: Vec<u32>,
    /// Position, velocity and angular velocity of start and end of each segment.
    vectors: [Vec<Vector3>; 3],
    radius: Vec<f64>,
    mass: Vec<f64>,
}

impl Cloud {
    /// Fibres of three segments in a box that repeats along x and z, between walls across y.
    fn random(fibres: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let mut vector = |size: f64| Vector3::from_fn(|_, _| size * random.random_range(-1.0..1.0));
        let mut cloud = Self::default();
        for fibre in 0..fibres {
            // Some are several periods away from the box.
            let image = vector(2.4)
                .map(f64::round)
                .component_mul(&Vector3::new(EDGE, 0.0, EDGE));
            let mut end = vector(0.5 * EDGE);
            end.y *= 0.95;
            end += image;
            for segment in 0..3 {
                let start = end;
                end += vector(0.3);
                cloud.ids.push(fibre << 20 | segment);
                cloud.node.push(cloud.vectors[0].len() as u32);
                let motion = [[start, end], [vector(1.0), vector(1.0)], [vector(3.0); 2]];
                for (list, values) in cloud.vectors.iter_mut().zip(motion) {
                    list.extend(values);
                }
                cloud.radius.push(0.12 + vector(0.02).x);
                cloud.mass.push(1.0 + vector(0.5).x);
            }
        }
        cloud
    }

    /// The segments of the fibres that `mine` chooses, with their indices in the whole.
    fn part(&self, mine: impl Fn(u64) -> bool) -> (Vec<usize>, Self) {
        let indices: Vec<usize> = (0..self.ids.len())
            .filter(|&i| mine(self.ids[i] >> 20))
            .collect();
        let pick = |values: &Vec<f64>| indices.iter().map(|&i| values[i]).collect();
        let ends = |list: &Vec<Vector3>| {
            let both = indices.iter().flat_map(|&i| [2 * i, 2 * i + 1]);
            both.map(|i| list[i]).collect()
        };
        let part = Self {
            ids: indices.iter().map(|&i| self.ids[i]).collect(),
            node: (0..indices.len() as u32).map(|i| 2 * i).collect(),
            vectors: std::array::from_fn(|k| ends(&self.vectors[k])),
            radius: pick(&self.radius),
            mass: pick(&self.mass),
        };
        (indices, part)
    }

    fn segments(&self) -> Segments<'_> {
        let [position, velocity, angular_velocity] = &self.vectors;
        Segments {
            ids: &self.ids,
            stems: &self.ids,
            node: &self.node,
            radius: &self.radius,
            mass: &self.mass,
            position,
            velocity,
            angular_velocity,
        }
    }

    fn loads(
        &self,
        contacts: &mut ContactSystem,
        dt: f64,
    ) -> Result<Vec<SegmentLoad>, ContactError> {
        contacts.update(&self.segments())?;
        contacts.forces(&self.segments(), dt);
        let load = |i: usize| contacts.load(i).copied().unwrap_or_default();
        Ok((0..self.ids.len()).map(load).collect())
    }

    fn advance(&mut self, loads: &[SegmentLoad], dt: f64) {
        let [position, velocity, _] = &mut self.vectors;
        for (i, load) in loads.iter().enumerate() {
            let per_mass = 2.0 * dt / self.mass[i];
            for (node, force) in [(2 * i, load.start_force), (2 * i + 1, load.end_force)] {
                velocity[node] += force * per_mass;
                position[node] += velocity[node] * dt;
            }
        }
    }
}

fn settings(length: f64) -> ContactSettings {
    let wall = |y: f64| Wall::plane(Vector3::new(0.0, y, 0.0), Vector3::new(0.0, -y, 0.0));
    ContactSettings {
        damping: NormalDamping::Restitution(0.6),
        friction: 0.3,
        tangential_ratio: 0.5,
        walls: vec![wall(0.5 * EDGE), wall(-0.5 * EDGE)],
        periodic: PeriodicBox {
            origin: Vector3::zeros(),
            lengths: [Some(length), None, Some(length)],
        },
        ..ContactSettings::new(1e4, 0.03)
    }
}

/// All forces at a distance, between a wall that comes nearer and a floor of triangles.
fn at_a_distance() -> ContactSettings {
    let cells = 6;
    let floor = |k: usize| {
        let at = |i: usize, j: usize| {
            let place = Vector3::new(i as f64, 0.0, j as f64) * (EDGE / cells as f64);
            place - 0.5 * EDGE * Vector3::y()
        };
        let (i, j) = (k % cells, k / cells);
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        [[a, c, b], [a, d, c]]
    };
    let ceiling = Wall {
        velocity: Vector3::new(0.1, -0.2, 0.0),
        ..Wall::plane(0.5 * EDGE * Vector3::y(), -Vector3::y())
    };
    ContactSettings {
        repulsion: Some(Repulsion {
            strength: 5.0,
            decay: 0.1,
            attraction: 1.0,
            attraction_width: 0.03,
            range: 0.05,
            contact_gap: 0.01,
        }),
        van_der_waals: Some(VanDerWaals {
            hamaker: 1e-2,
            closest: 0.01,
            range: 0.05,
        }),
        lubrication: Some(Lubrication {
            viscosity: 0.1,
            roughness: 0.005,
            range: 0.06,
            model: LubricationModel::Cylinders,
        }),
        walls: vec![
            Wall::facets((0..cells * cells).flat_map(floor).collect()),
            ceiling,
        ],
        ..settings(EDGE)
    }
}

/// Without walls, sheared.
fn sheared() -> ContactSettings {
    let mut settings = ContactSettings {
        walls: Vec::new(),
        shear_rate: 3.0,
        count_crossings: true,
        ..at_a_distance()
    };
    settings.periodic.lengths[1] = Some(EDGE);
    settings
}

/// Every rank also computes everything alone: its loads must be the same to the last bit, through searches, changes of
/// owner and a restart from the records of the others.
pub fn independent_of_the_ranks(communicator: &Communicator) -> Outcome {
    for (scene, fibres) in [
        (settings(EDGE), 250),
        (at_a_distance(), 160),
        (sheared(), 160),
    ] {
        compare(communicator, &scene, fibres)?;
    }
    Ok(())
}

fn compare(communicator: &Communicator, scene: &ContactSettings, fibres: u64) -> Outcome {
    let (rank, size) = (communicator.rank() as u64, communicator.size() as u64);
    let alone = Communicator::single();
    let mut whole = Cloud::random(fibres);
    let mut expected = ContactSystem::new(scene.clone(), &alone)?;
    let mut shared = ContactSystem::new(scene.clone(), communicator)?;
    let dt = 1e-3;
    let mut before = ContactStatistics::default();
    for step in 0..60u64 {
        // Owners change every ten steps.
        let (indices, part) = whole.part(|fibre| (fibre * (1 + step / 10)) % size == rank);
        if step == 35 {
            before = shared.statistics();
            shared = resumed(communicator, scene, &shared)?;
        }
        for contacts in [&mut expected, &mut shared] {
            contacts.set_time(dt * step as f64);
        }
        let loads = whole.loads(&mut expected, dt)?;
        let own = part.loads(&mut shared, dt)?;
        let equal = indices.iter().zip(&own).all(|(&i, load)| loads[i] == *load);
        ensure(!communicator.any(!equal), || {
            format!("loads differ in step {step}")
        })?;
        expected.count_crossings(&whole.segments(), dt);
        shared.count_crossings(&part.segments(), dt);
        let (ours, all) = (shared.statistics(), expected.statistics());
        let counts = |s: &ContactStatistics| [s.contacts, s.wall_contacts];
        ensure(counts(&ours) == counts(&all), || {
            format!("{ours:?} instead of {all:?} in step {step}")
        })?;
        let held = scene.walls.is_empty() || ours.wall_contacts > 2;
        ensure(ours.contacts > 40 && held, || {
            format!("too few contacts to tell: {ours:?}")
        })?;
        ensure(
            (ours.stored_energy / all.stored_energy - 1.0).abs() < 1e-12,
            || format!("energies differ: {ours:?} and {all:?}"),
        )?;
        let step_size = shared.critical_step(&part.segments());
        ensure(
            step_size == expected.critical_step(&whole.segments()),
            || "critical steps differ".into(),
        )?;
        whole.advance(&loads, dt);
    }
    let ours = shared.statistics();
    let crossings = before.crossings + ours.crossings;
    ensure(crossings == expected.statistics().crossings, || {
        format!("{crossings} crossings")
    })?;
    let rebuilds = before.rebuilds + ours.rebuilds;
    ensure(rebuilds > 12, || format!("only {rebuilds} searches"))?;
    let springs = communicator.sum_count(shared.records().len());
    ensure(springs == expected.records().len() && springs > 30, || {
        format!("{springs} springs of {}", expected.records().len())
    })
}

/// A new system from the records of the next rank.
fn resumed(
    communicator: &Communicator,
    scene: &ContactSettings,
    old: &ContactSystem,
) -> Result<ContactSystem, Box<dyn std::error::Error>> {
    let size = communicator.size();
    let mut outgoing: Vec<Vec<FrictionRecord>> = vec![Vec::new(); size];
    outgoing[(communicator.rank() + 1) % size] = old.records();
    let records = communicator.exchange(outgoing).into_iter().flatten();
    let mut new = ContactSystem::new(scene.clone(), communicator)?;
    new.restore_records(records.collect());
    Ok(new)
}

/// Only one rank holds segments; all must hear that the box is too short for them.
pub fn short_box(communicator: &Communicator) -> Outcome {
    let (_, part) = Cloud::random(20).part(|_| communicator.is_root());
    let mut contacts = ContactSystem::new(settings(0.9), communicator)?;
    let error = contacts.update(&part.segments()).err();
    ensure(
        matches!(
            error,
            Some(ContactError::PeriodicTooShort { axis: 'x', .. })
        ),
        || format!("{error:?} instead of a refusal"),
    )
}
