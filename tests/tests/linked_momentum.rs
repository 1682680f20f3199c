//! Momentum of fluid and linked fibres together (validation row C1).

use fibreflow_coupling::Coupling;
use fibreflow_fibre::contact::Repulsion;
use fibreflow_fibre::linked::{Joint, LinkedFibre, LinkedScheme, LinkedSettings, LinkedSystem};
use fibreflow_fibre::{Ambient, Fibre, Material, PeriodicBox, Points};
use fibreflow_fluid::{Fluid, FluidSettings};
use fibreflow_mesh::{BoxElement, BoxMesh, distribute, geometry};
use fibreflow_parallel::Communicator;
use nalgebra::Vector3;
use rand::{Rng, SeedableRng};
use std::f64::consts::TAU;
use std::sync::Arc;

const BOX: f64 = 2e-3;
const DT: f64 = 2e-4;
const DENSITY: f64 = 1000.0;
const WEIGHT: [f64; 3] = [0.0, 0.0, -2e-9];

/// Fibres of 0.8 mm in a crowd, some across the boundary of the box.
fn fibres() -> Vec<LinkedFibre> {
    let fibre = |id: u64| {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(id);
        let mut random = || Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0));
        let middle = Vector3::repeat(0.5 * BOX) + 0.3 * BOX * random();
        let half = 4e-4 * random().normalize();
        let material = Material::new(2e-5, 2e6, 0.3, 1300.0);
        let beam = Fibre::straight(id, material, middle - half, middle + half, 4);
        let mut fibre = LinkedFibre::new(&beam, Joint::Ball).expect("a fibre");
        fibre.weight = WEIGHT.into();
        fibre
    };
    (0..40).map(fibre).collect()
}

/// What the fluid has gained is the weight of the fibres times the time, to 1e-10 of Σ|impulse|, while fibres rub and cross
/// the boundaries.
#[test]
fn momentum_of_the_fluid_grows_by_the_weight_of_the_fibres() {
    let elements = [
        BoxElement::Hexahedron,
        BoxElement::Tetrahedron,
        BoxElement::Prism,
        BoxElement::Mixed,
    ];
    for element in elements {
        let box_mesh = BoxMesh {
            size: [BOX; 3],
            cells: [5, 5, 5],
            periodic: [true; 3],
            element,
            jitter: 0.15,
            seed: 2,
            ..BoxMesh::default()
        };
        let communicator = Communicator::single();
        let mesh = distribute(&communicator, Some(box_mesh.build().expect("box"))).expect("mesh");
        let mesh = Arc::new(mesh);
        let geometry = Arc::new(geometry::dual(&mesh).expect("dual"));
        let mut settings = FluidSettings::new(DENSITY, 1e-3);
        settings.pressure.relative_tolerance = 1e-12;
        settings.momentum.relative_tolerance = 1e-12;
        let mut fluid = Fluid::new(mesh.clone(), geometry.clone(), settings).expect("fluid");
        let flow = |x: [f64; 3]| {
            let [a, b, c] = x.map(|x| TAU * x / BOX);
            [
                0.05 * b.sin(),
                0.05 * (c + 1.0).sin(),
                0.05 * (a - 0.7).sin(),
            ]
        };
        fluid.set_velocity(flow).expect("field");
        let no_slip = vec![false; mesh.owned()];
        let mut coupling = Coupling::new(mesh, geometry, no_slip).expect("coupling");
        let linked = LinkedSettings {
            repulsion: Some(Repulsion {
                strength: 1e-6,
                decay: 1e-6,
                attraction: 0.0,
                attraction_width: 3e-6,
                range: 1.3e-5,
                contact_gap: 7e-6,
            }),
            friction: [2.0, 1.0],
            periodic: PeriodicBox {
                origin: Vector3::zeros(),
                lengths: [Some(BOX); 3],
            },
            ..LinkedSettings::new(LinkedScheme::Implicit, 1e-3, 4e-5)
        };
        let mut fibres = LinkedSystem::new(&communicator, linked, fibres()).expect("fibres");
        let (mut points, mut ambient) = (Points::default(), Ambient::default());
        let start = Vector3::from(fluid.momentum());
        let total = Vector3::from(WEIGHT) * fibres.segments() as f64;
        let (mut impulses, mut worst, mut rubbing) = (0.0, 0.0_f64, 0);
        for step in 1..=100 {
            fibres.points(DT, &mut points);
            coupling
                .sample(fluid.velocity(), &points.position, &mut ambient)
                .expect("sample");
            let response = coupling.response(&points.position).expect("response");
            ambient.yielding = response.iter().map(|r| r * DT / DENSITY).collect();
            let reaction = fibres.advance_sampled(&points, &ambient, DT).expect("step");
            impulses += DT * reaction.force.iter().map(|f| f.norm()).sum::<f64>();
            let density = fluid.body_force_mut();
            density.fill([0.0; 4]);
            let report = coupling.spread(reaction, density).expect("spread");
            assert!(report.defect_relative < 1e-12, "{}", report.defect_relative);
            fluid.advance(DT).expect("step");
            let gained = Vector3::from(fluid.momentum()) - start;
            let wanted = total * (DT * f64::from(step));
            worst = worst.max((gained - wanted).norm() / impulses);
            let touches = fibres.solved_touches().iter();
            rubbing += touches.filter(|t| t.friction.norm() > 0.0).count();
        }
        println!("{element:?}: {worst:.1e} of {impulses:.1e} N s, {rubbing} contacts that rub");
        assert!(worst < 1e-10, "{element:?}: {worst:e}");
        assert!(rubbing > 100, "{element:?}: {rubbing} contacts");
    }
}
