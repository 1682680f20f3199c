//! Who holds what: nodes as the mesh is partitioned ↔ whole planes ↔ all planes of some modes.

use super::banded::LANES;
use fibreflow_parallel::{Communicator, Halo};
use std::ops::Range;

type Messages = Vec<(usize, Vec<f64>)>;

/// Share of `rank` of 0..count.
fn share(count: usize, rank: usize, size: usize) -> Range<usize> {
    count * rank / size..count * (rank + 1) / size
}

/// Planes and mode blocks of every rank.
#[derive(Clone, Debug)]
pub(super) struct Shares {
    communicator: Communicator,
    /// Planes of the last direction, by rank.
    pub planes: Vec<Range<usize>>,
    /// Blocks of [`LANES`] modes, by rank.
    pub blocks: Vec<Range<usize>>,
}

impl Shares {
    pub fn new(communicator: &Communicator, planes: usize, blocks: usize) -> Self {
        let size = communicator.size();
        let of = |count| (0..size).map(|r| share(count, r, size)).collect();
        Self {
            communicator: communicator.clone(),
            planes: of(planes),
            blocks: of(blocks),
        }
    }

    pub fn rank(&self) -> usize {
        self.communicator.rank()
    }

    /// Planes of this rank.
    pub fn own_planes(&self) -> Range<usize> {
        self.planes[self.rank()].clone()
    }

    /// Mode blocks of this rank.
    pub fn own_blocks(&self) -> Range<usize> {
        self.blocks[self.rank()].clone()
    }

    /// A message of `parts` values a mode and plane from or to every other rank: its blocks of our planes, or our
    /// blocks of its planes.
    fn messages(&self, parts: usize, length: impl Fn(usize) -> usize) -> Messages {
        (0..self.planes.len())
            .filter(|&r| r != self.rank() && length(r) > 0)
            .map(|r| (r, vec![0.0; length(r) * parts * LANES]))
            .collect()
    }
}

/// Messages of the transposition between planes and modes.
#[derive(Clone, Debug)]
pub(super) struct Transposition {
    parts: usize,
    /// Blocks of other ranks for our planes: (block, plane, part, lane).
    pub theirs: Messages,
    /// Our blocks for the planes of others.
    ours: Messages,
}

impl Transposition {
    pub fn new(shares: &Shares, parts: usize) -> Self {
        let (planes, blocks) = (shares.own_planes().len(), shares.own_blocks().len());
        Self {
            parts,
            theirs: shares.messages(parts, |r| shares.blocks[r].len() * planes),
            ours: shares.messages(parts, |r| shares.planes[r].len() * blocks),
        }
    }

    /// Brings the planes of other ranks into `modes`: (own block, plane, part, lane). Collective.
    pub fn bring_to_modes(&mut self, shares: &Shares, planes: usize, modes: &mut [f64]) {
        if shares.planes.len() == 1 {
            return;
        }
        let communicator = &shares.communicator;
        communicator.exchange_known(&self.theirs, &mut self.ours, || ());
        for (rank, message) in &self.ours {
            let range = self.range(shares, *rank);
            let blocks = modes.chunks_exact_mut(planes * self.parts * LANES);
            for (block, part) in blocks.zip(message.chunks_exact(range.len())) {
                block[range.clone()].copy_from_slice(part);
            }
        }
    }

    /// The way back. Collective.
    pub fn bring_to_planes(&mut self, shares: &Shares, planes: usize, modes: &[f64]) {
        if shares.planes.len() == 1 {
            return;
        }
        let (mut ours, parts) = (std::mem::take(&mut self.ours), self.parts);
        for (rank, message) in &mut ours {
            let range = self.range(shares, *rank);
            let blocks = modes.chunks_exact(planes * parts * LANES);
            for (block, part) in blocks.zip(message.chunks_exact_mut(range.len())) {
                part.copy_from_slice(&block[range.clone()]);
            }
        }
        let communicator = &shares.communicator;
        communicator.exchange_known(&ours, &mut self.theirs, || ());
        self.ours = ours;
    }

    fn range(&self, shares: &Shares, rank: usize) -> Range<usize> {
        let planes = &shares.planes[rank];
        let each = self.parts * LANES;
        planes.start * each..planes.end * each
    }
}

/// Which owned nodes lie in the planes of which rank.
#[derive(Clone, Debug)]
pub(super) struct Slabs {
    /// Local nodes for every other rank, in the order in which they are sent.
    send: Vec<(usize, Vec<u32>)>,
    /// Places in the slab of what every other rank sends.
    receive: Vec<(usize, Vec<u32>)>,
    /// Local nodes of our own planes and their places.
    own: Vec<[u32; 2]>,
}

