//! Boundary conditions, as the case file asks for them.

use super::csv::Csv;
use super::expression::Expression;
use super::scatter::Scatter;
use crate::case::{self, Boundary, CaseError, Document, Domain, Factor, Profile};
use fibreflow_fluid::{BoundaryCondition, FluidError, Signal, TimeTable, VelocityProfile};
use std::path::Path;
use std::sync::Arc;

type Made<T> = Result<T, Box<CaseError>>;

/// The conditions of a case and what they refer to.
#[derive(Clone, Copy)]
pub struct Boundaries<'a> {
    /// The fluid of the case.
    pub fluid: &'a case::Fluid,
    /// The case file.
    pub document: &'a Document,
    /// Folder of the case file.
    pub folder: &'a Path,
    /// The box of the mesh, where it is one.
    pub domain: Option<&'a Domain>,
}

impl Boundaries<'_> {
    /// One condition for each patch, in that order.
    ///
    /// # Errors
    /// The key, its value, and what is wrong with it.
    pub fn conditions(&self, patches: &[String]) -> Made<Vec<BoundaryCondition>> {
        patches.iter().map(|name| self.condition(name)).collect()
    }

    fn condition(&self, patch: &str) -> Made<BoundaryCondition> {
        let path = format!("fluid.boundaries.{patch}");
        let scaled = |shape: VelocityProfile, factor: &Option<Factor>| -> Made<_> {
            match factor {
                None => Ok(shape),
                Some(factor) => Ok(shape.scaled(self.signal(factor, &format!("{path}.factor"))?)),
            }
        };
        Ok(match &self.fluid.boundaries[patch] {
            Boundary::Wall {} => BoundaryCondition::WALL,
            Boundary::MovingWall {
                velocity,
                factor: None,
            } => BoundaryCondition::Wall {
                velocity: *velocity,
            },
            Boundary::MovingWall { velocity, factor } => BoundaryCondition::MovingWall {
                profile: scaled(VelocityProfile::Uniform(*velocity), factor)?,
            },
            Boundary::RotatingWall {
                point,
                axis,
                rate,
                factor,
            } => {
                let rotation = VelocityProfile::Rotation {
                    point: *point,
                    angular_velocity: self.angular_velocity(*axis, *rate, &path)?,
                };
                BoundaryCondition::MovingWall {
                    profile: scaled(rotation, factor)?,
                }
            }
            Boundary::Slip {} => BoundaryCondition::Slip,
            Boundary::Inlet {
                velocity,
                profile,
                factor,
            } => {
                let shape = self.profile(patch, *velocity, profile)?;
                BoundaryCondition::Inlet {
                    profile: scaled(shape, factor)?,
                }
            }
            Boundary::Outlet { pressure, factor } => BoundaryCondition::Outlet {
                pressure: match factor {
                    None => Signal::Constant(*pressure),
                    Some(factor) => {
                        let signal = self.signal(factor, &format!("{path}.factor"))?;
                        let pressure = *pressure;
                        Signal::Function(Arc::new(move |t| pressure * signal.at(t)))
                    }
                },
            },
            Boundary::ConvectiveOutlet { speed } => {
                BoundaryCondition::ConvectiveOutlet { speed: *speed }
            }
        })
    }

    fn angular_velocity(&self, axis: [f64; 3], rate: f64, path: &str) -> Made<[f64; 3]> {
        let length = axis.iter().map(|a| a * a).sum::<f64>().sqrt();
        if length == 0.0 {
            let path = format!("{path}.axis");
            let error = self
                .document
                .value_error(&path, format!("`{path}` is zero"));
            return Err(error.with_help("a direction, as in [0, 0, 1]"));
        }
        Ok(axis.map(|a| rate * a / length))
    }

    fn profile(
        &self,
        patch: &str,
        velocity: Option<[f64; 3]>,
        profile: &Profile,
    ) -> Made<VelocityProfile> {
        let path = format!("fluid.boundaries.{patch}");
        let mean = || {
            velocity.ok_or_else(|| {
                let lacks = format!("`{path}` lacks the key `velocity`");
                let error = self.document.error(&path, lacks);
                error.with_help(
                    "the mean velocity [m/s]; or a `profile` of velocities: { file = \"inlet.csv\" } or { formula = [\"1 - y^2\", \"0\", \"0\"] }",
                )
            })
        };
        let given = matches!(profile, Profile::File(_) | Profile::Formula(_));
        if given && velocity.is_some() {
            let path = format!("{path}.velocity");
            let message = format!("`{path}` has no meaning beside a `profile` of velocities");
            let error = self.document.error(&path, message);
            return Err(error.with_help("remove it; `factor` makes the profile faster or slower"));
        }
        match profile {
            Profile::Uniform => Ok(VelocityProfile::Uniform(mean()?)),
            Profile::Parabolic => self.parabolic(patch, mean()?),
            Profile::File(file) => self.scattered(file, &format!("{path}.profile.file")),
            Profile::Formula(texts) => self.formula(texts, &format!("{path}.profile.formula")),
        }
    }

    /// Product of parabolas between the pairs of opposite walls of the box that the inlet touches.
    fn parabolic(&self, inlet: &str, mean: [f64; 3]) -> Made<VelocityProfile> {
        let is_wall = |patch: String| {
            let found = self.fluid.boundaries.get(&patch);
            matches!(found, Some(Boundary::Wall {}))
        };
        let between_walls = |axis: &usize| {
            let letter = ["x", "y", "z"][*axis];
            let both = ["min", "max"].map(|end| is_wall(format!("{letter}_{end}")));
            !inlet.starts_with(letter) && both == [true; 2]
        };
        let axes: Vec<usize> = (0..3).filter(between_walls).collect();
        let Some(domain) = self.domain.filter(|_| !axes.is_empty()) else {
            let path = format!("fluid.boundaries.{inlet}.profile");
            let error = self.document.value_error(
                &path,
                format!("`{path} = \"parabolic\"` needs a box mesh with two opposite walls beside the inlet"),
            );
            return Err(error.with_help(
                "\"uniform\", { file = \"inlet.csv\" } or { formula = [\"1 - y^2\", \"0\", \"0\"] } go with any mesh",
            ));
        };
        let (low, size) = (domain.origin, domain.size);
        Ok(VelocityProfile::Function(Arc::new(move |x| {
            let shape = |&c: &usize| {
                let s = (x[c] - low[c]) / size[c];
                6.0 * s * (1.0 - s)
            };
            let product: f64 = axes.iter().map(shape).product();
            mean.map(|u| u * product)
        })))
    }

    fn scattered(&self, file: &str, path: &str) -> Made<VelocityProfile> {
        let wrong = |problem: String| {
            let message = format!("`{path} = \"{file}\"`: {problem}");
            let error = self.document.value_error(path, message);
            error.with_help("a CSV file with columns out of x,y,z [m] and out of u,v,w [m/s]")
        };
        let table = Csv::read(&self.folder.join(file), &["x", "y", "z", "u", "v", "w"]);
        let table = table.map_err(wrong)?;
        let columns = |names: [&str; 3]| names.map(|n| table.column(n));
        let (places, velocities) = (columns(["x", "y", "z"]), columns(["u", "v", "w"]));
        let known: Vec<usize> = (0..3).filter(|&c| places[c].is_some()).collect();
        if known.is_empty() || velocities.iter().all(Option::is_none) {
            return Err(wrong("it needs a coordinate and a velocity".to_owned()));
        }
        let rows = |columns: &[Option<Vec<f64>>; 3]| -> Vec<[f64; 3]> {
            let entry = |k: usize, c: usize| columns[c].as_ref().map_or(0.0, |v| v[k]);
            let row = |k: usize| [0, 1, 2].map(|c| entry(k, c));
            (0..table.len()).map(row).collect()
        };
        let (points, values) = (rows(&places), rows(&velocities));
        if let [axis] = known[..] {
            let line = line(points.iter().map(|x| x[axis]).zip(values).collect());
            return Ok(VelocityProfile::Function(Arc::new(move |x| line(x[axis]))));
        }
        let scatter = Scatter::new(points, values);
        Ok(VelocityProfile::Function(Arc::new(move |x| {
            let seen = [0, 1, 2].map(|c| if known.contains(&c) { x[c] } else { 0.0 });
            scatter.at(seen)
        })))
    }

    fn formula(&self, texts: &[String; 3], path: &str) -> Made<VelocityProfile> {
        let read =
            |c: usize| self.expression(&texts[c], &["x", "y", "z", "t"], &format!("{path}[{c}]"));
        let formulas = [read(0)?, read(1)?, read(2)?];
        let unsteady = formulas.iter().any(|f| f.uses(3));
        let value = move |[x, y, z]: [f64; 3], t: f64| {
            let at = [x, y, z, t];
            [0, 1, 2].map(|c| formulas[c].at(&at))
        };
        Ok(if unsteady {
            VelocityProfile::Unsteady(Arc::new(value))
        } else {
            VelocityProfile::Function(Arc::new(move |x| value(x, 0.0)))
        })
    }

    /// A number in time; `path` is its key.
    ///
    /// # Errors
    /// A table, file or formula that makes no sense.
    pub fn signal(&self, factor: &Factor, path: &str) -> Made<Signal> {
        match factor {
            Factor::Table {
                times,
                values,
                periodic,
            } => {
                let made = table(times.clone(), values, *periodic);
                made.map_err(|e| self.document.value_error(path, format!("`{path}`: {e}")))
            }
            Factor::File { file, periodic } => {
                let path = format!("{path}.file");
                let wrong = |problem: String| {
                    let message = format!("`{path} = \"{file}\"`: {problem}");
                    let error = self.document.value_error(&path, message);
                    error.with_help("a CSV file with the columns time,value, times ascending [s]")
                };
                let read = Csv::read(&self.folder.join(file), &["time", "value"]);
                let read = read.map_err(wrong)?;
                let (Some(times), Some(values)) = (read.column("time"), read.column("value"))
                else {
                    return Err(wrong("line 1: both columns are needed".to_owned()));
                };
                table(times, &values, *periodic).map_err(|e| wrong(e.to_string()))
            }
            Factor::Formula { value } => {
                let formula = self.expression(value, &["t"], &format!("{path}.value"))?;
                Ok(Signal::Function(Arc::new(move |t| formula.at(&[t]))))
            }
        }
    }

    fn expression(&self, text: &str, variables: &[&str], path: &str) -> Made<Expression> {
        let refused = |e| self.document.value_error(path, format!("`{path}`: {e}"));
        Expression::parse(text, variables).map_err(refused)
    }
}

