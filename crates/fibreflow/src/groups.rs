//! Dimensionless groups and time scales of a case, and what lies outside the range of a model that it chose.

use crate::case::{Case, Clamp, CouplingMode, DragLaw, FibreGroup, Placement};
use crate::scene::{Scene, length_of};
use fibreflow_fibre::hydrodynamics::{Section, SlenderConstants, flexibility};
use fibreflow_fibre::{Material, Vector3};
use fibreflow_fluid::{Fluid, Inertia};
use std::f64::consts::PI;

/// Above this Reynolds number of the diameter a fibre is no slender body in creeping flow.
const CREEPING_DIAMETER: f64 = 1e-2;
/// Below this aspect ratio it is not slender.
const SLENDER: f64 = 10.0;
/// Segment by element: shorter ones waste work, longer ones skip elements.
const PER_ELEMENT: [f64; 2] = [0.5, 4.0];
/// Strain in a step above which the drag, held over the step, is off by more than a tenth of a percent of an orbit.
const STRAIN: f64 = 0.2;
/// Overlap by diameter.
const SOFT: f64 = 0.1;
/// First root of cos k cosh k = 1, squared: the slowest bending of a free fibre.
const FREE_BENDING: f64 = 22.37;

/// What the flow is like at the start.
struct FlowScales {
    density: f64,
    viscosity: f64,
    /// Largest speed \[m/s\].
    speed: f64,
    /// Shear rate \[1/s\].
    rate: f64,
    /// Narrowest gap between walls of a box, or its longest edge; else the cube root of the volume \[m\].
    extent: Option<f64>,
    /// Of the domain \[m³\].
    volume: Option<f64>,
    /// Cube root of the volume by the nodes \[m\].
    spacing: Option<f64>,
}

/// Groups of flow and fibres, with warnings. Collective.
pub fn groups(scene: &Scene, case: &Case) -> Vec<String> {
    let scales = FlowScales::new(scene, case);
    let mut lines = scales.lines(scene);
    let step = case.time.step.or(case.time.max_step);
    if let Some(step) = step.filter(|step| !case.fibres.is_empty() && scales.rate * step > STRAIN) {
        let strain = scales.rate * step;
        let name = case.time.step.map_or("max_step", |_| "step");
        lines.push(format!(
            "  warning: `time.{name}` is a strain of γ̇Δt = {strain:.2}; above {STRAIN} the orbits of fibres show it"
        ));
    }
    for (k, group) in case.fibres.iter().enumerate() {
        match (length_of(group), group.youngs_modulus.nominal()) {
            (Some(length), Some(modulus)) => {
                let count = count(scene, k, group);
                let fibre = FibreScales::new(&scales, case, group, length, modulus, count);
                lines.extend(fibre.lines(k, &scales, case, group));
                let warnings = fibre.warnings(case, group);
                lines.extend(warnings.map(|text| format!("  warning: {text}")));
            }
            _ => lines.push(format!(
                "group {k}: length or modulus from a file, no groups"
            )),
        }
    }
    lines
}

/// Fibres of a group, where the case or the placement says it.
fn count(scene: &Scene, group: usize, about: &FibreGroup) -> Option<usize> {
    match about.placement {
        Placement::Random { .. } => {
            let report = scene.placements.iter().find(|report| report.group == group);
            report.map(|report| report.fibres[0])
        }
        Placement::Line { .. } | Placement::Nodes { .. } => Some(1),
        Placement::File { .. } | Placement::Frames { .. } => None,
    }
}

impl FlowScales {
    fn new(scene: &Scene, case: &Case) -> Self {
        let domain = case.domain();
        let fluid = scene.flow.fluid();
        let (density, viscosity) = match (&case.fluid, &case.ambient) {
            (Some(fluid), _) => (fluid.density, fluid.viscosity),
            (None, Some(ambient)) => (ambient.density, ambient.viscosity),
            (None, None) => (0.0, 0.0),
        };
        // The narrowest gap between walls, or the longest edge where there are none.
        let extent = domain.as_ref().map(|domain| {
            let walls = (0..3).filter(|&c| !domain.periodic[c]);
            let gap = walls.map(|c| domain.size[c]).reduce(f64::min);
            gap.unwrap_or_else(|| domain.size.into_iter().fold(0.0, f64::max))
        });
        let volume = (domain.map(|d| d.size.iter().product())).or(fluid.map(Fluid::volume));
        let extent = extent.or(volume.map(f64::cbrt));
        let (speed, difference) = fluid.map_or_else(|| prescribed(case), |f| speeds(f, scene));
        let rate = case
            .shear_rate()
            .unwrap_or_else(|| extent.map_or(0.0, |e| difference / e));
        let spacing = fluid.map(|f| (f.volume() / f.mesh().total_nodes as f64).cbrt());
        Self {
            density,
            viscosity,
            speed,
            rate,
            extent,
            volume,
            spacing,
        }
    }

