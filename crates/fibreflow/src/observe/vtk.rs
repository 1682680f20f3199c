//! VTK files of fluid and fibres, a piece a rank.

use crate::clock::Clock;
use crate::error::{ProgramError, agree};
use crate::output::grid::Grid;
use crate::output::vtk::{Array, Collection, Piece, Topology};
use crate::scene::Scene;
use fibreflow_coupling::Beads;
use fibreflow_fibre::FibreSystem;
use fibreflow_fibre::linked::LinkedSystem;
use fibreflow_fluid::{Fluid, PhaseField};
use fibreflow_mesh::Periods;
use fibreflow_parallel::Communicator;
use std::path::{Path, PathBuf};

/// Writer of `fluid/…`, `fluid.pvd`, `fibres/…`, `fibres.pvd`, `beads/…`, `beads.pvd`.
pub struct VtkOutput {
    folder: PathBuf,
    grid: Option<Grid>,
    vortices: bool,
    periods: Periods,
    fluid: Collection,
    fibres: Collection,
    beads: Collection,
}

impl VtkOutput {
    /// A new output, with vorticity where `vortices`, or one that goes on after `resume` \[s\].
    ///
    /// # Errors
    /// Folders that cannot be made.
    pub fn new(
        folder: &Path,
        scene: &Scene,
        vortices: bool,
        resume: Option<f64>,
    ) -> Result<Self, ProgramError> {
        let fluid = scene.flow.fluid();
        let collection = |name: &str| match resume {
            Some(time) => Collection::resume(&folder.join(name), time),
            None => Collection::default(),
        };
        Ok(Self {
            folder: folder.to_owned(),
            grid: fluid.map(|f| Grid::new(f.mesh())),
            vortices,
            periods: scene.periods,
            fluid: collection("fluid.pvd"),
            fibres: collection("fibres.pvd"),
            beads: collection("beads.pvd"),
        })
    }

    /// One data set of each. Collective.
    ///
    /// # Errors
    /// Files that cannot be written.
    pub fn write(&mut self, scene: &Scene, clock: &Clock) -> Result<(), ProgramError> {
        let (folder, communicator) = (self.folder.clone(), &scene.communicator);
        if let (Some(fluid), Some(grid)) = (scene.flow.fluid(), &self.grid) {
            let phase = scene.flow.phase().map(|phase| &phase.field);
            let piece = fluid_piece(grid, fluid, phase, self.vortices);
            let set = DataSet {
                folder: &folder,
                name: "fluid",
                extension: "vtu",
                communicator,
            };
            set.write(&piece, clock, &mut self.fluid)?;
        }
        let beams = scene.fibres.as_ref().map(|f| fibre_piece(f, &self.periods));
        let linked = scene
            .linked
            .as_ref()
            .map(|l| linked_piece(l, &self.periods));
        if let Some(piece) = beams.or(linked) {
            let set = DataSet {
                folder: &folder,
                name: "fibres",
                extension: "vtp",
                communicator,
            };
            set.write(&piece, clock, &mut self.fibres)?;
        }
        if let Some(beads) = scene.flow.beads() {
            let piece = bead_piece(beads, communicator.is_root());
            let set = DataSet {
                folder: &folder,
                name: "beads",
                extension: "vtp",
                communicator,
            };
            set.write(&piece, clock, &mut self.beads)?;
        }
        Ok(())
    }
}

struct DataSet<'a> {
    folder: &'a Path,
    name: &'a str,
    extension: &'a str,
    communicator: &'a Communicator,
}

impl DataSet<'_> {
    /// Every rank its piece, then rank 0 the index and the collection.
    fn write(
        &self,
        piece: &Piece,
        clock: &Clock,
        collection: &mut Collection,
    ) -> Result<(), ProgramError> {
        let stem = |rank: usize| {
            format!(
                "{}_{:08}_{rank:04}.{}",
                self.name, clock.step, self.extension
            )
        };
        let path = self
            .folder
            .join(self.name)
            .join(stem(self.communicator.rank()));
        let written = piece
            .write(&path)
            .map_err(|e| ProgramError::output(&path, &e));
        agree(self.communicator, written)?;
        let points = self.communicator.all_gather(&[piece.points.len() as u64]);
        let result = if self.communicator.is_root() {
            let filled = points
                .iter()
                .enumerate()
                .filter(|(rank, n)| n[0] > 0 || *rank == 0);
            let sources: Vec<String> = filled.map(|(rank, _)| stem(rank)).collect();
            self.index(piece, sources, clock, collection)
        } else {
            Ok(())
        };
        agree(self.communicator, result)
    }

    /// The pieces of a fluid are joined by a `.pvtu`; those of fibres, for which pyvista reads no such file, are parts
    /// of the collection.
    fn index(
        &self,
        piece: &Piece,
        sources: Vec<String>,
        clock: &Clock,
        collection: &mut Collection,
    ) -> Result<(), ProgramError> {
        let name = self.name;
        let files = if self.extension == "vtu" {
            let file = format!("{name}/{name}_{:08}.pvtu", clock.step);
            let path = self.folder.join(&file);
            let written = piece.write_index(&path, &sources);
            written.map_err(|e| ProgramError::output(&path, &e))?;
            vec![file]
        } else {
            sources.iter().map(|s| format!("{name}/{s}")).collect()
        };
        let path = self.folder.join(format!("{name}.pvd"));
        let added = collection.add(&path, clock.time, files);
        added.map_err(|e| ProgramError::output(&path, &e))
    }
}