fn table(times: Vec<f64>, values: &[f64], periodic: bool) -> Result<Signal, FluidError> {
    let values = values.iter().map(|v| [*v]).collect();
    Ok(Signal::Table(Arc::new(TimeTable::new(
        times, values, periodic,
    )?)))
}

/// Linear between points on a line, constant beyond.
fn line(mut points: Vec<(f64, [f64; 3])>) -> impl Fn(f64) -> [f64; 3] + Send + Sync {
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    move |x| {
        let k = points.partition_point(|p| p.0 <= x);
        let (low, high) = (points[k.max(1) - 1], points[k.min(points.len() - 1)]);
        let gap = high.0 - low.0;
        let share = if gap > 0.0 { (x - low.0) / gap } else { 0.0 };
        [0, 1, 2].map(|c| low.1[c] + share * (high.1[c] - low.1[c]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_linear_between_its_points_in_any_order() {
        let value = |u: f64| [u, -u, 0.0];
        let line = line(vec![
            (2.0, value(1.0)),
            (0.0, value(0.0)),
            (1.0, value(3.0)),
        ]);
        for (x, u) in [(-1.0, 0.0), (0.5, 1.5), (1.0, 3.0), (1.75, 1.5), (7.0, 1.0)] {
            assert_eq!(line(x), value(u), "at {x}");
        }
    }
}
