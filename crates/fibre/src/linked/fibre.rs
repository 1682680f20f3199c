//! One linked fibre before it joins the system.

use crate::shape::{
    SEGMENT_BITS, chord_lengths, roll_to_axis, section_roll, segment_frames, twisted,
};
use crate::{Equilibrium, Fibre, FibreError, FibreSystem, Quaternion, Vector3};

/// What a joint lets its two segments do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Joint {
    /// Bend in any direction and twist, against torques.
    #[default]
    Ball,
    /// Bend in the plane of tangent and [`Fibre::section_axis`] alone, and twist (S 2.39–2.41).
    Pin,
}

/// A chain of equal rigid segments. Frames map body axes to space; the body x axis is the segment's axis.
#[derive(Clone, Debug, PartialEq)]
pub struct LinkedFibre {
    /// Global id, unique.
    pub id: u64,
    /// Radius b of the segments \[m\].
    pub radius: f64,
    /// Half-length ℓ of a segment, without its caps \[m\].
    pub half_length: f64,
    /// Mean of the segments' centres \[m\], unwrapped.
    pub centre: Vector3,
    /// Frames of the segments.
    pub frames: Vec<Quaternion>,
    /// Frame of each segment without load, by that of the segment before; that of the first has no meaning.
    pub equilibrium: Vec<Quaternion>,
    /// Torque of a joint by angle of bending about the body's y and z axes \[N·m\].
    pub bending: [f64; 2],
    /// Torque of a joint by angle of twist \[N·m\].
    pub twisting: f64,
    /// What the joints let through.
    pub joint: Joint,
    /// Weight less buoyancy of a segment \[N\].
    pub weight: Vector3,
}

/// Lengths of the segments of one fibre may differ by this.
const UNEQUAL: f64 = 1e-6;

impl LinkedFibre {
    /// The fibre that a beam describes, with a joint in each inner node. A joint is as stiff as the beam over one segment: EI/2ℓ,
    /// GJ/2ℓ (S app. B). Weight is left out.
    ///
    /// # Errors
    /// A shape or material that cannot be used, segments of unequal length, supports, a taper.
    pub fn new(beam: &Fibre, joint: Joint) -> Result<Self, FibreError> {
        let fibre = beam.id;
        let refuse = |reason| Err(FibreError::Linked { fibre, reason });
        if beam.nodes.len() < 2 {
            let nodes = beam.nodes.len();
            return Err(FibreError::TooFewNodes { fibre, nodes });
        }
        beam.material.check(fibre)?;
        if !beam.supports.is_empty() {
            return refuse("is held; only free fibres can be linked");
        }
        if beam.taper != 1.0 {
            return refuse("has a taper; segments of a linked fibre are equal");
        }
        let lengths = chord_lengths(&beam.nodes);
        let segments = lengths.len() as f64;
        let length = lengths.iter().sum::<f64>() / segments;
        if lengths.iter().any(|l| (l / length - 1.0).abs() > UNEQUAL) {
            return refuse("has segments of unequal length");
        }
        let (frames, rest) = frames(beam, &lengths, joint)?;
        let m = &beam.material;
        let stiffness = m.bending_stiffness() / length;
        let torsion = 2.0 * m.shear_modulus * m.second_moment() / length;
        let along = |k: usize| (frames[k] * Vector3::x()) * length;
        let mut centre = Vector3::zeros();
        for k in 0..frames.len() {
            centre += along(k) * (segments - k as f64 - 0.5);
        }
        Ok(Self {
            id: fibre,
            radius: m.radius,
            half_length: 0.5 * length,
            centre: beam.nodes[0] + centre / segments,
            equilibrium: relative(&rest),
            frames,
            bending: [1.0, m.bending_ratio]
                .map(|share| stiffness * 2.0 * share / (1.0 + m.bending_ratio)),
            twisting: torsion,
            joint,
            weight: Vector3::zeros(),
        })
    }

