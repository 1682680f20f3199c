//! All fibres of a rank in flat arrays.

use crate::beam::{Pose, Segment, mass_shares};
use crate::carried::Carried;
use crate::contact::{ContactSettings, ContactSystem};
use crate::drag::{Added, Hydrodynamics, NodeDrag, PointDrag};
use crate::implicit::{Body, Integrator};
use crate::lanes::Packed;
use crate::observe::{Account, Accounts};
use crate::points::{abscissa, point_count};
use crate::shape::{Fibre, Kinematics, Material, SEGMENT_BITS, prepare};
use crate::touching::Touching;
use crate::{Ambient, FibreError, Points, Quaternion, Reaction, Vector3};
use fibreflow_parallel::Communicator;

/// Settings of a fibre system.
#[derive(Clone, Debug)]
pub struct FibreSettings {
    /// Gravitational acceleration \[m/s²\].
    pub gravity: Vector3,
    /// Density of the fluid whose weight is taken off \[kg/m³\]; 0 for no buoyancy.
    pub buoyant_density: f64,
    /// How the flow acts on the fibres; none for fibres in vacuum.
    pub hydrodynamics: Option<Hydrodynamics>,
    /// Adds the inertia of the displaced fluid where a flow acts: its pressure gradient and the added mass across the fibre.
    pub fluid_inertia: bool,
    /// Contacts; none for fibres that pass through each other.
    pub contacts: Option<ContactSettings>,
    /// How fibres advance in time.
    pub integrator: Integrator,
    /// Explicit sub-step over critical step, in (0, 1).
    pub step_safety: f64,
    /// Keeps the accounts of [`FibreSystem::budget`].
    pub budget: bool,
}

impl Default for FibreSettings {
    fn default() -> Self {
        Self {
            gravity: Vector3::zeros(),
            buoyant_density: 0.0,
            hydrodynamics: None,
            fluid_inertia: false,
            contacts: None,
            integrator: Integrator::default(),
            step_safety: 0.7,
            budget: false,
        }
    }
}

/// Constants of one node.
#[derive(Clone, Copy, Debug)]
pub(crate) struct NodeConstants {
    /// Share of the mass of the adjacent segments \[kg\].
    pub mass: f64,
    /// Rotary inertia about the axes across the tangent \[kg·m²\].
    pub transverse_inertia: f64,
    /// Rotary inertia about the tangent \[kg·m²\].
    pub axial_inertia: f64,
    /// Weight less buoyancy \[N\].
    pub weight: Vector3,
    pub holds_translation: bool,
    pub holds_rotation: bool,
}

/// Force \[N\] and torque \[N·m\] on a node.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Load {
    pub force: Vector3,
    pub torque: Vector3,
}

impl Load {
    pub const ZERO: Self = Self {
        force: Vector3::new(0.0, 0.0, 0.0),
        torque: Vector3::new(0.0, 0.0, 0.0),
    };
}

/// Constants of one fibre.
#[derive(Clone, Debug)]
pub(crate) struct FibreConstants {
    pub id: u64,
    /// Id of the first segment in the fibre that it has broken from; its own first one if it is whole.
    pub stem: u64,
    pub material: Material,
    /// Sum of rest lengths \[m\].
    pub length: f64,
    /// Largest stable sub-step without contacts \[s\].
    pub critical_step: f64,
    /// A rigid fibre.
    pub body: Option<Body>,
    pub twist_free: bool,
}

/// What does not change while time advances.
#[derive(Clone, Debug, Default)]
pub(crate) struct Model {
    pub fibres: Vec<FibreConstants>,
    /// First node of each fibre, and the number of nodes at the end.
    pub offsets: Vec<usize>,
    pub nodes: Vec<NodeConstants>,
    /// Given loads, constant in time and direction.
    pub loads: Vec<Load>,
    /// Segments of fibre f start at `offsets\[f\] - f`.
    pub segments: Vec<Segment>,
    /// First hydrodynamic point of each segment, and the number of points at the end; all 0 without hydrodynamics.
    pub points: Vec<usize>,
    /// The same constants for [`crate::lanes`]; empty with hydrodynamics, and from a change to the next step.
    pub packed: Packed,
}

impl FibreConstants {
    /// Whether the fibre has no explicit sub-steps.
    pub fn only_implicit(&self) -> bool {
        self.body.is_some() || self.twist_free
    }
}

impl Model {
    fn empty() -> Self {
        Self {
            offsets: vec![0],
            points: vec![0],
            ..Self::default()
        }
    }