/// Velocity \[m/s\], pressure \[Pa\], body force \[N/m³\]; vorticity \[1/s\] and Q \[1/s²\] where `vortices`; eddy viscosity
/// \[m²/s\] where there is a model; ψ, φ and the mechanical pressure \[Pa\] of two fluids.
fn fluid_piece(grid: &Grid, fluid: &Fluid, phase: Option<&PhaseField>, vortices: bool) -> Piece {
    let density = fluid.settings().density;
    let mut pressure = fluid.pressure_everywhere();
    pressure.iter_mut().for_each(|p| *p *= density);
    let mut force = fluid.body_force().to_vec();
    fluid.mesh().halo.update(&mut force);
    let mut arrays = vec![
        grid.vector("velocity", fluid.velocity()),
        grid.scalar("pressure", &pressure),
        grid.vector("body_force", &force),
    ];
    if vortices {
        let mut values = fluid.vortices_of(fluid.velocity());
        values.resize(fluid.mesh().total(), [0.0; 4]);
        fluid.mesh().halo.update(&mut values);
        let q: Vec<f64> = values.iter().map(|v| v[3]).collect();
        arrays.push(grid.vector("vorticity", &values));
        arrays.push(grid.scalar("q_criterion", &q));
    }
    if let Some(mut viscosity) = fluid.eddy_viscosity() {
        viscosity.resize(fluid.mesh().total(), 0.0);
        fluid.mesh().halo.update(&mut viscosity);
        arrays.push(grid.scalar("eddy_viscosity", &viscosity));
    }
    if let Some(field) = phase {
        let mut mechanical = field.capillary_pressure(fluid);
        mechanical.resize(fluid.mesh().total(), 0.0);
        fluid.mesh().halo.update(&mut mechanical);
        let sums = mechanical.iter_mut().zip(&pressure);
        sums.for_each(|(sum, p)| *sum += p);
        let solid: Vec<f64> = field.solid().iter().map(|solid| solid[0]).collect();
        arrays.push(grid.scalar("order_parameter", field.order_parameter()));
        arrays.push(grid.scalar("mechanical_pressure", &mechanical));
        arrays.push(grid.scalar("solid_fraction", &solid));
    }
    grid.piece(arrays)
}

/// One polyline a fibre, shifted as a whole so that its middle lies in the first period.
fn fibre_piece(fibres: &FibreSystem, periods: &Periods) -> Piece {
    let nodes = fibres.positions().len();
    let mut points = Vec::with_capacity(nodes);
    let mut radius = Vec::with_capacity(nodes);
    let mut curvature = Vec::with_capacity(nodes);
    let mut inner = Vec::new();
    for fibre in 0..fibres.fibres() {
        let range = fibres.offsets()[fibre]..fibres.offsets()[fibre + 1];
        let shift = home_shift(fibres.centre(fibre).into(), periods);
        for x in &fibres.positions()[range] {
            points.push(std::array::from_fn(|c| x[c] - shift[c]));
        }
        // A node shows the segment behind it, the first one that ahead.
        radius.extend(fibres.radii(fibre).take(1).chain(fibres.radii(fibre)));
        fibres.curvature(fibre, &mut inner);
        let bend = |k: usize| inner.get(k).map_or(0.0, |v| v.norm());
        // The ends have no curvature of their own: they show their neighbour's.
        curvature.push(bend(0));
        curvature.extend((0..inner.len()).map(bend));
        curvature.push(bend(inner.len().saturating_sub(1)));
    }
    let offsets = fibres.offsets().iter().skip(1).map(|&o| o as i64).collect();
    let ids = (0..fibres.fibres()).map(|f| fibres.id(f) as i64).collect();
    Piece {
        points,
        topology: Topology::Lines {
            connectivity: (0..nodes as i64).collect(),
            offsets,
        },
        point_data: vec![
            Array::scalar("radius", radius),
            Array::vector(
                "velocity",
                fibres.velocities().iter().map(|v| [v.x, v.y, v.z]),
            ),
            Array::scalar("curvature", curvature),
        ],
        cell_data: vec![Array::integer("fibre", ids)],
    }
}