    /// The same fibre with the body axes of another one that has its shape without load: frames and equilibrium are those of `shape`, turned
    /// as a whole to where this fibre is. For fibres that are placed in that shape.
    pub fn with_axes_of(mut self, shape: &Self) -> Self {
        let axes = |frames: &[Quaternion]| {
            let along = |k: usize| frames[k] * Vector3::x();
            let first = along(0);
            let bend = (1..frames.len()).map(|k| first.cross(&along(k)));
            let bend = bend.max_by(|a, b| a.norm_squared().total_cmp(&b.norm_squared()));
            bend.filter(|b| b.norm() > 1e-9).map(|bend| {
                let up = bend.normalize();
                let matrix = nalgebra::Matrix3::from_columns(&[first, up.cross(&first), up]);
                Quaternion::from_matrix(&matrix)
            })
        };
        if let (Some(here), Some(there)) = (axes(&self.frames), axes(&shape.frames)) {
            let turn = here * there.inverse();
            self.frames = shape.frames.iter().map(|frame| turn * frame).collect();
            self.equilibrium.clone_from(&shape.equilibrium);
        }
        self
    }

    pub(super) fn check(&self) -> Result<(), FibreError> {
        let fibre = self.id;
        let segments = self.frames.len();
        if segments == 0 || self.equilibrium.len() != segments {
            let reason = "needs a frame and one without load for each segment";
            return Err(FibreError::Linked { fibre, reason });
        }
        if segments > 1 << SEGMENT_BITS {
            let limit = 1 << SEGMENT_BITS;
            return Err(FibreError::TooManySegments {
                fibre,
                segments,
                limit,
            });
        }
        if fibre >= FibreSystem::ID_LIMIT {
            let limit = FibreSystem::ID_LIMIT;
            return Err(FibreError::IdTooLarge { fibre, limit });
        }
        let [y, z] = self.bending;
        for (quantity, value, least) in [
            ("radius", self.radius, f64::MIN_POSITIVE),
            ("half-length", self.half_length, f64::MIN_POSITIVE),
            ("bending stiffness of joints", y.min(z), 0.0),
            ("twisting stiffness of joints", self.twisting, 0.0),
        ] {
            if !(value >= least && value.is_finite()) {
                return Err(FibreError::Material {
                    fibre,
                    quantity,
                    value,
                    requirement: "positive and finite",
                });
            }
        }
        Ok(())
    }
}

/// Each frame by the one before; the first one as it is.
fn relative(frames: &[Quaternion]) -> Vec<Quaternion> {
    let before = std::iter::once(Quaternion::identity()).chain(frames.iter().copied());
    let pairs = before.zip(frames);
    pairs
        .map(|(before, frame)| before.inverse() * frame)
        .collect()
}

/// Placed frames and those without load.
fn frames(
    beam: &Fibre,
    lengths: &[f64],
    joint: Joint,
) -> Result<(Vec<Quaternion>, Vec<Quaternion>), FibreError> {
    let placed = segment_frames(beam.id, &beam.nodes, "placed")?;
    let rest = match &beam.equilibrium {
        Equilibrium::Placed => placed.clone(),
        Equilibrium::Straight => vec![Quaternion::identity(); placed.len()],
        Equilibrium::Shape(shape) if shape.len() == beam.nodes.len() => {
            segment_frames(beam.id, shape, "equilibrium")?
        }
        Equilibrium::Shape(shape) => {
            return Err(FibreError::EquilibriumSize {
                fibre: beam.id,
                nodes: beam.nodes.len(),
                equilibrium: shape.len(),
            });
        }
    };
    let first = match beam.equilibrium {
        Equilibrium::Straight => placed[0],
        Equilibrium::Placed | Equilibrium::Shape(_) => rest[0],
    };
    let roll = match joint {
        Joint::Ball => section_roll(beam, &first)?,
        Joint::Pin => roll_to_axis(beam, &first)?,
    };
    let rolled = |frames: Vec<Quaternion>| frames.into_iter().map(|f| f * roll).collect();
    let rest: Vec<Quaternion> = rolled(twisted(beam, rest, lengths)?);
    let placed = match beam.equilibrium {
        Equilibrium::Placed => rest.clone(),
        Equilibrium::Straight | Equilibrium::Shape(_) => rolled(placed),
    };
    Ok((placed, rest))
}
