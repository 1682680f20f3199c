//! The flow at chosen points: a series for single points, tables for lines, images for planes and boxes.

use crate::case::{Case, SamplePoints, Samples as About, Schedule};
use crate::clock::Clock;
use crate::error::{ProgramError, agree};
use crate::output::image::{Extent, Image};
use crate::output::replace_file;
use crate::output::series::Series;
use crate::output::vtk::{Array, Collection};
use crate::scene::Scene;
use fibreflow_coupling::{PointSet, PointValue, Probes};
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// All sets of points of a run.
pub struct SampleOutput {
    folder: PathBuf,
    sets: Vec<Set>,
}

struct Set {
    name: String,
    schedule: Schedule,
    points: PointSet,
    probes: Probes,
    form: Form,
}

/// What is written; files of rank 0 only where they are single.
enum Form {
    Series(Option<Series>),
    Table,
    Image(Image, Collection),
}

const VALUES: [&str; 8] = [
    "velocity_x",
    "velocity_y",
    "velocity_z",
    "pressure",
    "vorticity_x",
    "vorticity_y",
    "vorticity_z",
    "q_criterion",
];

fn values(value: &PointValue, density: f64) -> [f64; 8] {
    let [u, v, w] = value.velocity;
    let [x, y, z] = value.vorticity();
    [
        u,
        v,
        w,
        density * value.pressure,
        x,
        y,
        z,
        value.q_criterion(),
    ]
}

impl SampleOutput {
    /// Finds the points on the mesh; a resumed run keeps what was written before. Collective.
    ///
    /// # Errors
    /// Files that cannot be written.
    pub fn open(
        case: &Case,
        folder: &Path,
        scene: &Scene,
        resumed: Option<&Clock>,
    ) -> Result<Option<Self>, ProgramError> {
        let about = &case.output.samples;
        let (Some(fluid), false) = (scene.flow.fluid(), about.is_empty()) else {
            return Ok(None);
        };
        let points: Vec<PointSet> = about.iter().map(|s| point_set(&s.at)).collect();
        let probes = Probes::new(fluid.mesh(), fluid.volume(), &points);
        let root = scene.communicator.is_root();
        let made = std::fs::create_dir_all(folder.join("samples"));
        agree(
            &scene.communicator,
            made.map_err(|e| ProgramError::output(&folder.join("samples"), &e)),
        )?;
        let mut sets = Vec::new();
        for ((about, points), probes) in about.iter().zip(points).zip(probes) {
            let form = form(about, &points, folder, root, resumed);
            sets.push(Set {
                name: about.name.clone(),
                schedule: about.schedule(&case.output.series),
                points,
                probes,
                form: agree(&scene.communicator, form)?,
            });
        }
        Ok(Some(Self {
            folder: folder.to_owned(),
            sets,
        }))
    }

    /// Names of sets with points outside the mesh, and how many.
    pub fn outside(&self) -> impl Iterator<Item = (&str, usize)> {
        let counts = self
            .sets
            .iter()
            .map(|s| (s.name.as_str(), s.probes.outside()));
        counts.filter(|(_, count)| *count > 0)
    }

    /// Writes the sets that are due, or all at the start of a run. Collective.
    ///
    /// # Errors
    /// Files that cannot be written.
    pub fn write(&mut self, scene: &Scene, clock: &Clock) -> Result<(), ProgramError> {
        let Some(fluid) = scene.flow.fluid() else {
            return Ok(());
        };
        let density = fluid.settings().density;
        let due = |set: &&mut Set| clock.step == 0 || clock.is_due(&set.schedule);
        let mut pressure = None;
        for set in self.sets.iter_mut().filter(due) {
            let pressure = pressure.get_or_insert_with(|| fluid.pressure_everywhere());
            let sampled = set.probes.sample(fluid.velocity(), pressure);
            let written = set.write(&sampled, density, scene, clock, &self.folder);
            agree(&scene.communicator, written)?;
        }
        Ok(())
    }

    /// Hands everything to the system.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn flush(&mut self) -> Result<(), ProgramError> {
        for set in &mut self.sets {
            if let Form::Series(Some(series)) = &mut set.form {
                series.flush().map_err(ProgramError::series)?;
            }
        }
        Ok(())
    }
}

