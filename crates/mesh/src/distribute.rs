//! Cuts a mesh that rank 0 holds into one piece a rank.

use crate::blocks::{self, Blocks};
use crate::graph::NodeGraph;
use crate::piece::Piece;
use crate::{BoundaryFace, LocalMesh, Mesh, MeshError, validate};
use fibreflow_parallel::{Communicator, Graph, partition};

/// Gives every rank its part of the mesh that rank 0 holds; other ranks pass None. Collective.
///
/// Rank 0 partitions the graph of nodes and sends one piece after another; afterwards no rank holds an array of the
/// length of the whole mesh. With one rank the numbering of the mesh is kept as it is.
///
/// # Errors
/// [`MeshError::Empty`] when rank 0 passes None; otherwise as [`distribute_from`].
pub fn distribute(communicator: &Communicator, mesh: Option<Mesh>) -> Result<LocalMesh, MeshError> {
    distribute_from(communicator, || mesh.ok_or(MeshError::Empty))
}

/// As [`distribute`], with the mesh built or read by `build` on rank 0 only. Collective.
///
/// # Errors
/// As [`distribute_layers`].
pub fn distribute_from(
    communicator: &Communicator,
    build: impl FnOnce() -> Result<Mesh, MeshError>,
) -> Result<LocalMesh, MeshError> {
    distribute_layers(communicator, 1, build)
}

/// As [`distribute_from`], with `layers` of halo nodes along the axes of a mesh that is a tensor product and numbered
/// line by line (see [`crate::renumber`]): fourth order needs three. Collective.
///
/// Such a mesh is cut into blocks that keep complete lines along the fastest direction. Halo nodes beyond the first
/// layer carry no elements. Other meshes get one layer.
///
/// # Errors
/// What `build` or the partitioner reports, [`MeshError::Index`] for indices out of range, [`MeshError::Size`] for
/// more ranks than the nodes suffice for. Rank 0 gets the error itself and the others [`MeshError::OnRoot`].
pub fn distribute_layers(
    communicator: &Communicator,
    layers: usize,
    build: impl FnOnce() -> Result<Mesh, MeshError>,
) -> Result<LocalMesh, MeshError> {
    let plan = communicator
        .is_root()
        .then(|| build().and_then(|mesh| Plan::new(mesh, communicator.size(), layers)));
    let piece = match agree(communicator, plan)? {
        Some(mut plan) => {
            for rank in 1..communicator.size() {
                communicator.send(rank, &plan.piece(rank).pack());
            }
            plan.piece(0)
        }
        None => Piece::unpack(&communicator.receive(0)),
    };
    Ok(piece.into_local(communicator))
}

/// The outcome of rank 0 on every rank, so that all go on or none.
fn agree<T>(
    communicator: &Communicator,
    outcome: Option<Result<T, MeshError>>,
) -> Result<Option<T>, MeshError> {
    let message = match &outcome {
        Some(Err(error)) => error.to_string(),
        _ => String::new(),
    };
    let message = communicator.broadcast(0, message.into_bytes());
    match outcome {
        Some(outcome) => outcome.map(Some),
        None if message.is_empty() => Ok(None),
        None => Err(MeshError::OnRoot(
            String::from_utf8_lossy(&message).into_owned(),
        )),
    }
}

/// The whole mesh with its partition, on rank 0 while pieces are cut.
struct Plan {
    mesh: Mesh,
    /// Owner of every node.
    part: Vec<u32>,
    /// Local index of every node on its owner.
    position: Vec<u32>,
    /// Set for a tensor-product mesh, with the layers of halo nodes beyond those of elements.
    blocks: Option<(Blocks, usize)>,
    nodes: Buckets,
    elements: Buckets,
    faces: Buckets,
    /// Local index of every node on the rank whose piece is being cut, [`ABSENT`] elsewhere.
    local: Vec<u32>,
}

const ABSENT: u32 = u32::MAX;

impl Plan {
    fn new(mut mesh: Mesh, ranks: usize, layers: usize) -> Result<Self, MeshError> {
        validate::indices(&mesh)?;
        let blocks = (ranks > 1)
            .then(|| Blocks::new(&blocks::grid(&mut mesh)?, ranks))
            .flatten();
        let part = match &blocks {
            Some(blocks) => blocks.owners(),
            None => node_parts(&mesh, ranks)?,
        };
        let nodes = Buckets::new(ranks, part.len(), |i, ranks| ranks.push(part[i]));
        if (0..ranks).any(|rank| nodes.of(rank).is_empty()) {
            return Err(MeshError::Size(format!(
                "{} nodes are too few for {ranks} ranks: use fewer ranks or a finer mesh",
                part.len()
            )));
        }
        let mut position = vec![0; part.len()];
        for rank in 0..ranks {
            for (k, &node) in nodes.of(rank).iter().enumerate() {
                position[node as usize] = k as u32;
            }
        }
        let touched = |nodes: &[u32], ranks: &mut Vec<u32>| {
            ranks.extend(nodes.iter().map(|&n| part[n as usize]));
            ranks.sort_unstable();
            ranks.dedup();
        };
        let elements = Buckets::new(ranks, mesh.elements.len(), |e, ranks| {
            touched(mesh.elements.nodes(e), ranks);
        });
        let faces = Buckets::new(ranks, mesh.boundary.len(), |f, ranks| {
            touched(corners(&mesh.boundary[f]), ranks);
        });
        Ok(Self {
            local: vec![ABSENT; part.len()],
            mesh,
            part,
            position,
            blocks: blocks.map(|blocks| (blocks, layers)),
            nodes,
            elements,
            faces,
        })
    }