/// One polyline a fibre through ends and joints, shifted as a whole so that its middle lies in the first period. Joint forces
/// act on the segment before the node; the curvature of a joint is the angle of its segments by their length, ends show their neighbour's.
fn linked_piece(fibres: &LinkedSystem, periods: &Periods) -> Piece {
    let mut points = Vec::with_capacity(fibres.nodes().len());
    let (mut radius, mut forces) = (Vec::new(), Vec::new());
    let (mut velocity, mut curvature) = (Vec::new(), Vec::new());
    let (mut offsets, mut ids) = (Vec::new(), Vec::new());
    for fibre in 0..fibres.fibres() {
        let segments = fibres.offsets()[fibre]..fibres.offsets()[fibre + 1];
        let shift = home_shift(fibres.centre(fibre).into(), periods);
        let nodes = &fibres.nodes()[segments.start + fibre..=segments.end + fibre];
        for x in nodes {
            points.push(std::array::from_fn(|c| x[c] - shift[c]));
        }
        let half = |k: usize| (nodes[k + 1] - nodes[k]) * 0.5;
        for (k, segment) in segments.clone().enumerate() {
            let [v, spin] = fibres.motion(segment);
            velocity.push(<[f64; 3]>::from(v - spin.cross(&half(k))));
            if segment + 1 == segments.end {
                velocity.push((v + spin.cross(&half(k))).into());
            }
        }
        let last = nodes.len() - 1;
        curvature.extend((0..=last).map(|k| match k.clamp(1, last.max(2) - 1) {
            joint if joint < last => {
                let (a, b) = (half(joint - 1), half(joint));
                a.angle(&b) / (a.norm() + b.norm())
            }
            _ => 0.0,
        }));
        radius.resize(points.len(), fibres.radius(fibre));
        forces.extend(segments.map(|s| <[f64; 3]>::from(fibres.joint_force(s))));
        forces.push([0.0; 3]);
        offsets.push(points.len() as i64);
        ids.push(fibres.id(fibre) as i64);
    }
    Piece {
        topology: Topology::Lines {
            connectivity: (0..points.len() as i64).collect(),
            offsets,
        },
        points,
        point_data: vec![
            Array::scalar("radius", radius),
            Array::vector("velocity", velocity),
            Array::scalar("curvature", curvature),
            Array::vector("joint_force", forces),
        ],
        cell_data: vec![Array::integer("fibre", ids)],
    }
}

/// One polyline a chain, on the first rank.
fn bead_piece(beads: &Beads, here: bool) -> Piece {
    let shown = if here { beads.beads() } else { &[] };
    let offsets = beads.offsets().iter().skip(1).filter(|_| here);
    let radius = beads.settings().profile.radius;
    let count = offsets.clone().count() as i64;
    Piece {
        points: shown.iter().map(|b| b.position.into()).collect(),
        topology: Topology::Lines {
            connectivity: (0..shown.len() as i64).collect(),
            offsets: offsets.map(|&o| o as i64).collect(),
        },
        point_data: vec![
            Array::scalar("radius", vec![radius; shown.len()]),
            Array::vector("velocity", shown.iter().map(|b| b.velocity.into())),
            Array::vector("spin", shown.iter().map(|b| b.spin.into())),
            Array::vector("force", shown.iter().map(|b| b.force.into())),
        ],
        cell_data: vec![Array::integer("chain", (0..count).collect())],
    }
}

/// Lattice translation from the first period, measured from the origin, to where the point is.
fn home_shift(x: [f64; 3], periods: &Periods) -> [f64; 3] {
    let mut shift = [0.0; 3];
    for vector in periods.vectors {
        let square: f64 = vector.iter().map(|v| v * v).sum();
        if square > 0.0 {
            let along: f64 = (0..3).map(|c| x[c] * vector[c]).sum();
            let count = (along / square).floor();
            (0..3).for_each(|c| shift[c] += count * vector[c]);
        }
    }
    shift
}
