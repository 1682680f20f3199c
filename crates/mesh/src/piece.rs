//! One rank's part of a mesh, as it travels from rank 0.

use crate::pack::{Unpack, put};
use crate::{BoundaryFace, ElementKind, Elements, Image, LocalMesh, Periods};
use fibreflow_parallel::{Communicator, Halo};

/// A [`LocalMesh`] before its halo is connected.
#[derive(Clone, Debug, Default)]
pub(crate) struct Piece {
    pub nodes: Vec<[f64; 3]>,
    pub global_nodes: Vec<u64>,
    /// (rank, local index there) of the nodes after the owned ones.
    pub halo_owners: Vec<[u32; 2]>,
    pub elements: Elements,
    pub global_elements: Vec<u64>,
    pub owned_elements: Vec<bool>,
    pub boundary: Vec<BoundaryFace>,
    pub patches: Vec<String>,
    pub periods: Periods,
    pub total_nodes: usize,
    pub total_elements: usize,
}

impl Piece {
    /// As bytes; the inverse of [`Piece::unpack`].
    pub fn pack(&self) -> Vec<u8> {
        let mut bytes = Vec::new();
        put(&mut bytes, &[self.total_nodes, self.total_elements]);
        put(&mut bytes, &self.periods.vectors);
        put(&mut bytes, &self.nodes);
        put(&mut bytes, &self.global_nodes);
        put(&mut bytes, &self.halo_owners);
        let kinds: Vec<u8> = self.elements.kinds.iter().map(|&k| k as u8).collect();
        put(&mut bytes, &kinds);
        put(&mut bytes, &self.elements.nodes);
        put(&mut bytes, &codes(&self.elements.images));
        put(&mut bytes, &self.global_elements);
        let owned: Vec<u8> = self.owned_elements.iter().map(|&o| u8::from(o)).collect();
        put(&mut bytes, &owned);
        let faces = &self.boundary;
        let shapes: Vec<[u16; 2]> = faces.iter().map(|f| [f.patch, f.vertices.into()]).collect();
        put(&mut bytes, &shapes);
        let corners: Vec<[u32; 4]> = faces.iter().map(|f| f.nodes).collect();
        put(&mut bytes, &corners);
        let images: Vec<[u8; 4]> = faces.iter().map(|f| f.images.map(Image::code)).collect();
        put(&mut bytes, &images);
        put(&mut bytes, self.patches.join("\n").as_bytes());
        bytes
    }

    /// From the bytes of [`Piece::pack`].
    pub fn unpack(bytes: &[u8]) -> Self {
        let mut from = Unpack(bytes);
        let totals: Vec<usize> = from.take();
        let vectors: Vec<[f64; 3]> = from.take();
        let nodes = from.take();
        let global_nodes = from.take();
        let halo_owners = from.take();
        let kinds: Vec<u8> = from.take();
        let elements = elements(&kinds, from.take(), &from.take::<u8>());
        let global_elements = from.take();
        let owned_elements = from.take::<u8>().into_iter().map(|o| o == 1).collect();
        let shapes: Vec<[u16; 2]> = from.take();
        let corners: Vec<[u32; 4]> = from.take();
        let images: Vec<[u8; 4]> = from.take();
        let faces = shapes.iter().zip(corners).zip(images);
        let boundary = faces
            .map(|((&[patch, vertices], nodes), images)| BoundaryFace {
                patch,
                vertices: vertices as u8,
                nodes,
                images: images.map(image),
            })
            .collect();
        let names = String::from_utf8_lossy(&from.take::<u8>()).into_owned();
        Self {
            nodes,
            global_nodes,
            halo_owners,
            elements,
            global_elements,
            owned_elements,
            boundary,
            patches: names.lines().map(str::to_owned).collect(),
            periods: Periods {
                vectors: [vectors[0], vectors[1], vectors[2]],
            },
            total_nodes: totals[0],
            total_elements: totals[1],
        }
    }

    /// Connects the halo. Collective.
    pub fn into_local(self, communicator: &Communicator) -> LocalMesh {
        let owned = self.nodes.len() - self.halo_owners.len();
        let owners: Vec<(u32, u32)> = self.halo_owners.iter().map(|&[r, i]| (r, i)).collect();
        LocalMesh {
            nodes: self.nodes,
            global_nodes: self.global_nodes,
            elements: self.elements,
            global_elements: self.global_elements,
            owned_elements: self.owned_elements,
            boundary: self.boundary,
            patches: self.patches,
            periods: self.periods,
            halo: Halo::new(communicator, owned, &owners),
            total_nodes: self.total_nodes,
            total_elements: self.total_elements,
        }
    }
}

fn elements(kinds: &[u8], nodes: Vec<u32>, images: &[u8]) -> Elements {
    let kinds: Vec<ElementKind> = kinds
        .iter()
        .map(|&k| ElementKind::ALL[k as usize])
        .collect();
    let ends = kinds.iter().scan(0, |end, kind| {
        *end += kind.vertices() as u32;
        Some(*end)
    });
    Elements {
        offsets: std::iter::once(0).chain(ends).collect(),
        nodes,
        images: images.iter().map(|&code| image(code)).collect(),
        kinds,
    }
}

fn codes(images: &[Image]) -> Vec<u8> {
    images.iter().map(|i| i.code()).collect()
}

fn image(code: u8) -> Image {
    Image::from_code(code).unwrap_or(Image::ZERO)
}