    /// What `rank` gets.
    fn piece(&mut self, rank: usize) -> Piece {
        let globals = self.local_nodes(rank);
        let owned = self.nodes.of(rank).len();
        for (k, &node) in globals.iter().enumerate() {
            self.local[node as usize] = k as u32;
        }
        let mesh = &self.mesh;
        let local = |node: u32| self.local[node as usize];
        let mut piece = Piece {
            nodes: globals.iter().map(|&n| mesh.nodes[n as usize]).collect(),
            global_nodes: globals.iter().map(|&n| n.into()).collect(),
            halo_owners: globals[owned..]
                .iter()
                .map(|&n| [self.part[n as usize], self.position[n as usize]])
                .collect(),
            patches: mesh.patches.clone(),
            periods: mesh.periods,
            total_nodes: mesh.nodes.len(),
            total_elements: mesh.elements.len(),
            ..Piece::default()
        };
        piece.elements.offsets.push(0);
        for &e in self.elements.of(rank) {
            let nodes = mesh.elements.nodes(e as usize);
            let mut vertices = [0; 8];
            vertices
                .iter_mut()
                .zip(nodes)
                .for_each(|(v, &n)| *v = local(n));
            piece.elements.push(
                mesh.elements.kinds[e as usize],
                &vertices[..nodes.len()],
                mesh.elements.images(e as usize),
            );
            piece.global_elements.push(e.into());
            let owner = self.part[nodes[0] as usize];
            piece.owned_elements.push(owner as usize == rank);
        }
        for &f in self.faces.of(rank) {
            let mut face = mesh.boundary[f as usize];
            let vertices = face.vertices as usize;
            face.nodes[..vertices]
                .iter_mut()
                .for_each(|n| *n = local(*n));
            piece.boundary.push(face);
        }
        for &node in &globals {
            self.local[node as usize] = ABSENT;
        }
        piece
    }

    /// Owned nodes ascending, then the other nodes of their elements, faces and further layers by (owner, node).
    fn local_nodes(&self, rank: usize) -> Vec<u32> {
        let of_elements = self.elements.of(rank).iter();
        let of_faces = self.faces.of(rank).iter();
        let owned = self.nodes.of(rank);
        let of_blocks = self.blocks.iter();
        let of_layers = of_blocks.flat_map(|(blocks, layers)| blocks.reached(owned, *layers));
        let mut halo: Vec<u32> = of_elements
            .flat_map(|&e| self.mesh.elements.nodes(e as usize))
            .chain(of_faces.flat_map(|&f| corners(&self.mesh.boundary[f as usize])))
            .copied()
            .chain(of_layers)
            .filter(|&n| self.part[n as usize] as usize != rank)
            .collect();
        halo.sort_unstable_by_key(|&n| (self.part[n as usize], n));
        halo.dedup();
        let mut nodes = owned.to_vec();
        nodes.append(&mut halo);
        nodes
    }
}

fn corners(face: &BoundaryFace) -> &[u32] {
    &face.nodes[..face.vertices as usize]
}

fn node_parts(mesh: &Mesh, ranks: usize) -> Result<Vec<u32>, MeshError> {
    if ranks == 1 {
        return Ok(vec![0; mesh.nodes.len()]);
    }
    let graph = NodeGraph::new(&mesh.elements, mesh.nodes.len());
    let costs = graph.cutting_costs(mesh);
    let graph = Graph {
        weights: &costs,
        offsets: &graph.offsets,
        columns: &graph.columns,
        coordinates: &mesh.nodes,
    };
    partition(&graph, ranks).map_err(|error| MeshError::Partition(error.to_string()))
}

/// Items of every rank in compressed rows, ascending; an item may belong to several ranks.
struct Buckets {
    offsets: Vec<usize>,
    items: Vec<u32>,
}