    fn lines(&self, scene: &Scene) -> Vec<String> {
        let nu = self.viscosity / self.density;
        let mut lines = vec![format!(
            "groups at the start, from U = {:.3e} m/s and γ̇ = {:.3e} 1/s:",
            self.speed, self.rate
        )];
        let Some(extent) = self.extent else {
            return lines;
        };
        let reynolds = self.speed * extent / nu;
        let viscous = extent * extent / nu;
        let convective = extent / self.speed;
        lines.push(format!(
            "  domain: Re = ρUH/μ = {reynolds:.3} over H = {extent:.3e} m; viscous H²/ν = {viscous:.3e} s, convective H/U = {convective:.3e} s"
        ));
        let creeps = scene
            .flow
            .inertia()
            .is_some_and(|i| i.inertia != Inertia::Full);
        if creeps && reynolds > 1.0 {
            lines.push(format!(
                "  warning: convection is left out at Re = {reynolds:.1}"
            ));
        }
        lines
    }
}

/// Largest speed, and by how much velocities differ \[m/s\], at the start. Collective.
fn speeds(fluid: &Fluid, scene: &Scene) -> (f64, f64) {
    let owned = &fluid.velocity()[..fluid.mesh().owned()];
    let size = |u: &[f64; 4]| Vector3::new(u[0], u[1], u[2]).norm();
    let communicator = &scene.communicator;
    let speed = communicator.max(owned.iter().map(size).fold(0.0, f64::max));
    let spans = [0, 1, 2].map(|c| {
        let values = || owned.iter().map(|u| u[c]);
        communicator.max(values().fold(f64::NEG_INFINITY, f64::max))
            - communicator.min(values().fold(f64::INFINITY, f64::min))
    });
    (speed, spans.into_iter().fold(0.0, f64::max))
}

/// The same of a prescribed flow; of a linear one over the domain, if there is one.
fn prescribed(case: &Case) -> (f64, f64) {
    use crate::case::AmbientFlow;
    let Some(ambient) = &case.ambient else {
        return (0.0, 0.0);
    };
    let extent = case.domain().map_or(0.0, |d| d.size[1]);
    match ambient.flow {
        AmbientFlow::Quiescent => (0.0, 0.0),
        AmbientFlow::Uniform { velocity } => (Vector3::from(velocity).norm(), 0.0),
        AmbientFlow::Shear { rate }
        | AmbientFlow::Extension { rate }
        | AmbientFlow::PlanarExtension { rate } => (rate.abs() * extent, rate.abs() * extent),
        AmbientFlow::Vortex { velocity, .. } => (velocity.abs(), 2.0 * velocity.abs()),
    }
}

/// Numbers of a group of fibres.
struct FibreScales {
    aspect_ratio: f64,
    /// Largest slip across the fibre \[m/s\] and what it comes from.
    slip: (f64, &'static str),
    /// Of the diameter and that slip.
    reynolds: f64,
    /// How long velocities take to settle, by the strain rate.
    stokes: f64,
    /// ζ⊥γ̇L⁴/EI, with twice the slip by L for γ̇, which it is in shear.
    flexibility: f64,
    /// nL³ and the volume fraction.
    crowding: Option<[f64; 2]>,
    /// Segment by element.
    per_element: Option<f64>,
    segment: Option<f64>,
    /// ζ⊥L⁴/(22.37² EI): how long a bend takes in the fluid \[s\].
    elastic: f64,
    /// ζ⊥γ̇L²/(8kd): overlap by diameter where the drag of half a fibre presses one contact.
    overlap: Option<f64>,
    /// 2π√(m/k) of a segment of mass m \[s\].
    contact: Option<f64>,
}

impl FibreScales {
    fn new(
        flow: &FlowScales,
        case: &Case,
        group: &FibreGroup,
        length: f64,
        modulus: f64,
        count: Option<usize>,
    ) -> Self {
        let diameter = group.diameter;
        let section = Section::middle(diameter, length);
        let constants = SlenderConstants::Batchelor;
        let drag = constants
            .resistance(section.aspect_ratio(), flow.viscosity)
            .normal;
        let area = PI * diameter * diameter / 4.0;
        let material = Material::new(0.5 * diameter, modulus, group.poisson_ratio, group.density);
        let stiffness = material.bending_stiffness();
        let gravity = Vector3::from(case.gravity.acceleration).norm();
        let sinking = (group.density - flow.density).abs() * gravity * area / drag;
        let held = if group.clamp == Clamp::None {
            0.0
        } else {
            flow.speed
        };
        let turning = 0.5 * flow.rate * length;
        let slips = [
            (turning, "γ̇L/2"),
            (held, "U past the clamp"),
            (sinking, "sinking"),
        ];
        let slip = slips
            .into_iter()
            .fold((0.0, "rest"), |a, b| if b.0 > a.0 { b } else { a });
        let rate = 2.0 * slip.0 / length;
        let segments = match &group.placement {
            Placement::Nodes { positions } => Some(positions.len() - 1),
            _ => group.segments,
        };
        let segment = segments.map(|n| length / n as f64);
        let number = count.zip(flow.volume).map(|(n, volume)| n as f64 / volume);
        let stiffness_of_contact = case.contact.as_ref().and_then(|c| c.stiffness);
        let mass = group.density * area * segment.unwrap_or(length);
        Self {
            aspect_ratio: length / diameter,
            slip,
            reynolds: flow.density * slip.0 * diameter / flow.viscosity,
            stokes: rate * group.density * area / drag,
            flexibility: flexibility(&section, stiffness, flow.viscosity, rate),
            crowding: number.map(|n| [n * length.powi(3), n * area * length]),
            per_element: segment.zip(flow.spacing).map(|(l, h)| l / h),
            segment,
            elastic: drag * length.powi(4) / (FREE_BENDING.powi(2) * stiffness),
            overlap: stiffness_of_contact
                .map(|k| drag * flow.rate * length * length / (8.0 * k * diameter)),
            contact: stiffness_of_contact.map(|k| 2.0 * PI * (mass / k).sqrt()),
        }
    }

