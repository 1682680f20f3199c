//! Constants of segments and nodes in lanes.

use super::{Lane, WIDTH, quaternion};
use crate::beam::Segment;
use crate::system::Model;

/// Constants of eight consecutive nodes and of the segments that start at them; zero past the end of the fibre.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub(super) struct Constants {
    pub rest_length: Lane,
    pub axial: Lane,
    pub bending: Lane,
    pub mutual: Lane,
    pub torsion: Lane,
    /// w, i, j, k.
    pub start_frame: [Lane; 4],
    pub end_frame: [Lane; 4],
    /// 1/m \[1/kg\]; 0 for a held position.
    pub mobility: Lane,
    /// 1/J⊥ \[1/(kg·m²)\]; 0 for a held frame.
    pub across: Lane,
    /// 1/J∥ − 1/J⊥; 0 for a held frame.
    pub along: Lane,
    /// 1 − J∥/J⊥; 0 for a held frame.
    pub flatness: Lane,
    /// Weight and given force \[N\].
    pub force: [Lane; 3],
    /// Given torque \[N·m\].
    pub torque: [Lane; 3],
}

impl Constants {
    const ZERO: Self = Self {
        rest_length: [0.0; WIDTH],
        axial: [0.0; WIDTH],
        bending: [0.0; WIDTH],
        mutual: [0.0; WIDTH],
        torsion: [0.0; WIDTH],
        start_frame: [[0.0; WIDTH]; 4],
        end_frame: [[0.0; WIDTH]; 4],
        mobility: [0.0; WIDTH],
        across: [0.0; WIDTH],
        along: [0.0; WIDTH],
        flatness: [0.0; WIDTH],
        force: [[0.0; WIDTH]; 3],
        torque: [[0.0; WIDTH]; 3],
    };

    #[inline(always)]
    pub fn segment(&self, lane: usize) -> Segment {
        Segment {
            rest_length: self.rest_length[lane],
            axial: self.axial[lane],
            radius: 0.0,
            bending: self.bending[lane],
            mutual: self.mutual[lane],
            flatness: 0.0,
            torsion: self.torsion[lane],
            retardation: 0.0,
            start_frame: quaternion(&self.start_frame, lane),
            end_frame: quaternion(&self.end_frame, lane),
        }
    }

    fn set_segment(&mut self, lane: usize, segment: &Segment) {
        self.rest_length[lane] = segment.rest_length;
        self.axial[lane] = segment.axial;
        self.bending[lane] = segment.bending;
        self.mutual[lane] = segment.mutual;
        self.torsion[lane] = segment.torsion;
        for (frame, q) in [
            (&mut self.start_frame, &segment.start_frame),
            (&mut self.end_frame, &segment.end_frame),
        ] {
            let parts = [q.w, q.i, q.j, q.k];
            frame.iter_mut().zip(parts).for_each(|(to, x)| to[lane] = x);
        }
    }

    fn set_node(&mut self, lane: usize, model: &Model, index: usize) {
        let (node, given) = (&model.nodes[index], &model.loads[index]);
        if !node.holds_translation {
            self.mobility[lane] = 1.0 / node.mass;
        }
        if !node.holds_rotation {
            self.across[lane] = 1.0 / node.transverse_inertia;
            self.along[lane] = 1.0 / node.axial_inertia - 1.0 / node.transverse_inertia;
            self.flatness[lane] = 1.0 - node.axial_inertia / node.transverse_inertia;
        }
        let force = given.force + node.weight;
        for axis in 0..3 {
            self.force[axis][lane] = force[axis];
            self.torque[axis][lane] = given.torque[axis];
        }
    }
}

/// The model's constants by lanes.
#[derive(Clone, Debug, Default)]
pub(crate) struct Packed {
    blocks: Vec<Constants>,
    /// First block of each fibre, and the number of blocks at the end.
    offsets: Vec<usize>,
}

impl Packed {
    pub fn new(model: &Model) -> Self {
        let mut packed = Self {
            blocks: Vec::new(),
            offsets: vec![0],
        };
        for fibre in 0..model.fibres.len() {
            let (nodes, segments) = (model.node_range(fibre), model.segment_range(fibre));
            let first = packed.blocks.len();
            let count = nodes.len().div_ceil(WIDTH);
            packed.blocks.resize(first + count, Constants::ZERO);
            let blocks = &mut packed.blocks[first..];
            for (i, segment) in model.segments[segments].iter().enumerate() {
                blocks[i / WIDTH].set_segment(i % WIDTH, segment);
            }
            for (i, index) in nodes.enumerate() {
                blocks[i / WIDTH].set_node(i % WIDTH, model, index);
            }
            packed.offsets.push(packed.blocks.len());
        }
        packed
    }

    /// Whether nothing is packed.
    pub fn is_empty(&self) -> bool {
        self.blocks.is_empty()
    }

    pub(super) fn of(&self, fibre: usize) -> &[Constants] {
        &self.blocks[self.offsets[fibre]..self.offsets[fibre + 1]]
    }
}