impl Buckets {
    /// `ranks_of(item, ranks)` pushes the ranks of an item.
    fn new(ranks: usize, items: usize, ranks_of: impl Fn(usize, &mut Vec<u32>)) -> Self {
        let mut of_item = Vec::new();
        let mut offsets = vec![0; ranks + 1];
        let mut visit = |put: &mut dyn FnMut(u32, u32)| {
            for item in 0..items {
                of_item.clear();
                ranks_of(item, &mut of_item);
                of_item.iter().for_each(|&rank| put(item as u32, rank));
            }
        };
        visit(&mut |_, rank| offsets[rank as usize + 1] += 1);
        (0..ranks).for_each(|rank| offsets[rank + 1] += offsets[rank]);
        let mut next = offsets.clone();
        let mut sorted = vec![0; offsets[ranks]];
        visit(&mut |item, rank| {
            sorted[next[rank as usize]] = item;
            next[rank as usize] += 1;
        });
        Self {
            offsets,
            items: sorted,
        }
    }

    fn of(&self, rank: usize) -> &[u32] {
        &self.items[self.offsets[rank]..self.offsets[rank + 1]]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ElementKind, Image};

    /// A row of `n` unit cubes along x, periodic in y (one thick), patch "left" at x = 0.
    fn bar(n: usize) -> Mesh {
        let mut mesh = Mesh {
            patches: vec!["left".into(), "a name with spaces".into()],
            ..Mesh::default()
        };
        mesh.periods.vectors[1] = [0.0, 1.0, 0.0];
        for i in 0..=n {
            for k in 0..2 {
                mesh.nodes.push([i as f64, 0.0, f64::from(k)]);
            }
        }
        let (o, y) = (Image::ZERO, Image::new([0, 1, 0]));
        for i in 0..n as u32 {
            let (a, b) = (2 * i, 2 * i + 2);
            let nodes = [a, b, b, a, a + 1, b + 1, b + 1, a + 1];
            let images = [o, o, y, y, o, o, y, y];
            mesh.elements.push(ElementKind::Hexahedron, &nodes, &images);
        }
        mesh.boundary.push(BoundaryFace {
            patch: 0,
            vertices: 4,
            nodes: [0, 1, 1, 0],
            images: [o, o, y, y],
        });
        mesh
    }

    #[test]
    fn one_rank_keeps_the_mesh() {
        let mesh = bar(5);
        let local = distribute(&Communicator::single(), Some(mesh.clone())).expect("mesh");
        assert_eq!(local.nodes, mesh.nodes);
        assert_eq!(local.elements.nodes, mesh.elements.nodes);
        assert_eq!(local.elements.images, mesh.elements.images);
        assert_eq!(local.boundary, mesh.boundary);
        assert_eq!((local.owned(), local.total()), (12, 12));
        assert!(local.owned_elements.iter().all(|&o| o));
    }

    #[test]
    fn pieces_cover_the_mesh_once_and_survive_the_journey() {
        let mesh = bar(16);
        let mut plan = Plan::new(mesh.clone(), 3, 1).expect("plan");
        let mut node_owners = vec![0; mesh.nodes.len()];
        let mut element_owners = vec![0; mesh.elements.len()];
        for rank in 0..3 {
            let cut = plan.piece(rank);
            let piece = Piece::unpack(&cut.pack());
            assert_eq!(piece.nodes, cut.nodes);
            assert_eq!(piece.boundary, cut.boundary);
            assert_eq!(piece.patches, mesh.patches);
            assert_eq!(piece.periods, mesh.periods);
            let owned = piece.nodes.len() - piece.halo_owners.len();
            assert!(piece.global_nodes[..owned].is_sorted());
            assert!(piece.global_elements.is_sorted());
            for &node in &piece.global_nodes[..owned] {
                node_owners[node as usize] += 1;
            }
            for (k, &e) in piece.global_elements.iter().enumerate() {
                element_owners[e as usize] += usize::from(piece.owned_elements[k]);
                let of_piece = piece.elements.nodes(k).iter();
                let global: Vec<u32> = of_piece
                    .map(|&n| piece.global_nodes[n as usize] as u32)
                    .collect();
                assert_eq!(global, mesh.elements.nodes(e as usize));
                assert_eq!(piece.elements.images(k), mesh.elements.images(e as usize));
                assert!(
                    piece
                        .elements
                        .nodes(k)
                        .iter()
                        .any(|&n| (n as usize) < owned)
                );
            }
            for (&[rank, index], &node) in
                piece.halo_owners.iter().zip(&piece.global_nodes[owned..])
            {
                assert_eq!(
                    u64::from(plan.nodes.of(rank as usize)[index as usize]),
                    node
                );
            }
        }
        assert!(node_owners.iter().all(|&n| n == 1));
        assert!(element_owners.iter().all(|&n| n == 1));
    }

    #[test]
    fn errors_say_what_is_wrong() {
        let single = Communicator::single();
        assert_eq!(distribute(&single, None).err(), Some(MeshError::Empty));
        assert!(matches!(
            Plan::new(bar(1), 5, 1).err(),
            Some(MeshError::Size(_))
        ));
        let mut mesh = bar(2);
        mesh.elements.nodes[3] = 77;
        assert!(matches!(
            distribute(&single, Some(mesh)),
            Err(MeshError::Index { value: 77, .. })
        ));
    }
}