impl Set {
    /// Files of this rank.
    fn write(
        &mut self,
        sampled: &[PointValue],
        density: f64,
        scene: &Scene,
        clock: &Clock,
        folder: &Path,
    ) -> Result<(), ProgramError> {
        let root = scene.communicator.is_root();
        match &mut self.form {
            Form::Series(series) => {
                let line: Vec<f64> = sampled.iter().flat_map(|v| values(v, density)).collect();
                let write = |s: &mut Series| s.line(clock.step, clock.time, &line);
                series
                    .as_mut()
                    .map_or(Ok(()), write)
                    .map_err(ProgramError::series)
            }
            Form::Table if root => {
                let path = folder.join(format!("samples/{}_{:08}.csv", self.name, clock.step));
                let text = table(&self.points, sampled, density);
                replace_file(&path, text.as_bytes()).map_err(|e| ProgramError::output(&path, &e))
            }
            Form::Table => Ok(()),
            Form::Image(image, collection) => {
                let stem = format!("{}_{:08}", self.name, clock.step);
                let slab = |rank: usize| format!("{stem}_{rank:04}.vti");
                let arrays = arrays(sampled, density);
                let layers = self.probes.layers();
                let mine = &layers[scene.communicator.rank()];
                if !mine.is_empty() {
                    let path = folder.join("samples").join(slab(scene.communicator.rank()));
                    let written = image.write(&path, extent(image, mine), &arrays);
                    written.map_err(|e| ProgramError::output(&path, &e))?;
                }
                if !root {
                    return Ok(());
                }
                let filled = layers.iter().enumerate().filter(|(_, l)| !l.is_empty());
                let slabs: Vec<(Extent, String)> = filled
                    .map(|(rank, l)| (extent(image, l), slab(rank)))
                    .collect();
                let path = folder.join(format!("samples/{stem}.pvti"));
                let written = image.write_index(&path, &slabs, &arrays);
                written.map_err(|e| ProgramError::output(&path, &e))?;
                let path = folder.join(format!("samples/{}.pvd", self.name));
                let added = collection.add(&path, clock.time, vec![format!("{stem}.pvti")]);
                added.map_err(|e| ProgramError::output(&path, &e))
            }
        }
    }
}

fn point_set(at: &SamplePoints) -> PointSet {
    match at {
        SamplePoints::Points { points } => PointSet::List(points.clone()),
        SamplePoints::Line { start, end, count } => {
            let point = |k: usize| {
                let s = k as f64 / (count - 1) as f64;
                std::array::from_fn(|c| start[c] + s * (end[c] - start[c]))
            };
            PointSet::List((0..*count).map(point).collect())
        }
        SamplePoints::Plane {
            normal,
            position,
            low,
            high,
            counts,
        } => {
            let across = *normal as usize;
            let other = |c: usize| c - usize::from(c > across);
            let pick = |values: &[f64; 2], c: usize| {
                if c == across {
                    *position
                } else {
                    values[other(c)]
                }
            };
            grid(
                std::array::from_fn(|c| pick(low, c)),
                std::array::from_fn(|c| pick(high, c)),
                std::array::from_fn(|c| if c == across { 1 } else { counts[other(c)] }),
            )
        }
        SamplePoints::Box { low, high, counts } => grid(*low, *high, *counts),
    }
}

fn grid(low: [f64; 3], high: [f64; 3], counts: [usize; 3]) -> PointSet {
    let spacing = |c: usize| {
        if counts[c] > 1 {
            (high[c] - low[c]) / (counts[c] - 1) as f64
        } else {
            1.0
        }
    };
    PointSet::Grid {
        origin: low,
        spacing: std::array::from_fn(spacing),
        counts,
    }
}

fn form(
    about: &About,
    points: &PointSet,
    folder: &Path,
    root: bool,
    resumed: Option<&Clock>,
) -> Result<Form, ProgramError> {
    match (&about.at, points) {
        (SamplePoints::Points { points }, _) => {
            let each = (0..points.len()).flat_map(|k| VALUES.map(|v| format!("p{k}_{v}")));
            let columns: Vec<String> = each.collect();
            let columns: Vec<&str> = columns.iter().map(String::as_str).collect();
            let path = folder.join(format!("series/{}.csv", about.name));
            let series = root.then(|| Series::open(&path, &columns, resumed.map(|c| c.step)));
            let series = series.transpose();
            Ok(Form::Series(
                series.map_err(|e| ProgramError::output(&path, &e))?,
            ))
        }
        (_, PointSet::List(_)) => Ok(Form::Table),
        (
            _,
            &PointSet::Grid {
                origin,
                spacing,
                counts,
            },
        ) => {
            let path = folder.join(format!("samples/{}.pvd", about.name));
            let resume = |clock: &Clock| Collection::resume(&path, clock.time);
            let image = Image {
                origin,
                spacing,
                counts,
            };
            Ok(Form::Image(image, resumed.map(resume).unwrap_or_default()))
        }
    }
}

/// A line a point: coordinates, then values.
fn table(points: &PointSet, sampled: &[PointValue], density: f64) -> String {
    let mut text = format!("x,y,z,{}\n", VALUES.join(","));
    let PointSet::List(points) = points else {
        return text;
    };
    for (point, value) in points.iter().zip(sampled) {
        let _ = write!(text, "{:?},{:?},{:?}", point[0], point[1], point[2]);
        for value in values(value, density) {
            let _ = write!(text, ",{value:?}");
        }
        text.push('\n');
    }
    text
}

fn arrays(sampled: &[PointValue], density: f64) -> Vec<Array> {
    let scalar = |f: &dyn Fn(&PointValue) -> f64| sampled.iter().map(f).collect();
    vec![
        Array::vector("velocity", sampled.iter().map(|v| v.velocity)),
        Array::scalar("pressure", scalar(&|v| density * v.pressure)),
        Array::vector("vorticity", sampled.iter().map(PointValue::vorticity)),
        Array::scalar("q_criterion", scalar(&PointValue::q_criterion)),
    ]
}

/// Points of some layers across the last direction with more than one point.
fn extent(image: &Image, layers: &std::ops::Range<usize>) -> Extent {
    let last = (0..3).rev().find(|&c| image.counts[c] > 1).unwrap_or(0);
    std::array::from_fn(|c| {
        if c == last {
            [layers.start, layers.end - 1]
        } else {
            [0, image.counts[c] - 1]
        }
    })
}