    pub fn node_range(&self, fibre: usize) -> std::ops::Range<usize> {
        self.offsets[fibre]..self.offsets[fibre + 1]
    }

    pub fn segment_range(&self, fibre: usize) -> std::ops::Range<usize> {
        self.offsets[fibre] - fibre..self.offsets[fibre + 1] - fibre - 1
    }
}

/// What changes in time: one entry a node.
#[derive(Clone, Debug, Default)]
pub(crate) struct Motion {
    pub position: Vec<Vector3>,
    pub velocity: Vec<Vector3>,
    pub orientation: Vec<Quaternion>,
    pub angular_velocity: Vec<Vector3>,
}

/// Work space of a step, sized once.
#[derive(Clone, Debug, Default)]
pub(crate) struct Scratch {
    pub load: Vec<Load>,
    pub drag: Vec<NodeDrag>,
    pub point_drag: Vec<PointDrag>,
    pub added: Vec<Added>,
}

/// Fibres of this rank: nodes of all fibres one after another, in the order of the global ids.
pub struct FibreSystem {
    pub(crate) communicator: Communicator,
    pub(crate) settings: FibreSettings,
    pub(crate) model: Model,
    pub(crate) motion: Motion,
    pub(crate) touching: Option<Touching>,
    pub(crate) scratch: Scratch,
    pub(crate) reaction: Reaction,
    pub(crate) carried: Carried,
    pub(crate) accounts: Accounts,
    /// (sub-steps of the fibre with the most, segment sub-steps) of the last step.
    pub(crate) work: (usize, usize),
    /// Points and flow of [`FibreSystem::advance_in_flow`].
    pub(crate) points: Points,
    pub(crate) ambient: Ambient,
}

impl FibreSystem {
    /// A system of the given fibres (those of this rank), at rest.
    ///
    /// # Errors
    /// A shape, material or setting that cannot be used; two fibres of this rank with one id.
    pub fn new(
        communicator: Communicator,
        settings: FibreSettings,
        mut fibres: Vec<Fibre>,
    ) -> Result<Self, FibreError> {
        settings.check()?;
        fibres.sort_by_key(|f| f.id);
        if let Some(pair) = fibres.windows(2).find(|w| w[0].id == w[1].id) {
            return Err(FibreError::DuplicateId { fibre: pair[0].id });
        }
        let touching = match &settings.contacts {
            Some(contacts) => Some(Touching::new(contacts.clone(), &communicator)?),
            None => None,
        };
        let mut system = Self {
            communicator,
            settings,
            touching,
            model: Model::empty(),
            motion: Motion::default(),
            scratch: Scratch::default(),
            reaction: Reaction::default(),
            carried: Carried::default(),
            accounts: Accounts::default(),
            work: (0, 0),
            points: Points::default(),
            ambient: Ambient::default(),
        };
        for fibre in &fibres {
            system.push(fibre)?;
        }
        system.resize_scratch();
        Ok(system)
    }

    /// Drops all fibres.
    pub(crate) fn clear(&mut self) {
        self.model = Model::empty();
        self.motion = Motion::default();
        self.accounts.fibres.clear();
        self.carried.values.clear();
    }

    fn push(&mut self, fibre: &Fibre) -> Result<(), FibreError> {
        let prepared = prepare(fibre)?;
        if fibre.kinematics == Kinematics::Rigid && self.settings.fluid_inertia {
            return Err(FibreError::RigidInertia { fibre: fibre.id });
        }
        let nodes = fibre.nodes.len();
        self.motion.position.extend_from_slice(&fibre.nodes);
        self.motion.orientation.extend(prepared.orientation);
        let total = self.motion.position.len();
        self.motion.velocity.resize(total, Vector3::zeros());
        self.motion.angular_velocity.resize(total, Vector3::zeros());
        let mut held = vec![(false, false); nodes];
        for support in &fibre.supports {
            let node = &mut held[support.node];
            node.0 |= support.translation;
            node.1 |= support.rotation;
        }
        self.push_constants(
            (fibre.id, Self::segment_id(fibre.id, 0)),
            fibre.material,
            fibre.kinematics,
            prepared.segments,
            &held,
        );
        Ok(())
    }

