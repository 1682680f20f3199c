//! The mesh of a case, distributed, with its dual geometry.

use crate::case::{self, Case, Document, MeshSource};
use crate::error::{ProgramError, agree};
use crate::output::manifest::{CHECKSUM_START, checksum};
use fibreflow_mesh::{
    BoxElement, BoxMesh, DualGeometry, LocalMesh, Mesh, MeshError, PeriodicPatches, PipeMesh,
    Stretching, foam, vtk,
};
use fibreflow_parallel::Communicator;
use std::path::Path;
use std::sync::Arc;

/// A rank's mesh.
#[derive(Debug)]
pub struct SceneMesh {
    /// Nodes, elements, halo.
    pub local: Arc<LocalMesh>,
    /// Median-dual geometry.
    pub geometry: Arc<DualGeometry>,
    /// Over node coordinates and elements of the whole mesh, whatever the ranks.
    pub checksum: u64,
}

impl SceneMesh {
    /// Mean node spacing \[m\].
    pub fn spacing(&self) -> f64 {
        (self.geometry.total_volume / self.local.total_nodes as f64).cbrt()
    }
}

/// Builds or reads, checks, renumbers and distributes the mesh; None for a case without one. Collective.
///
/// # Errors
/// What is wrong with the mesh, or patches that do not fit the boundary conditions.
pub fn build(
    case: &Case,
    document: &Document,
    folder: &Path,
    communicator: &Communicator,
) -> Result<Option<SceneMesh>, ProgramError> {
    let Some(source) = &case.mesh else {
        return Ok(None);
    };
    let mut sum = 0;
    let fourth = case.fluid.as_ref().is_some_and(|fluid| fluid.order == 4);
    let layers = if fourth { 3 } else { 1 };
    let local = fibreflow_mesh::distribute_layers(communicator, layers, || {
        let mesh = whole(source, folder)?;
        sum = mesh_checksum(&mesh);
        Ok(mesh)
    });
    let named = |error: MeshError| match (source.file(), &error) {
        // Reading already names the file.
        (Some(file), e) if !matches!(e, MeshError::Read { .. }) => {
            ProgramError::input(format!("{}: {e}", folder.join(file).display()))
        }
        _ => ProgramError::from(error),
    };
    let local = agree(communicator, local.map_err(named))?;
    let sum = communicator.broadcast(0, sum.to_le_bytes().to_vec());
    let checked = case::validate_patches(case, document, &local.patches);
    agree(communicator, checked.map_err(ProgramError::from))?;
    let geometry = if fourth {
        fibreflow_mesh::geometry::fourth(&local)
    } else {
        fibreflow_mesh::geometry::dual(&local)
    };
    let geometry = agree(communicator, geometry.map_err(order_named))?;
    Ok(Some(SceneMesh {
        local: Arc::new(local),
        geometry: Arc::new(geometry),
        checksum: sum.try_into().map_or(0, u64::from_le_bytes),
    }))
}

/// Names the key that asked for what the mesh does not allow.
fn order_named(error: MeshError) -> ProgramError {
    match error {
        MeshError::NotTensorProduct => ProgramError::input(format!("`fluid.order = 4`: {error}")),
        _ => ProgramError::from(error),
    }
}

/// The whole mesh, on one rank.
fn whole(source: &MeshSource, folder: &Path) -> Result<Mesh, MeshError> {
    let mut mesh = match source {
        MeshSource::Gmsh { file } => fibreflow_mesh::gmsh::read(&folder.join(file))?,
        MeshSource::Vtk {
            file,
            array,
            patches,
            periodic,
        } => {
            let pair = |pair: &case::PeriodicPair| PeriodicPatches {
                patches: pair.patches.clone(),
                translation: pair.translation,
            };
            let options = vtk::Options {
                array: array.clone(),
                names: patches.clone(),
                periodic: periodic.iter().map(pair).collect(),
            };
            vtk::read(&folder.join(file), &options)?
        }
        MeshSource::OpenFoam { folder: of_mesh } => foam::read(&folder.join(of_mesh))?,
        MeshSource::Pipe {
            origin,
            radius,
            length,
            cells,
            core,
            layers,
            core_radius,
            roundness,
            stretching,
            periodic,
        } => PipeMesh {
            origin: *origin,
            radius: *radius,
            length: *length,
            cells: *cells,
            core: *core,
            layers: *layers,
            core_radius: *core_radius,
            roundness: *roundness,
            stretching: spacing(*stretching),
            periodic: *periodic,
        }
        .build()?,
        MeshSource::Box {
            origin,
            size,
            cells,
            element,
            stretching,
            periodic,
            jitter,
            seed,
        } => BoxMesh {
            origin: *origin,
            size: *size,
            cells: *cells,
            stretching: stretching.map(spacing),
            periodic: *periodic,
            element: element_of(*element),
            jitter: *jitter,
            seed: *seed,
        }
        .build()?,
    };
    fibreflow_mesh::validate(&mesh)?;
    fibreflow_mesh::renumber(&mut mesh)?;
    Ok(mesh)
}

fn spacing(stretching: case::Stretching) -> Stretching {
    match stretching {
        case::Stretching::Uniform => Stretching::Uniform,
        case::Stretching::Tanh(beta) => Stretching::Tanh(beta),
        case::Stretching::Geometric(ratio) => Stretching::Geometric(ratio),
    }
}

fn element_of(element: case::BoxElement) -> BoxElement {
    match element {
        case::BoxElement::Hexahedron => BoxElement::Hexahedron,
        case::BoxElement::Prism => BoxElement::Prism,
        case::BoxElement::Tetrahedron => BoxElement::Tetrahedron,
        case::BoxElement::PyramidHexahedron => BoxElement::PyramidHexahedron,
        case::BoxElement::Mixed => BoxElement::Mixed,
    }
}

fn mesh_checksum(mesh: &Mesh) -> u64 {
    let sum = checksum(CHECKSUM_START, bytemuck::cast_slice(&mesh.nodes));
    checksum(sum, bytemuck::cast_slice(&mesh.elements.nodes))
}
