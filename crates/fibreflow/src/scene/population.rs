//! Where the fibres of a case are, and the quantities that differ from fibre to fibre.

use super::csv::Csv;
use super::framed::{self, Framed};
use super::polyline;
use crate::case::{
    self, Case, CaseError, Document, FibreGroup, Form, Placement, Shape, Shortfall, Spread,
};
use fibreflow_fibre::PeriodicBox;
use fibreflow_fibre::hydrodynamics::cox_aspect_ratio;
use fibreflow_fibre::placement::{
    Amount, CentreLine, HeldFibre, Orbits, Orientation, Placed, PlacementGroup, Population,
    Quantity, Region, place,
};
use nalgebra::{Matrix3, Vector3};
use std::path::Path;

type Made<T> = Result<T, Box<CaseError>>;
type Nodes = Vec<Vector3<f64>>;

/// What came of a group of random fibres.
#[derive(Clone, Copy, Debug)]
pub struct PlacementReport {
    /// Index of the group in the case.
    pub group: usize,
    /// Fibres placed and wanted.
    pub fibres: [usize; 2],
    /// Volume fraction of the region reached.
    pub volume_fraction: f64,
    /// Largest difference of an entry of ⟨pp⟩ from its target.
    pub orientation_error: f64,
}

/// Reads and places what a case says of its fibres.
pub struct Populate<'a> {
    pub case: &'a Case,
    pub document: &'a Document,
    /// Folder of the case file.
    pub folder: &'a Path,
    pub periodic: PeriodicBox,
}