    /// Appends the constants of one fibre of this id and stem; `held` lists (translation, rotation) for each node.
    pub(crate) fn push_constants(
        &mut self,
        (id, stem): (u64, u64),
        material: Material,
        kinematics: Kinematics,
        segments: Vec<Segment>,
        held: &[(bool, bool)],
    ) {
        let line_density = material.density * material.area();
        let rotary_ratio = material.rotary_ratio();
        let twist_free = kinematics == Kinematics::TwistFree;
        let weight_per_mass =
            self.settings.gravity * (1.0 - self.settings.buoyant_density / material.density);
        let mut frequency = 0.0_f64;
        let mut masses = vec![0.0; held.len()];
        let mut inertias = vec![0.0; held.len()];
        let mut weights = vec![Vector3::zeros(); held.len()];
        for (i, s) in segments.iter().enumerate() {
            let line_density = line_density * (s.radius / material.radius).powi(2);
            let axial_per_mass = 0.5 * s.radius * s.radius;
            let transverse_per_mass = axial_per_mass * rotary_ratio;
            let given =
                mass_shares(i, segments.len()).map(|share| share * line_density * s.rest_length);
            for (node, mass) in [i, i + 1].into_iter().zip(given) {
                masses[node] += mass;
                // Positions alone move.
                if !twist_free {
                    inertias[node] += mass * axial_per_mass;
                }
            }
            // In halves, as uniform drag is: what settles straight stays straight.
            let weight = weight_per_mass * (0.5 * line_density * s.rest_length);
            weights[i] += weight;
            weights[i + 1] += weight;
            let bound = s.frequency_bound(given, transverse_per_mass, axial_per_mass);
            frequency = frequency.max(bound);
        }
        let frequency = frequency.sqrt();
        let damping = 0.5 * material.retardation * frequency;
        for (i, &(holds_translation, holds_rotation)) in held.iter().enumerate() {
            let mass = masses[i];
            self.model.nodes.push(NodeConstants {
                mass,
                transverse_inertia: inertias[i] * rotary_ratio,
                axial_inertia: inertias[i],
                weight: weights[i],
                holds_translation,
                holds_rotation,
            });
            self.model.loads.push(Load::ZERO);
        }
        let first = self.model.nodes.len() - held.len();
        let explicit = 2.0 / frequency * ((1.0 + damping * damping).sqrt() - damping);
        self.accounts.fibres.push(Account::default());
        self.model.fibres.push(FibreConstants {
            id,
            stem,
            material,
            length: segments.iter().map(|s| s.rest_length).sum(),
            critical_step: match kinematics {
                Kinematics::Full => explicit,
                Kinematics::TwistFree | Kinematics::Rigid => f64::INFINITY,
            },
            twist_free,
            body: (kinematics == Kinematics::Rigid)
                .then(|| Body::new(&segments, &self.model.nodes[first..])),
        });
        let mut point = self.point_count();
        for segment in &segments {
            if let Some(law) = &self.settings.hydrodynamics {
                point += point_count(segment.rest_length, law.point_spacing);
            }
            self.model.points.push(point);
        }
        self.model.segments.extend(segments);
        self.model.offsets.push(self.model.nodes.len());
    }

    /// Fits the work space to the model.
    pub(crate) fn resize_scratch(&mut self) {
        let nodes = self.model.nodes.len();
        let points = self.point_count();
        self.scratch.load.resize(nodes, Load::ZERO);
        self.reaction.force.resize(points, Vector3::zeros());
        self.reaction.torque.resize(points, Vector3::zeros());
        self.carried.values.resize(points * self.carried.width, 0.0);
        self.model.packed = Packed::default();
        if self.settings.hydrodynamics.is_some() {
            self.scratch.drag.resize(nodes, NodeDrag::zero());
            self.scratch.point_drag.resize(points, PointDrag::zero());
            let added = if self.settings.fluid_inertia {
                nodes
            } else {
                0
            };
            self.scratch.added.resize(added, Added::zero());
        }
        if let Some(touching) = &mut self.touching {
            touching.rebuild(&self.model);
        }
    }

    /// Sub-steps of the last step, largest of this rank's fibres.
    pub fn substeps(&self) -> usize {
        self.work.0
    }

    /// Sum over this rank's segments of the sub-steps of the last step.
    pub fn segment_substeps(&self) -> usize {
        self.work.1
    }

    /// Number of hydrodynamic points of this rank.
    pub fn point_count(&self) -> usize {
        self.model.points[self.model.points.len() - 1]
    }

    /// How fibres are computed.
    pub fn settings(&self) -> &FibreSettings {
        &self.settings
    }

    /// The hydrodynamic points at the present positions; `out` is overwritten.
    pub fn points(&self, out: &mut Points) {
        self.points_after(0.0, out);
    }

