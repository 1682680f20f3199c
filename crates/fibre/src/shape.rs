//! One fibre before it joins the system: material, placed and stress-free shape, supports, node frames.

use crate::beam::{Segment, tangent};
use crate::{FibreError, FibreSystem, Quaternion, Vector3};

/// A homogeneous, linearly elastic section: round, but for its bending stiffness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// Radius \[m\].
    pub radius: f64,
    /// Young's modulus E \[Pa\].
    pub youngs_modulus: f64,
    /// Shear modulus G \[Pa\].
    pub shear_modulus: f64,
    /// Density \[kg/m³\].
    pub density: f64,
    /// Kelvin–Voigt retardation time \[s\], 0 for a purely elastic fibre.
    pub retardation: f64,
    /// Gives way to shear (Timoshenko) instead of bending alone (Euler, Bernoulli).
    pub shear: bool,
    /// Bending stiffness in the plane of tangent and [`Fibre::section_axis`], over that across the plane; their mean is
    /// EI. 1 for a section that bends alike in all directions.
    pub bending_ratio: f64,
    /// Tensile stress at which the fibre breaks \[Pa\]; infinite for one that does not.
    pub strength: f64,
}

impl Material {
    /// Material with G = E / (2(1 + ν)), without damping.
    pub fn new(radius: f64, youngs_modulus: f64, poisson_ratio: f64, density: f64) -> Self {
        Self {
            radius,
            youngs_modulus,
            shear_modulus: youngs_modulus / (2.0 * (1.0 + poisson_ratio)),
            density,
            retardation: 0.0,
            shear: false,
            bending_ratio: 1.0,
            strength: f64::INFINITY,
        }
    }

    /// Cross-section A = πr² \[m²\].
    pub fn area(&self) -> f64 {
        std::f64::consts::PI * self.radius * self.radius
    }

    /// Second moment of area I = πr⁴/4 \[m⁴\]; the polar moment J is twice that.
    pub fn second_moment(&self) -> f64 {
        0.25 * self.area() * self.radius * self.radius
    }

    /// EI \[N·m²\].
    pub fn bending_stiffness(&self) -> f64 {
        self.youngs_modulus * self.second_moment()
    }

    /// Ratio of transverse to axial rotary inertia of a node.
    ///
    /// Transverse rotary inertia per length is ρI(1 + E/κG): ρI is the section's own (the length's share sits in the
    /// two node masses, which already carry more than the segment's), and the factor is the leading effect of shear
    /// in Timoshenko's beam, κ = 6(1+ν)/(7+6ν) of a round section (Cowper 1966), so that E/κG = (7+6ν)/3.
    pub fn rotary_ratio(&self) -> f64 {
        0.5 * (1.0 + if self.shear { 0.0 } else { self.shear_number() })
    }

    /// E/κG.
    fn shear_number(&self) -> f64 {
        let poisson = self.youngs_modulus / (2.0 * self.shear_modulus) - 1.0;
        (7.0 + 6.0 * poisson) / 3.0
    }

    /// A segment of this material and the given radius.
    pub(crate) fn segment(
        &self,
        rest_length: f64,
        radius: f64,
        start_frame: Quaternion,
        end_frame: Quaternion,
    ) -> Segment {
        let section = Self { radius, ..*self };
        // Φ = 12EI/(κGA l₀²)
        let shear = if self.shear {
            3.0 * self.shear_number() * (radius / rest_length).powi(2)
        } else {
            0.0
        };
        let bending = section.bending_stiffness() / (rest_length * (1.0 + shear));
        Segment {
            rest_length,
            axial: self.youngs_modulus * section.area() / rest_length,
            radius,
            bending,
            mutual: bending * (1.0 - 0.5 * shear),
            flatness: (self.bending_ratio - 1.0) / (self.bending_ratio + 1.0),
            torsion: 2.0 * self.shear_modulus * section.second_moment() / rest_length,
            retardation: self.retardation,
            start_frame,
            end_frame,
        }
    }