    fn lines(&self, k: usize, flow: &FlowScales, case: &Case, group: &FibreGroup) -> [String; 2] {
        let crowding = self
            .crowding
            .map_or_else(String::new, |[crowding, fraction]| {
                format!(", nL³ = {crowding:.3}, volume fraction {fraction:.3e}")
            });
        let element = self.per_element.map_or_else(String::new, |ratio| {
            format!(", segment by element {ratio:.2}")
        });
        let contact = self
            .contact
            .map_or_else(String::new, |t| format!(", contact 2π√(m/k) = {t:.3e} s"));
        let step = case
            .time
            .step
            .map_or_else(String::new, |dt| format!(", step {dt:.3e} s"));
        [
            format!(
                "  group {k}: r_p = {:.1}, Re_d = {:.3e} ({}), St = {:.3e}, ζ⊥γ̇L⁴/EI = {:.3e}{crowding}{element}",
                self.aspect_ratio, self.reynolds, self.slip.1, self.stokes, self.flexibility
            ),
            format!(
                "    times: viscous d²/ν = {:.3e} s, elastic ζ⊥L⁴/(500 EI) = {:.3e} s{contact}{step}",
                flow.density * group.diameter * group.diameter / flow.viscosity,
                self.elastic
            ),
        ]
    }

    /// Models outside their range.
    fn warnings(&self, case: &Case, group: &FibreGroup) -> impl Iterator<Item = String> + use<> {
        let drag = case.hydrodynamics.drag;
        let slender = matches!(drag, DragLaw::SlenderBody | DragLaw::Auto);
        let (reynolds, ratio) = (self.reynolds, self.aspect_ratio);
        let two_way = case.coupling.mode == CouplingMode::TwoWay && case.fluid.is_some();
        let mut found = Vec::new();
        if drag == DragLaw::SlenderBody && reynolds > CREEPING_DIAMETER {
            found.push(format!("slender-body drag holds below Re_d = {CREEPING_DIAMETER}, here {reynolds:.2e}: `drag = \"auto\"`"));
        }
        if slender && ratio < SLENDER {
            found.push(format!(
                "slender-body drag holds above r_p = {SLENDER}, here {ratio:.1}"
            ));
        }
        if drag == DragLaw::InfiniteCylinder && reynolds > 0.0 && reynolds < CREEPING_DIAMETER {
            found.push(format!("at Re_d = {reynolds:.2e} drag depends on the length of the fibre, that of infinite cylinders does not: `drag = \"auto\"`"));
        }
        if drag == DragLaw::ProlateSpheroid {
            found.push("drag of spheroids depends on the number of segments".to_owned());
            if let Some(segment) = self.segment.filter(|l| *l < group.diameter * f64::exp(0.5)) {
                found.push(format!(
                    "a segment {:.2} diameters long is no prolate spheroid",
                    segment / group.diameter
                ));
            }
        }
        if let Some(ratio) = self
            .per_element
            .filter(|r| two_way && !(PER_ELEMENT[0]..=PER_ELEMENT[1]).contains(r))
        {
            found.push(format!(
                "two-way coupling wants segments of {} to {} elements, here {ratio:.2}",
                PER_ELEMENT[0], PER_ELEMENT[1]
            ));
        }
        if let (Some([crowding, _]), false) = (self.crowding, two_way)
            && crowding > 1.0
        {
            found.push(format!("at nL³ = {crowding:.2} fibres disturb each other's flow, which one-way coupling leaves out"));
        }
        if let (Some([crowding, _]), None) = (self.crowding, &case.contact)
            && crowding / ratio > 0.1
        {
            found.push(format!(
                "at nL²d = {:.2} fibres touch, and there is no `[contact]`",
                crowding / ratio
            ));
        }
        if let Some(overlap) = self.overlap.filter(|o| *o > SOFT) {
            found.push(format!("contacts are soft: drag of half a fibre, ζ⊥γ̇L²/8, presses one by {overlap:.2} diameters"));
        }
        found.into_iter()
    }
}