    /// The hydrodynamic points where they will be after `time` \[s\] at the velocities of now; `out` is overwritten.
    pub fn points_after(&self, time: f64, out: &mut Points) {
        let points = self.point_count();
        out.position.resize(points, Vector3::zeros());
        out.velocity.resize(points, Vector3::zeros());
        let mut points = out.position.iter_mut().zip(&mut out.velocity);
        for f in 0..self.fibres() {
            let node = self.model.offsets[f];
            for (i, s) in self.model.segment_range(f).enumerate() {
                let (a, b) = (
                    self.motion.position[node + i],
                    self.motion.position[node + i + 1],
                );
                let (v, w) = (
                    self.motion.velocity[node + i],
                    self.motion.velocity[node + i + 1],
                );
                let count = self.model.points[s + 1] - self.model.points[s];
                for (k, (position, velocity)) in (0..count).zip(&mut points) {
                    let xi = abscissa(k, count);
                    *velocity = v + (w - v) * xi;
                    *position = a + (b - a) * xi + *velocity * time;
                }
            }
        }
    }

    /// Fibre length that each hydrodynamic point stands for \[m\].
    pub fn point_lengths(&self) -> impl Iterator<Item = f64> + '_ {
        let segments = self.model.segments.iter().zip(self.model.points.windows(2));
        segments.flat_map(|(segment, points)| {
            let count = points[1] - points[0];
            std::iter::repeat_n(segment.rest_length / count as f64, count)
        })
    }

    /// First hydrodynamic point of each fibre and, last, the number of points.
    pub fn point_offsets(&self) -> Vec<usize> {
        let first = |f: usize| self.model.points[self.model.segment_range(f).start];
        let starts = (0..self.fibres()).map(first);
        starts.chain([self.point_count()]).collect()
    }

    /// The ranks that share the fibres.
    pub fn communicator(&self) -> &Communicator {
        &self.communicator
    }

    /// Contacts, if the settings have any.
    pub fn contacts(&self) -> Option<&ContactSystem> {
        self.touching.as_ref().map(|touching| &touching.contacts)
    }

    /// Number of fibres of this rank.
    pub fn fibres(&self) -> usize {
        self.model.fibres.len()
    }

    /// Number of segments of this rank.
    pub fn segments(&self) -> usize {
        self.model.segments.len()
    }

    /// Global id of a local fibre.
    pub fn id(&self, fibre: usize) -> u64 {
        self.model.fibres[fibre].id
    }

    /// Material of a local fibre.
    pub fn material(&self, fibre: usize) -> &Material {
        &self.model.fibres[fibre].material
    }

    /// Radii of the segments of a local fibre \[m\].
    pub fn radii(&self, fibre: usize) -> impl ExactSizeIterator<Item = f64> + '_ {
        let segments = &self.model.segments[self.model.segment_range(fibre)];
        segments.iter().map(|segment| segment.radius)
    }

    /// Stress-free length of a local fibre \[m\].
    pub fn length(&self, fibre: usize) -> f64 {
        self.model.fibres[fibre].length
    }

    /// First node of each local fibre and, last, the number of nodes.
    pub fn offsets(&self) -> &[usize] {
        &self.model.offsets
    }

    /// Node positions \[m\], unwrapped.
    pub fn positions(&self) -> &[Vector3] {
        &self.motion.position
    }

    /// Node velocities \[m/s\].
    pub fn velocities(&self) -> &[Vector3] {
        &self.motion.velocity
    }

    /// Node velocities \[m/s\], to set an initial motion or that of held nodes.
    pub fn velocities_mut(&mut self) -> &mut [Vector3] {
        &mut self.motion.velocity
    }

    /// Node frames.
    pub fn orientations(&self) -> &[Quaternion] {
        &self.motion.orientation
    }

    /// Angular velocities of the node frames, space axes \[rad/s\].
    pub fn angular_velocities(&self) -> &[Vector3] {
        &self.motion.angular_velocity
    }

    /// Angular velocities \[rad/s\], to set an initial motion or that of held nodes.
    pub fn angular_velocities_mut(&mut self) -> &mut [Vector3] {
        &mut self.motion.angular_velocity
    }

    /// Ids of fibres are below this.
    pub(crate) const ID_LIMIT: u64 = 1 << (63 - SEGMENT_BITS);

    /// Global id of segment `segment` of fibre `fibre` (a global id).
    pub fn segment_id(fibre: u64, segment: usize) -> u64 {
        fibre << SEGMENT_BITS | segment as u64
    }

    /// Local index of a fibre.
    pub fn find(&self, id: u64) -> Option<usize> {
        self.model.fibres.binary_search_by_key(&id, |f| f.id).ok()
    }

    /// Adds a force \[N\] and a torque \[N·m\], constant in time and direction, to a node of a fibre of this rank.
    ///
    /// # Errors
    /// [`FibreError::NoSuchFibre`], [`FibreError::NoSuchNode`].
    pub fn add_load(
        &mut self,
        fibre: u64,
        node: usize,
        force: Vector3,
        torque: Vector3,
    ) -> Result<(), FibreError> {
        let local = self.find(fibre).ok_or(FibreError::NoSuchFibre { fibre })?;
        let range = self.model.node_range(local);
        let nodes = range.len();
        if node >= nodes {
            return Err(FibreError::NoSuchNode { fibre, node, nodes });
        }
        let load = &mut self.model.loads[range.start + node];
        load.force += force;
        load.torque += torque;
        self.model.packed = Packed::default();
        Ok(())
    }

    /// Largest stable sub-step of the fibres of this rank, without contacts \[s\]; infinite without fibres.
    ///
    /// 2/ω with ω the largest element frequency (Kunhappan 2018, eqs. 3.37–3.40 with the errata), reduced by damping
    /// of ratio ξ to (2/ω)(√(1 + ξ²) − ξ). Drag is implicit and does not limit it.
    pub fn critical_step(&self) -> f64 {
        let steps = self.model.fibres.iter().map(|f| f.critical_step);
        steps.fold(f64::INFINITY, f64::min)
    }

    /// Poses of the two ends of a segment of a local fibre.
    pub(crate) fn segment_poses(&self, fibre: usize, segment: usize) -> (Pose<'_>, Pose<'_>) {
        let node = self.model.offsets[fibre] + segment;
        let pose = |i: usize| Pose {
            position: &self.motion.position[i],
            orientation: &self.motion.orientation[i],
        };
        (pose(node), pose(node + 1))
    }

    /// Names the first fibre and node whose state is not finite.
    ///
    /// # Errors
    /// [`FibreError::NonFinite`].
    pub fn check_finite(&self) -> Result<(), FibreError> {
        for (f, fibre) in self.model.fibres.iter().enumerate() {
            let range = self.model.node_range(f);
            for i in range.clone() {
                let m = &self.motion;
                let finite = |v: &Vector3| v.x.is_finite() && v.y.is_finite() && v.z.is_finite();
                let q = m.orientation[i].coords.sum();
                let field = if !finite(&m.position[i]) {
                    "position"
                } else if !finite(&m.velocity[i]) {
                    "velocity"
                } else if !finite(&m.angular_velocity[i]) {
                    "angular velocity"
                } else if !q.is_finite() {
                    "orientation"
                } else {
                    continue;
                };
                return Err(FibreError::NonFinite {
                    fibre: fibre.id,
                    node: i - range.start,
                    field,
                    position: m.position[i],
                });
            }
        }
        Ok(())
    }
}