    pub(crate) fn check(&self, fibre: u64) -> Result<(), FibreError> {
        let positive = [
            ("radius", self.radius),
            ("Young's modulus", self.youngs_modulus),
            ("shear modulus", self.shear_modulus),
            ("density", self.density),
            ("ratio of bending stiffnesses", self.bending_ratio),
        ];
        for (quantity, value) in positive {
            if !(value > 0.0 && value.is_finite()) {
                return Err(FibreError::Material {
                    fibre,
                    quantity,
                    value,
                    requirement: "positive and finite",
                });
            }
        }
        if self.shear_modulus < self.youngs_modulus / 3.0 * (1.0 - 1e-12) {
            return Err(FibreError::Material {
                fibre,
                quantity: "shear modulus",
                value: self.shear_modulus,
                requirement: "at least a third of Young's modulus (Poisson's ratio up to 0.5)",
            });
        }
        if self.strength.partial_cmp(&0.0) != Some(std::cmp::Ordering::Greater) {
            return Err(FibreError::Material {
                fibre,
                quantity: "strength",
                value: self.strength,
                requirement: "positive",
            });
        }
        if !(self.retardation >= 0.0 && self.retardation.is_finite()) {
            return Err(FibreError::Material {
                fibre,
                quantity: "retardation time",
                value: self.retardation,
                requirement: "zero or positive",
            });
        }
        Ok(())
    }
}

/// The stress-free shape of a fibre.
#[derive(Clone, Debug, PartialEq)]
pub enum Equilibrium {
    /// The shape it is placed in.
    Placed,
    /// Straight, with the placed chord lengths.
    Straight,
    /// Node positions \[m\] of the stress-free shape, anywhere in space; one for each node of the fibre.
    Shape(Vec<Vector3>),
}

/// What is held at a node. A held node keeps the velocity (angular velocity) it has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Support {
    /// Index of the node in the fibre.
    pub node: usize,
    /// Holds the position.
    pub translation: bool,
    /// Holds the frame.
    pub rotation: bool,
}

impl Support {
    /// Position and frame held.
    pub fn clamp(node: usize) -> Self {
        Self {
            node,
            translation: true,
            rotation: true,
        }
    }
}

/// One fibre as given: at rest unless velocities are set afterwards.
#[derive(Clone, Debug)]
pub struct Fibre {
    /// Global id, unique over all ranks, below 2⁴⁴.
    pub id: u64,
    /// Section and material.
    pub material: Material,
    /// Node positions \[m\], unwrapped (not folded into a periodic box).
    pub nodes: Vec<Vector3>,
    /// Stress-free shape.
    pub equilibrium: Equilibrium,
    /// Supports, none for a free fibre.
    pub supports: Vec<Support>,
    /// Twist of the stress-free shape about its tangent \[rad/m\]; what is placed in another shape is placed without.
    pub twist: f64,
    /// Radius of the last section over that of the first; between them it changes evenly, and
    /// [`Material::radius`] is that in the middle.
    pub taper: f64,
    /// Direction of the plane of [`Material::bending_ratio`] at the first segment, by the coordinates of the stress-free shape
    /// (of the placed one, if the fibre is straight without stress). Needed only where that ratio is not 1; its part along the
    /// tangent does not count.
    pub section_axis: Vector3,
    /// What it can do.
    pub kinematics: Kinematics,
}

/// What a fibre can do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Kinematics {
    /// Stretch, bend and twist: six unknowns a node.
    #[default]
    Full,
    /// Stretch and bend: three unknowns a node. For a round fibre, straight without load, that no torque twists; always implicit.
    TwistFree,
    /// Keeps its stress-free shape: six unknowns, free of supports; always implicit.
    Rigid,
}

impl Fibre {
    /// A free fibre that is stress-free as placed.
    pub fn new(id: u64, material: Material, nodes: Vec<Vector3>) -> Self {
        Self {
            id,
            material,
            nodes,
            equilibrium: Equilibrium::Placed,
            supports: Vec::new(),
            twist: 0.0,
            taper: 1.0,
            section_axis: Vector3::zeros(),
            kinematics: Kinematics::Full,
        }
    }

    /// A free straight fibre of `segments` equal segments from `start` to `end`.
    pub fn straight(
        id: u64,
        material: Material,
        start: Vector3,
        end: Vector3,
        segments: usize,
    ) -> Self {
        let node = |i| start + (end - start) * (i as f64 / segments as f64);
        Self::new(id, material, (0..=segments).map(node).collect())
    }
}

/// A fibre with node frames and segment constants worked out.
pub(crate) struct Prepared {
    pub orientation: Vec<Quaternion>,
    pub segments: Vec<Segment>,
}

/// Number of bits of a segment id that count segments within a fibre.
pub(crate) const SEGMENT_BITS: u32 = 20;