impl Populate<'_> {
    /// Nodes of the fibres of every group, and what came of the random ones.
    ///
    /// # Errors
    /// Settings that cannot be met, files that cannot be read.
    pub fn place(&self, lines: &[CentreLine]) -> Made<(Vec<Vec<Nodes>>, Vec<PlacementReport>)> {
        let groups = self.case.fibres.iter().enumerate();
        let nodes = groups.map(|(k, group)| self.given(k, group));
        let mut nodes = nodes.collect::<Made<Vec<Vec<Nodes>>>>()?;
        let held = nodes.iter().zip(&self.case.fibres);
        let held = held.flat_map(|(fibres, group)| {
            let one = |nodes: &Nodes| HeldFibre {
                nodes: nodes.clone(),
                radius: 0.5 * group.diameter,
            };
            fibres.iter().map(one)
        });
        let mut population = Population {
            periodic: self.periodic,
            groups: Vec::new(),
            held: held.collect(),
        };
        let mut random = Vec::new();
        for (k, group) in self.case.fibres.iter().enumerate() {
            if let Some(settings) = self.settings(k, group, &lines[k])? {
                let path = format!("fibres[{k}].placement");
                let checked = settings.check();
                checked.map_err(|e| self.document.error(&path, format!("`{path}`: {e}")))?;
                population.groups.push(settings);
                random.push(k);
            }
        }
        if random.is_empty() {
            return Ok((nodes, Vec::new()));
        }
        let placed = place(&population).map_err(|e| {
            self.document
                .error(&format!("fibres[{}].placement", random[0]), e.to_string())
        })?;
        let mut reports = Vec::new();
        for (k, placed) in random.into_iter().zip(placed) {
            reports.push(self.report(k, &placed)?);
            nodes[k] = placed.fibres.into_iter().map(|f| f.nodes).collect();
        }
        Ok((nodes, reports))
    }

    /// The shapes without load of all groups; straight where they are as placed.
    ///
    /// # Errors
    /// A file that cannot be read, a shape that no fibre can have.
    pub fn centre_lines(&self) -> Made<Vec<CentreLine>> {
        let groups = self.case.fibres.iter().enumerate();
        groups
            .map(|(k, group)| self.centre_line(k, group))
            .collect()
    }

    fn centre_line(&self, k: usize, group: &FibreGroup) -> Made<CentreLine> {
        let path = format!("fibres[{k}].shape");
        let line = match &group.shape {
            Shape::Straight | Shape::AsPlaced => CentreLine::Straight,
            Shape::U { opening_angle } => CentreLine::U {
                opening_angle: *opening_angle,
            },
            Shape::Helix { radius, pitch } => CentreLine::Helix {
                radius: *radius,
                pitch: *pitch,
            },
            Shape::Chain { bend, turn } => CentreLine::Chain {
                bend: *bend,
                turn: *turn,
            },
            Shape::File { file } => {
                let path = format!("{path}.file");
                match &self.polylines(file, &path)?[..] {
                    [line] => CentreLine::Nodes(line.clone()),
                    lines => {
                        let message =
                            format!("`{path}`: {} lines where one is wanted", lines.len());
                        return Err(self.document.value_error(&path, message));
                    }
                }
            }
        };
        let checked = line.check();
        checked.map_err(|e| self.document.error(&path, format!("`{path}`: {e}")))?;
        Ok(line)
    }

    /// Nodes of the fibres that a case gives one by one.
    fn given(&self, k: usize, group: &FibreGroup) -> Made<Vec<Nodes>> {
        Ok(match &group.placement {
            Placement::Line { start, end } => {
                let segments = group.segments.unwrap_or(1);
                let (a, b) = (Vector3::from(*start), Vector3::from(*end));
                let node = |k: usize| a + (b - a) * (k as f64 / segments as f64);
                vec![(0..=segments).map(node).collect()]
            }
            Placement::Nodes { positions } => {
                vec![positions.iter().map(|x| Vector3::from(*x)).collect()]
            }
            Placement::File { file } => {
                self.polylines(file, &format!("fibres[{k}].placement.file"))?
            }
            Placement::Frames { file } => self
                .frames(k, file)?
                .iter()
                .map(|fibre| fibre.nodes(group))
                .collect(),
            Placement::Random { .. } => Vec::new(),
        })
    }

    /// Linked fibres of a file.
    pub fn frames(&self, k: usize, file: &str) -> Made<Vec<Framed>> {
        framed::read(&self.folder.join(file)).map_err(|problem| {
            let path = format!("fibres[{k}].placement.file");
            let message = format!("`{path} = \"{file}\"`: {problem}");
            let error = self.document.value_error(&path, message);
            error.with_help("a CSV file with the columns fibre,x,y,z,q0,q1,q2,q3")
        })
    }

    /// Polylines of a file.
    fn polylines(&self, file: &str, path: &str) -> Made<Vec<Nodes>> {
        polyline::read(&self.folder.join(file)).map_err(|problem| {
            let message = format!("`{path} = \"{file}\"`: {problem}");
            let error = self.document.value_error(path, message);
            error.with_help(
                "a CSV file with the columns x,y,z [m] and, for several fibres, fibre; or lines of VTK PolyData (.vtp) as ParaView writes it, or pyvista with `binary=False`",
            )
        })
    }

    /// Young's modulus of `count` fibres of a group \[Pa\].
    ///
    /// # Errors
    /// A distribution that cannot be used.
    pub fn moduli(&self, k: usize, count: usize) -> Made<Vec<f64>> {
        let group = &self.case.fibres[k];
        let path = format!("fibres[{k}].youngs_modulus");
        let quantity = self.quantity(&group.youngs_modulus, &path)?;
        let seed = match group.placement {
            Placement::Random { seed, .. } => seed,
            _ => 0,
        };
        Ok(quantity.draw(count, seed, k as u64))
    }

    /// How a random group is placed; None for fibres that are given.
    fn settings(
        &self,
        k: usize,
        group: &FibreGroup,
        line: &CentreLine,
    ) -> Made<Option<PlacementGroup>> {
        let Placement::Random {
            count,
            volume_fraction,
            seed,
            orientation,
            region,
            gap,
            form,
            ..
        } = &group.placement
        else {
            return Ok(None);
        };
        let path = |key: &str| format!("fibres[{k}].{key}");
        let (Some(length), Some(region)) = (&group.length, self.region(region.as_ref())) else {
            let message = "random placement needs a length and a region";
            return Err(self.document.error(&path("placement"), message));
        };
        let length = self.quantity(length, &path("length"))?;
        if length.smallest() < group.diameter {
            let message = format!(
                "`{}`: the shortest fibres, {:.4e} m, are shorter than thick ({:.4e} m)",
                path("length"),
                length.smallest(),
                group.diameter
            );
            return Err(self.document.error(&path("length"), message));
        }
        Ok(Some(PlacementGroup {
            amount: match (count, volume_fraction) {
                (Some(count), _) => Amount::Count(*count),
                (None, fraction) => Amount::VolumeFraction(fraction.unwrap_or(0.0)),
            },
            orientation: direction(orientation, length.mean() / group.diameter),
            length,
            radius: 0.5 * group.diameter,
            centre_line: match form {
                Form::Relaxed => line.clone(),
                Form::Straight => CentreLine::Straight,
            },
            segments: group.segments.unwrap_or(1),
            region,
            gap: *gap,
            seed: *seed,
        }))
    }

    fn region(&self, given: Option<&case::Region>) -> Option<Region> {
        match given {
            Some(case::Region::Box { origin, size }) => Some(Region::Box {
                origin: (*origin).into(),
                size: (*size).into(),
            }),
            Some(case::Region::Pipe {
                start,
                axis,
                radius,
                length,
            }) => Some(Region::Pipe {
                start: (*start).into(),
                axis: *axis as usize,
                radius: *radius,
                length: *length,
            }),
            None => self.case.domain().map(|domain| Region::Box {
                origin: domain.origin.into(),
                size: domain.size.into(),
            }),
        }
    }

    fn quantity(&self, given: &case::Quantity, path: &str) -> Made<Quantity> {
        let quantity = match given {
            case::Quantity::Constant(value) => Quantity::Constant(*value),
            case::Quantity::Drawn(Spread::Normal {
                mean,
                deviation,
                min,
                max,
            }) => Quantity::Normal {
                mean: *mean,
                deviation: *deviation,
                range: [*min, *max],
            },
            case::Quantity::Drawn(Spread::Lognormal {
                mean,
                deviation,
                min,
                max,
            }) => Quantity::Lognormal {
                mean: *mean,
                deviation: *deviation,
                range: [min.unwrap_or(0.0), max.unwrap_or(f64::INFINITY)],
            },
            case::Quantity::Drawn(Spread::File { file }) => {
                let path = format!("{path}.file");
                let wrong = |problem: String| {
                    let message = format!("`{path} = \"{file}\"`: {problem}");
                    let error = self.document.value_error(&path, message);
                    error.with_help("a CSV file with the column value")
                };
                let table = Csv::read(&self.folder.join(file), &["value"]).map_err(wrong)?;
                Quantity::Values(table.column("value").unwrap_or_default())
            }
        };
        let name = path.rsplit('.').next().unwrap_or(path);
        let checked = quantity.check(if name == "length" {
            "length"
        } else {
            "stiffness"
        });
        checked.map_err(|e| self.document.value_error(path, format!("`{path}`: {e}")))?;
        Ok(quantity)
    }

    /// What came of a group; an error when fibres are missing that the case wants.
    fn report(&self, k: usize, placed: &Placed) -> Made<PlacementReport> {
        let accepts = matches!(
            self.case.fibres[k].placement,
            Placement::Random {
                shortfall: Shortfall::Accept,
                ..
            }
        );
        if let (Err(error), false) = (placed.complete(), accepts) {
            let path = format!("fibres[{k}].placement");
            let error = self.document.error(&path, format!("`{path}`: {error}"));
            return Err(error.with_help(
                "`shortfall = \"accept\"` in the placement goes on with those that were placed",
            ));
        }
        Ok(PlacementReport {
            group: k,
            fibres: [placed.fibres.len(), placed.wanted],
            volume_fraction: placed.volume_fraction[1],
            orientation_error: placed.orientation_error,
        })
    }
}

fn direction(orientation: &case::Orientation, aspect_ratio: f64) -> Orientation {
    match orientation {
        case::Orientation::Isotropic => Orientation::Isotropic,
        case::Orientation::Aligned { direction } => Orientation::Aligned((*direction).into()),
        case::Orientation::InPlane { normal } => Orientation::InPlane((*normal).into()),
        case::Orientation::Jeffery {
            aspect_ratio: given,
            flow,
            gradient,
            orbits,
        } => Orientation::Jeffery {
            aspect_ratio: given.unwrap_or_else(|| cox_aspect_ratio(aspect_ratio)),
            flow: (*flow).into(),
            gradient: (*gradient).into(),
            orbits: match orbits {
                case::Orbits::FromIsotropic => Orbits::FromIsotropic,
                case::Orbits::WeakDiffusion => Orbits::WeakDiffusion,
                case::Orbits::Constant(c) => Orbits::Constant(*c),
            },
        },
        case::Orientation::Tensor { tensor } => {
            let entry = |i: usize, j: usize| tensor[i][j];
            Orientation::Tensor(Matrix3::from_fn(entry))
        }
    }
}