/// Messages between nodes and slabs, of a given number of components.
#[derive(Clone, Debug)]
pub(super) struct SlabRoom {
    /// Values in our planes, (plane, row, column, component).
    pub values: Vec<f64>,
    to_slabs: Messages,
    from_nodes: Messages,
}

impl Slabs {
    /// `place(i)`: plane of the last direction (None for a fixed end) and place in that plane of owned node i; a plane
    /// has `area` nodes. Collective.
    pub fn new(
        halo: &Halo,
        shares: &Shares,
        area: usize,
        place: impl Fn(usize) -> Option<(usize, usize)>,
    ) -> Self {
        let communicator = halo.communicator();
        let (size, rank) = (communicator.size(), communicator.rank());
        let mut send = vec![Vec::new(); size];
        let mut places = vec![Vec::new(); size];
        for i in 0..halo.owned() {
            if let Some((plane, at)) = place(i) {
                let owner = shares.planes.partition_point(|p| p.end <= plane);
                let local = plane - shares.planes[owner].start;
                send[owner].push(i as u32);
                places[owner].push((local * area + at) as u32);
            }
        }
        let own_nodes = std::mem::take(&mut send[rank]);
        let own_places = std::mem::take(&mut places[rank]);
        let receive = communicator.exchange(places);
        let some = |lists: Vec<Vec<u32>>| -> Vec<(usize, Vec<u32>)> {
            let lists = lists.into_iter().enumerate();
            lists.filter(|(_, list)| !list.is_empty()).collect()
        };
        Self {
            send: some(send),
            receive: some(receive),
            own: own_nodes
                .into_iter()
                .zip(own_places)
                .map(|(i, p)| [i, p])
                .collect(),
        }
    }

    /// Room for fields of `components` values a node in planes of `area` nodes.
    pub fn room(&self, shares: &Shares, area: usize, components: usize) -> SlabRoom {
        let messages = |lists: &[(usize, Vec<u32>)]| -> Messages {
            let of = |(r, list): &(usize, Vec<u32>)| (*r, vec![0.0; list.len() * components]);
            lists.iter().map(of).collect()
        };
        SlabRoom {
            values: vec![0.0; shares.own_planes().len() * area * components],
            to_slabs: messages(&self.send),
            from_nodes: messages(&self.receive),
        }
    }

    /// Node values (`width` a node, the first `components` of them count) into the slabs. Collective.
    pub fn gather(
        &self,
        shares: &Shares,
        room: &mut SlabRoom,
        field: &[f64],
        [width, components]: [usize; 2],
    ) {
        let SlabRoom {
            values,
            to_slabs,
            from_nodes,
        } = room;
        for ((_, message), (_, nodes)) in to_slabs.iter_mut().zip(&self.send) {
            for (to, &i) in message.chunks_exact_mut(components).zip(nodes) {
                to.copy_from_slice(&field[i as usize * width..][..components]);
            }
        }
        let own = || {
            for &[i, place] in &self.own {
                let (i, place) = (i as usize * width, place as usize * components);
                values[place..place + components].copy_from_slice(&field[i..i + components]);
            }
        };
        shares
            .communicator
            .exchange_known(to_slabs, from_nodes, own);
        for ((_, message), (_, places)) in from_nodes.iter().zip(&self.receive) {
            for (from, &place) in message.chunks_exact(components).zip(places) {
                values[place as usize * components..][..components].copy_from_slice(from);
            }
        }
    }

    /// The way back. Collective.
    pub fn scatter(
        &self,
        shares: &Shares,
        room: &mut SlabRoom,
        field: &mut [f64],
        [width, components]: [usize; 2],
    ) {
        let SlabRoom {
            values,
            to_slabs,
            from_nodes,
        } = room;
        for ((_, message), (_, places)) in from_nodes.iter_mut().zip(&self.receive) {
            for (to, &place) in message.chunks_exact_mut(components).zip(places) {
                to.copy_from_slice(&values[place as usize * components..][..components]);
            }
        }
        let own = || {
            for &[i, place] in &self.own {
                let (i, place) = (i as usize * width, place as usize * components);
                field[i..i + components].copy_from_slice(&values[place..place + components]);
            }
        };
        shares
            .communicator
            .exchange_known(from_nodes, to_slabs, own);
        for ((_, message), (_, nodes)) in to_slabs.iter().zip(&self.send) {
            for (from, &i) in message.chunks_exact(components).zip(nodes) {
                field[i as usize * width..][..components].copy_from_slice(from);
            }
        }
    }
}