pub(crate) fn prepare(fibre: &Fibre) -> Result<Prepared, FibreError> {
    let nodes = fibre.nodes.len();
    if nodes < 2 {
        return Err(FibreError::TooFewNodes {
            fibre: fibre.id,
            nodes,
        });
    }
    if nodes - 1 > 1 << SEGMENT_BITS {
        return Err(FibreError::TooManySegments {
            fibre: fibre.id,
            segments: nodes - 1,
            limit: 1 << SEGMENT_BITS,
        });
    }
    if fibre.id >= FibreSystem::ID_LIMIT {
        return Err(FibreError::IdTooLarge {
            fibre: fibre.id,
            limit: FibreSystem::ID_LIMIT,
        });
    }
    fibre.material.check(fibre.id)?;
    if fibre.kinematics == Kinematics::Rigid && !fibre.supports.is_empty() {
        return Err(FibreError::RigidSupport { fibre: fibre.id });
    }
    for support in &fibre.supports {
        if support.node >= nodes {
            return Err(FibreError::NoSuchNode {
                fibre: fibre.id,
                node: support.node,
                nodes,
            });
        }
    }
    let placed = segment_frames(fibre.id, &fibre.nodes, "placed")?;
    let placed_lengths = || chord_lengths(&fibre.nodes);
    let (rest, rest_lengths) = match &fibre.equilibrium {
        Equilibrium::Placed => (placed.clone(), placed_lengths()),
        Equilibrium::Straight => (vec![Quaternion::identity(); placed.len()], placed_lengths()),
        Equilibrium::Shape(shape) => {
            if shape.len() != nodes {
                return Err(FibreError::EquilibriumSize {
                    fibre: fibre.id,
                    nodes,
                    equilibrium: shape.len(),
                });
            }
            (
                segment_frames(fibre.id, shape, "equilibrium")?,
                chord_lengths(shape),
            )
        }
    };
    let rest = twisted(fibre, rest, &rest_lengths)?;
    let rest_nodes = node_frames(&rest);
    let first = match fibre.equilibrium {
        Equilibrium::Straight => placed[0],
        Equilibrium::Placed | Equilibrium::Shape(_) => rest[0],
    };
    let roll = section_roll(fibre, &first)?;
    let radii = radii(fibre, &rest_lengths)?;
    let segments = rest
        .iter()
        .zip(rest_lengths.iter().zip(&radii))
        .enumerate()
        .map(|(s, (frame, (&length, &radius)))| {
            let offset = |node: usize| rest_nodes[node].inverse() * frame * roll;
            (fibre.material).segment(length, radius, offset(s), offset(s + 1))
        })
        .collect::<Vec<_>>();
    if fibre.kinematics == Kinematics::TwistFree {
        check_twist_free(fibre, &segments)?;
    }
    let orientation = match fibre.equilibrium {
        Equilibrium::Placed => rest_nodes,
        Equilibrium::Straight | Equilibrium::Shape(_) => node_frames(&placed),
    };
    Ok(Prepared {
        orientation,
        segments,
    })
}

/// Frames of the segments with the twist of the fibre, none at its first end.
pub(crate) fn twisted(
    fibre: &Fibre,
    frames: Vec<Quaternion>,
    lengths: &[f64],
) -> Result<Vec<Quaternion>, FibreError> {
    let longest = lengths.iter().copied().fold(0.0, f64::max);
    // Between two segments a twist is known up to a turn.
    let within = (fibre.twist.abs() * longest).partial_cmp(&(0.9 * std::f64::consts::PI));
    if within != Some(std::cmp::Ordering::Less) {
        return Err(FibreError::Twist {
            fibre: fibre.id,
            twist: fibre.twist,
            limit: 0.9 * std::f64::consts::PI / longest,
        });
    }
    let mut start = 0.0;
    let along = frames.into_iter().zip(lengths).map(|(frame, length)| {
        let middle = start + 0.5 * length;
        start += length;
        frame * Quaternion::from_axis_angle(&Vector3::x_axis(), fibre.twist * middle)
    });
    Ok(along.collect())
}

/// Whether positions alone tell the energy of a fibre.
fn check_twist_free(fibre: &Fibre, segments: &[Segment]) -> Result<(), FibreError> {
    let straight = |q: &Quaternion| (tangent(q) - Vector3::x()).norm() < 1e-9;
    let curved = segments
        .iter()
        .any(|s| !(straight(&s.start_frame) && straight(&s.end_frame)));
    let material = &fibre.material;
    let reason = if curved {
        "is not straight without load"
    } else if fibre.twist != 0.0 {
        "is twisted without load"
    } else if material.bending_ratio != 1.0 {
        "bends more easily one way"
    } else if material.shear {
        "gives way to shear"
    } else {
        return Ok(());
    };
    Err(FibreError::TwistFree {
        fibre: fibre.id,
        reason,
    })
}