impl FibreSettings {
    fn check(&self) -> Result<(), FibreError> {
        if !(self.step_safety > 0.0 && self.step_safety < 1.0) {
            return Err(FibreError::Setting {
                setting: "step_safety",
                value: self.step_safety,
                requirement: "between 0 and 1",
            });
        }
        if !(self.buoyant_density >= 0.0 && self.buoyant_density.is_finite()) {
            return Err(FibreError::Setting {
                setting: "buoyant_density",
                value: self.buoyant_density,
                requirement: "zero or positive",
            });
        }
        if let Integrator::Implicit(implicit) | Integrator::Auto(implicit) = &self.integrator
            && implicit.tolerance.partial_cmp(&0.0) != Some(std::cmp::Ordering::Greater)
        {
            return Err(FibreError::Setting {
                setting: "step tolerance",
                value: implicit.tolerance,
                requirement: "positive",
            });
        }
        if let Some(law) = &self.hydrodynamics {
            let positive = [
                ("point_spacing", law.point_spacing, true),
                (
                    "fluid viscosity",
                    law.fluid.viscosity,
                    law.fluid.viscosity.is_finite(),
                ),
                (
                    "fluid density",
                    law.fluid.density,
                    law.fluid.density.is_finite(),
                ),
            ];
            for (setting, value, finite) in positive {
                if !(value > 0.0 && finite) {
                    return Err(FibreError::Setting {
                        setting,
                        value,
                        requirement: "positive",
                    });
                }
            }
        }
        let gravity = self.gravity.norm();
        if !gravity.is_finite() {
            return Err(FibreError::Setting {
                setting: "gravity",
                value: gravity,
                requirement: "finite",
            });
        }
        Ok(())
    }
}
