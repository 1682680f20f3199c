//! Segment sub-steps per second of a suspension read from a file, one CSV line on standard output.
//! `throughput SCENE SEGMENTS SUBSTEPS free|contact [SKIN]`
//!
//! SCENE: a line `# box=EDGE …`, then centre, direction and velocity of each straight fibre, nine numbers a line. The
//! fibres are those of `scripts/bench/fibre`: 1 cm long, 0.25 mm thick, E = 100 MPa, ρ = 1000 kg/m³, in a periodic cube,
//! contact stiffness 125 N/m, friction 0.3. SKIN is in diameters. Overlaps are relaxed before the clock starts.

use fibreflow_fibre::contact::{ContactSettings, ContactStatistics, NormalDamping};
use fibreflow_fibre::{Fibre, FibreSettings, FibreSystem, Material, PeriodicBox, Vector3};
use fibreflow_parallel::Communicator;
use std::error::Error;
use std::time::Instant;

const LENGTH: f64 = 1e-2;
const DIAMETER: f64 = 2.5e-4;

struct Scene {
    edge: f64,
    /// Centre, direction, velocity.
    fibres: Vec<[Vector3; 3]>,
}

fn read(path: &str) -> Result<Scene, Box<dyn Error>> {
    let text = std::fs::read_to_string(path)?;
    let mut lines = text.lines();
    let head = lines.next().and_then(|line| line.split("box=").nth(1));
    let edge = head.and_then(|rest| rest.split_whitespace().next());
    let edge = edge.ok_or("the first line has no box=")?.parse()?;
    let mut fibres = Vec::new();
    for line in lines {
        let numbers = line.split(',').map(|word| word.trim().parse());
        let n: Vec<f64> = numbers.collect::<Result<_, _>>()?;
        if n.len() != 9 {
            return Err(format!("nine numbers expected: {line}").into());
        }
        fibres.push([0, 3, 6].map(|i| Vector3::new(n[i], n[i + 1], n[i + 2])));
    }
    Ok(Scene { edge, fibres })
}

fn system(
    scene: &Scene,
    segments: usize,
    contacts: Option<f64>,
) -> Result<FibreSystem, Box<dyn Error>> {
    let settings = FibreSettings {
        contacts: contacts.map(|skin| ContactSettings {
            damping: NormalDamping::Ratio(0.0),
            friction: 0.3,
            tangential_ratio: 0.3,
            periodic: PeriodicBox {
                origin: Vector3::zeros(),
                lengths: [Some(scene.edge); 3],
            },
            ..ContactSettings::new(125.0, skin * DIAMETER)
        }),
        ..FibreSettings::default()
    };
    let material = Material::new(0.5 * DIAMETER, 1e8, 0.3, 1000.0);
    let fibre = |(id, [centre, direction, _]): (usize, &[Vector3; 3])| {
        let half = direction * (0.5 * LENGTH);
        Fibre::straight(id as u64, material, centre - half, centre + half, segments)
    };
    let fibres = scene.fibres.iter().enumerate().map(fibre).collect();
    Ok(FibreSystem::new(Communicator::single(), settings, fibres)?)
}

fn statistics(system: &FibreSystem) -> ContactStatistics {
    system
        .contacts()
        .map_or_else(ContactStatistics::default, |c| c.statistics())
}

/// Lets overlapping fibres push each other apart.
fn relax(system: &mut FibreSystem) -> Result<(), Box<dyn Error>> {
    // Rounds from rest; large systems get fewer, their overlaps hardly matter for the time.
    for _ in 0..(4_000_000 / system.segments()).clamp(2, 20) {
        system.velocities_mut().fill(Vector3::zeros());
        system.angular_velocities_mut().fill(Vector3::zeros());
        system.advance_free(20.0 * system.critical_step())?;
    }
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [path, segments, substeps, kind, rest @ ..] = &arguments[..] else {
        return Err("usage: throughput SCENE SEGMENTS SUBSTEPS free|contact [SKIN]".into());
    };
    let (segments, substeps): (usize, usize) = (segments.parse()?, substeps.parse()?);
    let skin = rest.first().map_or(Ok(0.75), |text| text.parse())?;
    let threads = std::env::var("RAYON_NUM_THREADS").map_or(Ok(1), |text| text.parse())?;
    // The thread that runs the program is one of them.
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .use_current_thread()
        .build_global()?;

    let scene = read(path)?;
    let mut system = system(&scene, segments, (kind == "contact").then_some(skin))?;
    if kind == "contact" {
        relax(&mut system)?;
    }
    for (node, velocity) in system.velocities_mut().iter_mut().enumerate() {
        *velocity = scene.fibres[node / (segments + 1)][2];
    }
    system.angular_velocities_mut().fill(Vector3::zeros());
    let step = 0.7 * system.critical_step();
    system.advance_free(20.0 * step)?;

    let before = statistics(&system);
    let (mut work, mut passed, mut deepest) = (0, 0.0, before.max_overlap);
    let start = Instant::now();
    while work < substeps * system.segments() {
        system.advance_free(100.0 * step)?;
        work += system.segment_substeps();
        passed += 100.0 * step;
    }
    let seconds = start.elapsed().as_secs_f64();
    let after = statistics(&system);
    deepest = deepest.max(after.max_overlap);
    println!(
        "fibres,segments,threads,substep,substeps,seconds,segment_substeps_per_s,contacts_start,contacts_end,max_overlap,candidates,searches"
    );
    let substeps = work / system.segments();
    println!(
        "{},{},{threads},{:.4e},{substeps},{seconds:.4},{:.4e},{},{},{:.3},{},{}",
        system.fibres(),
        system.segments(),
        passed / substeps as f64,
        work as f64 / seconds,
        before.contacts,
        after.contacts,
        deepest / DIAMETER,
        after.candidates,
        after.rebuilds - before.rebuilds,
    );
    Ok(())
}
