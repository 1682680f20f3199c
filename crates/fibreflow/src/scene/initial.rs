//! Velocity at the start, as the case file asks for it.

use super::expression::Expression;
use super::pipe::Pipe;
use crate::case::{ChannelProfile, Domain, Initial};
use crate::error::ProgramError;
use fibreflow_fluid::initial::{
    self, Isotropic, MeanProfile, PerturbedChannel, PerturbedPipe, TaylorGreen,
};
use std::collections::HashMap;
use std::f64::consts::TAU;
use std::path::Path;

/// u(x) \[m/s\].
pub type VelocityField = Box<dyn Fn([f64; 3]) -> [f64; 3]>;

/// The initial field; `domain` is the box of the mesh, `pipe` what it is as a pipe, `folder` that of the case file.
///
/// # Errors
/// Formulas and files that cannot be read.
pub fn velocity_field(
    field: &Initial,
    domain: Option<&Domain>,
    pipe: &Pipe,
    folder: &Path,
) -> Result<VelocityField, ProgramError> {
    Ok(match field {
        Initial::Rest => Box::new(|_| [0.0; 3]),
        Initial::Uniform { velocity } => {
            let velocity = *velocity;
            Box::new(move |_| velocity)
        }
        Initial::Poiseuille { bulk_velocity } => {
            let channel = Channel::new(domain)?;
            Box::new(initial::poiseuille(
                *bulk_velocity,
                channel.across,
                channel.low,
                channel.high,
            ))
        }
        Initial::PerturbedChannel {
            bulk_velocity,
            profile,
            intensity,
            seed,
        } => Box::new(perturbed(domain, *bulk_velocity, *profile, *intensity, *seed)?.field()),
        Initial::PerturbedPipe {
            bulk_velocity,
            profile,
            intensity,
            seed,
        } => {
            let stream = axis_of(*bulk_velocity)?;
            let (origin, radius, length) = pipe.along(stream);
            let field = PerturbedPipe {
                origin,
                stream,
                radius,
                length,
                mean: bulk_velocity[stream],
                profile: mean_profile(*profile),
                intensity: *intensity,
                seed: *seed,
            };
            Box::new(field.field())
        }
        Initial::TaylorGreen {
            amplitude,
            wavelength,
            drift,
        } => {
            let vortices = TaylorGreen {
                amplitude: *amplitude,
                wave_number: TAU / wavelength,
                drift: *drift,
                kinematic_viscosity: 0.0,
            };
            Box::new(move |x| vortices.velocity(0.0, x))
        }
        Initial::Isotropic {
            intensity,
            wavelength,
            seed,
        } => {
            let domain = domain.ok_or_else(|| {
                ProgramError::input("`fluid.initial.kind = \"isotropic\"` needs a box mesh")
            })?;
            let field = Isotropic {
                origin: domain.origin,
                size: domain.size,
                intensity: *intensity,
                wavelength: *wavelength,
                seed: *seed,
            };
            Box::new(field.field())
        }
        Initial::Expression { velocity } => {
            let read = |c: usize| {
                Expression::parse(&velocity[c], &["x", "y", "z"])
                    .map_err(|e| ProgramError::input(format!("fluid.initial.velocity[{c}]: {e}")))
            };
            let formulas = [read(0)?, read(1)?, read(2)?];
            Box::new(move |x| [0, 1, 2].map(|c| formulas[c].at(&x)))
        }
        Initial::File { file } => {
            let table = Table::read(&folder.join(file))?;
            Box::new(move |x| table.at(x))
        }
    })
}

/// The space between two walls of a box.
#[derive(Clone, Copy, Debug)]
pub struct Channel {
    /// Direction from wall to wall.
    pub across: usize,
    /// Lower wall \[m\].
    pub low: f64,
    /// Upper wall \[m\].
    pub high: f64,
}

impl Channel {
    /// The channel of a box with one direction that is not periodic.
    ///
    /// # Errors
    /// A box with another number of such directions.
    pub fn new(domain: Option<&Domain>) -> Result<Self, ProgramError> {
        let walls = |d: &&Domain| d.periodic.iter().filter(|p| !**p).count() == 1;
        let Some(domain) = domain.filter(walls) else {
            return Err(ProgramError::input(
                "a channel needs a box mesh with exactly one direction that is not periodic",
            ));
        };
        let across = domain.periodic.iter().position(|p| !p).unwrap_or(1);
        let low = domain.origin[across];
        Ok(Self {
            across,
            low,
            high: low + domain.size[across],
        })
    }
}