/// The rotation about the tangent that brings the second axis of the first segment's frame to the section's.
pub(crate) fn section_roll(fibre: &Fibre, first: &Quaternion) -> Result<Quaternion, FibreError> {
    if fibre.material.bending_ratio == 1.0 {
        return Ok(Quaternion::identity());
    }
    roll_to_axis(fibre, first)
}

/// Turn about the tangent that brings the y axis of a frame into the plane of the section axis.
pub(crate) fn roll_to_axis(fibre: &Fibre, first: &Quaternion) -> Result<Quaternion, FibreError> {
    let axis = first.inverse() * fibre.section_axis;
    let across = axis.y.hypot(axis.z).partial_cmp(&(1e-6 * axis.norm()));
    if across != Some(std::cmp::Ordering::Greater) {
        return Err(FibreError::SectionAxis {
            fibre: fibre.id,
            axis: fibre.section_axis,
        });
    }
    let angle = axis.z.atan2(axis.y);
    Ok(Quaternion::from_axis_angle(&Vector3::x_axis(), angle))
}

/// Radii in the middle of the segments.
fn radii(fibre: &Fibre, lengths: &[f64]) -> Result<Vec<f64>, FibreError> {
    let taper = fibre.taper;
    if !(taper > 0.0 && taper.is_finite()) {
        return Err(FibreError::Material {
            fibre: fibre.id,
            quantity: "taper",
            value: taper,
            requirement: "positive and finite",
        });
    }
    let whole: f64 = lengths.iter().sum();
    let mut start = 0.0;
    let along = lengths.iter().map(|length| {
        let middle = (start + 0.5 * length) / whole;
        start += length;
        fibre.material.radius * (2.0 + 2.0 * (taper - 1.0) * middle) / (1.0 + taper)
    });
    Ok(along.collect())
}

pub(crate) fn chord_lengths(nodes: &[Vector3]) -> Vec<f64> {
    nodes.windows(2).map(|w| (w[1] - w[0]).norm()).collect()
}

/// Twist-free frames of the segments: x along the chord, each turned from the one before by the smallest rotation.
pub(crate) fn segment_frames(
    fibre: u64,
    nodes: &[Vector3],
    shape: &'static str,
) -> Result<Vec<Quaternion>, FibreError> {
    let mut frame = Quaternion::identity();
    let mut frames = Vec::with_capacity(nodes.len() - 1);
    for (segment, pair) in nodes.windows(2).enumerate() {
        let degenerate = || FibreError::DegenerateShape {
            fibre,
            segment,
            shape,
        };
        let span = pair[1] - pair[0];
        let length = span.norm();
        if !(length > 0.0 && length.is_finite()) {
            return Err(degenerate());
        }
        let direction = span / length;
        // The first segment may point along −x, where the smallest rotation from x is not unique.
        if segment == 0 && direction.x < 0.0 {
            frame = Quaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::PI);
        }
        let turn = smallest_rotation(&(frame * Vector3::x()), &direction).ok_or_else(degenerate)?;
        frame = turn * frame;
        frames.push(frame);
    }
    Ok(frames)
}

/// The smallest rotation between unit vectors; none when they are opposite. Accurate for small angles too.
fn smallest_rotation(from: &Vector3, to: &Vector3) -> Option<Quaternion> {
    let cosine = from.dot(to);
    let axis = from.cross(to);
    (cosine > -1.0 + 1e-9)
        .then(|| Quaternion::from_quaternion(nalgebra::Quaternion::from_parts(1.0 + cosine, axis)))
}

/// Node frames half-way between the frames of the adjacent segments.
fn node_frames(segments: &[Quaternion]) -> Vec<Quaternion> {
    let first = segments[0];
    let last = segments[segments.len() - 1];
    std::iter::once(first)
        .chain(segments.windows(2).map(|w| {
            let turn = w[0].inverse() * w[1];
            w[0] * Quaternion::from_scaled_axis(turn.scaled_axis() * 0.5)
        }))
        .chain(std::iter::once(last))
        .collect()
}