fn perturbed(
    domain: Option<&Domain>,
    bulk: [f64; 3],
    profile: ChannelProfile,
    intensity: f64,
    seed: u64,
) -> Result<PerturbedChannel, ProgramError> {
    let across = Channel::new(domain)?.across;
    let stream = axis_of(bulk)?;
    let (origin, size) = domain.map_or_else(Default::default, |d| (d.origin, d.size));
    Ok(PerturbedChannel {
        origin,
        size,
        stream,
        across,
        mean: bulk[stream],
        profile: mean_profile(profile),
        intensity,
        seed,
    })
}

fn mean_profile(profile: ChannelProfile) -> MeanProfile {
    match profile {
        ChannelProfile::Laminar => MeanProfile::Laminar,
        ChannelProfile::Turbulent => MeanProfile::Turbulent,
    }
}

/// The one direction in which a mean velocity points.
fn axis_of(bulk: [f64; 3]) -> Result<usize, ProgramError> {
    let mut along = (0..3).filter(|&c| bulk[c] != 0.0);
    match (along.next(), along.next()) {
        (Some(axis), None) => Ok(axis),
        _ => Err(ProgramError::input(
            "fluid.initial.bulk_velocity must point along x, y or z",
        )),
    }
}

/// Velocities by position.
struct Table {
    rows: HashMap<[i64; 3], [f64; 3]>,
    cell: f64,
}

impl Table {
    fn read(path: &Path) -> Result<Self, ProgramError> {
        let name = path.display();
        let text = std::fs::read_to_string(path)
            .map_err(|e| ProgramError::input(format!("fluid.initial.file: {name}: {e}")))?;
        let mut points = Vec::new();
        for (k, line) in text
            .lines()
            .enumerate()
            .skip(1)
            .filter(|(_, l)| !l.trim().is_empty())
        {
            let numbers: Vec<f64> = line
                .split(',')
                .filter_map(|v| v.trim().parse().ok())
                .collect();
            let row: [f64; 6] = numbers.try_into().map_err(|_| {
                ProgramError::input(format!(
                    "{name}, line {}: not six numbers x,y,z,u,v,w",
                    k + 1
                ))
            })?;
            points.push(row);
        }
        let reach = points
            .iter()
            .flat_map(|r| &r[..3])
            .fold(0.0_f64, |m, x| m.max(x.abs()));
        let mut table = Self {
            rows: HashMap::with_capacity(points.len()),
            cell: (1e-6 * reach).max(f64::MIN_POSITIVE),
        };
        for [x, y, z, u, v, w] in points {
            let key = table.key([x, y, z]);
            table.rows.insert(key, [u, v, w]);
        }
        Ok(table)
    }

    fn key(&self, x: [f64; 3]) -> [i64; 3] {
        x.map(|c| (c / self.cell).round() as i64)
    }

    /// NaN where the file has no line; the fluid then names the node.
    fn at(&self, x: [f64; 3]) -> [f64; 3] {
        let key = self.key(x);
        let near = |k: i64| {
            [
                key[0] + k / 9 - 1,
                key[1] + k / 3 % 3 - 1,
                key[2] + k % 3 - 1,
            ]
        };
        let found = (0..27).find_map(|k| self.rows.get(&near(k)));
        found.copied().unwrap_or([f64::NAN; 3])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_finds_its_nodes_and_no_others() {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("field.csv");
        std::fs::write(&path, "x,y,z,u,v,w\n0,0,0,1,2,3\n1,0.5,0,4,5,6\n").expect("written");
        let initial = Initial::File {
            file: "field.csv".into(),
        };
        let u = velocity_field(&initial, None, &Pipe::default(), folder.path())
            .map_err(|e| e.message)
            .expect("field");
        assert_eq!(u([1.0 + 1e-9, 0.5, 0.0]), [4.0, 5.0, 6.0]);
        assert!(u([0.5, 0.5, 0.0])[0].is_nan());
    }
}
