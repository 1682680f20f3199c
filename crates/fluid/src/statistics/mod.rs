//! Averages over time and over planes or rings: moments, budget of the kinetic energy, spectra, friction.
//!
//! Sums are kept by blocks of time: the spread of the blocks gives the sampling error (jackknife). Every rank adds up its
//! own nodes; sums over ranks are taken when somebody asks.

mod bins;
mod differences;
mod lines;
mod moments;
mod report;

pub use report::{Column, Friction, LineSpectrum, StatisticsReport};

use crate::{BoundaryCondition, Fluid, FluidError};
use bins::Bins;
use lines::Lines;
use moments::slot::COUNT;
use rayon::prelude::*;

/// What is averaged together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Averaging {
    /// Planes across an axis.
    Planes {
        /// Axis across the planes: 0, 1 or 2.
        normal: usize,
        /// Axis of the flow, another one.
        flow: usize,
        /// Planes at the same distance from the two sides count as one, with the velocity along the normal turned round in the
        /// far half.
        symmetric: bool,
    },
    /// Rings around an axis, which is that of the flow.
    Rings {
        /// Axis: 0, 1 or 2.
        axis: usize,
        /// A point on it \[m\].
        centre: [f64; 3],
    },
}

/// What is averaged and how.
#[derive(Clone, Debug, PartialEq)]
pub struct StatisticsSettings {
    /// Nodes that are averaged together.
    pub averaging: Averaging,
    /// Time at which averaging starts \[s\].
    pub from: f64,
    /// Length of the first blocks of time \[s\].
    pub block: f64,
    /// Axes along which spectra and correlations are taken, and [`AROUND`].
    pub spectra: Vec<usize>,
}

/// In place of an axis: around the circles of rings, by angle.
pub const AROUND: usize = 3;

/// Blocks of time that are kept; when there would be more, neighbours are joined.
const BLOCKS: usize = 64;

/// Numbers of a block that belong to no bin: wall stress \[Pa\], mean velocity along the flow \[m/s\], driving force \[N/m³\].
const GLOBALS: usize = 3;

/// Nodes that one task adds up: a constant of the program, so that sums do not depend on the threads.
const CHUNK: usize = 8192;

/// Sums of a block of time, of this rank's nodes.
#[derive(Clone, Debug, PartialEq)]
struct Block {
    /// Time that was sampled \[s\].
    weight: f64,
    /// Weighted sums by bin and product, divided by the volume of the bin; then the globals.
    sums: Vec<f64>,
}

/// Running averages of a flow.
#[derive(Debug)]
pub struct Statistics {
    settings: StatisticsSettings,
    bins: Bins,
    lines: Vec<Lines>,
    /// Present length of blocks \[s\].
    length: f64,
    blocks: Vec<Block>,
    /// Time of the last sample; the start of averaging before \[s\].
    last: f64,
    samples: u64,
    /// Area of the walls \[m²\]; zero without.
    wall_area: f64,
    /// Patches that are walls.
    walls: Vec<usize>,
    /// Globals of the last sample.
    now: [f64; GLOBALS],
}

const HEAD: &str = "statistics.head";
const WEIGHTS: &str = "statistics.weights";
const SUMS: &str = "statistics.sums";
const SPECTRA: [&str; 4] = [
    "statistics.spectra_x",
    "statistics.spectra_y",
    "statistics.spectra_z",
    "statistics.spectra_around",
];

impl Statistics {
    /// Nothing sampled yet. Collective.
    ///
    /// # Errors
    /// [`FluidError::Statistics`] where nodes are not on the lines that spectra ask for, and
    /// [`FluidError::Setting`] for numbers out of range.
    pub fn new(fluid: &Fluid, settings: StatisticsSettings) -> Result<Self, FluidError> {
        if !(settings.block > 0.0 && settings.block.is_finite()) {
            return Err(FluidError::Setting {
                name: "block",
                value: settings.block,
                expected: "a positive length of time",
            });
        }
        if let Averaging::Planes {
            normal,
            symmetric: true,
            ..
        } = settings.averaging
            && fluid
                .mesh()
                .periods
                .vectors
                .iter()
                .any(|v| v[normal] != 0.0)
        {
            let problem = "planes cannot be symmetric about the middle of a periodic direction";
            return Err(FluidError::Statistics {
                problem: problem.to_owned(),
            });
        }
        let bins = Bins::new(fluid, &settings.averaging);
        let lines = (settings.spectra.iter())
            .map(|&axis| Lines::new(fluid, &bins, axis))
            .collect::<Result<Vec<_>, _>>()?;
        let wall = |c: &BoundaryCondition| {
            matches!(
                c,
                BoundaryCondition::Wall { .. } | BoundaryCondition::MovingWall { .. }
            )
        };
        let conditions = fluid.settings.boundary.iter().enumerate();
        let walls: Vec<usize> = conditions
            .filter(|(_, c)| wall(c))
            .map(|(k, _)| k)
            .collect();
        let shares = fluid.operators.geometry.boundary.iter();
        let area = shares
            .filter(|s| walls.contains(&(s.patch as usize)))
            .map(|s| crate::settings::length(s.area))
            .sum();
        Ok(Self {
            length: settings.block,
            last: settings.from,
            bins,
            lines,
            blocks: Vec::new(),
            samples: 0,
            wall_area: fluid.mesh().halo.communicator().sum(area),
            walls,
            now: [0.0; GLOBALS],
            settings,
        })
    }

    /// Adds the flow as it is, for the time since the last sample; before the start of averaging only the friction is
    /// found. Collective.
    pub fn sample(&mut self, fluid: &Fluid, time: f64) {
        self.now = self.globals(fluid);
        let weight = time - self.last;
        if time < self.settings.from || weight <= 0.0 {
            return;
        }
        self.last = time;
        self.samples += 1;
        let sums = self.products(fluid, weight);
        let block = self.block_at(time);
        block.weight += weight;
        for (sum, new) in block.sums.iter_mut().zip(sums) {
            *sum += new;
        }
        for lines in &mut self.lines {
            lines.sample(fluid, &self.bins, weight);
        }
    }

    /// The block that a time belongs to, made if it is new.
    fn block_at(&mut self, time: f64) -> &mut Block {
        // A sample that ends with a block belongs to it.
        let index = |length: f64| {
            let count = ((time - self.settings.from) / length * (1.0 - 1e-9)).floor();
            count.max(0.0) as usize
        };
        while index(self.length) >= BLOCKS {
            self.length *= 2.0;
            let joined = self.blocks.chunks(2).map(|pair| {
                let mut block = pair[0].clone();
                if let Some(other) = pair.get(1) {
                    block.weight += other.weight;
                    (block.sums.iter_mut().zip(&other.sums)).for_each(|(a, b)| *a += b);
                }
                block
            });
            self.blocks = joined.collect();
        }
        let (at, empty) = (index(self.length), self.bins.len() * COUNT + GLOBALS);
        while self.blocks.len() <= at {
            self.blocks.push(Block {
                weight: 0.0,
                sums: vec![0.0; empty],
            });
        }
        &mut self.blocks[at]
    }

    /// Weighted sums over this rank's nodes.
    fn products(&self, fluid: &Fluid, weight: f64) -> Vec<f64> {
        let (bins, mesh) = (&self.bins, fluid.mesh());
        let (volumes, inverse) = (fluid.operators.volumes(), fluid.operators.inverse_volumes());
        let length = bins.len() * COUNT;
        let partial = |chunk: usize| {
            let mut sums = vec![0.0; length];
            for i in chunk * CHUNK..((chunk + 1) * CHUNK).min(mesh.owned()) {
                let bin = bins.of[i] as usize;
                let (x, u) = (mesh.nodes[i], fluid.velocity[i]);
                let laplacian = fluid.operators.diffusion_row(&fluid.velocity, i);
                let laplacian = [0, 1, 2].map(|c| inverse[i] * laplacian[c]);
                let lumping = fluid.operators.lumping_row(&fluid.velocity, i);
                let smooth = [0, 1, 2].map(|c| u[c] - inverse[i] * lumping[c]);
                moments::add(
                    &mut sums[bin * COUNT..(bin + 1) * COUNT],
                    weight * volumes[i] / bins.volumes[bin],
                    [[u[0], u[1], u[2]], smooth].map(|u| bins.local(x, u)),
                    fluid.pressure[i],
                    bins.local(x, laplacian),
                );
            }
            sums
        };
        let chunks = mesh.owned().div_ceil(CHUNK);
        let partials: Vec<Vec<f64>> = (0..chunks).into_par_iter().map(partial).collect();
        let mut sums = vec![0.0; length];
        for partial in partials {
            (sums.iter_mut().zip(partial)).for_each(|(sum, part)| *sum += part);
        }
        // These are known to all ranks; the first keeps them.
        let keeps = f64::from(u8::from(mesh.halo.communicator().is_root()));
        sums.extend(self.now.map(|value| keeps * weight * value));
        sums
    }

    /// Wall stress, mean velocity along the flow, driving force along it. Collective.
    fn globals(&self, fluid: &Fluid) -> [f64; GLOBALS] {
        let stress = if self.walls.is_empty() {
            0.0
        } else {
            let loads = fluid.patch_loads([0.0; 3]);
            let along = |&k: &usize| self.bins.along(loads[k].viscous);
            self.walls.iter().map(along).sum::<f64>() / self.wall_area
        };
        [
            stress,
            self.bins.along(fluid.bulk_velocity()),
            self.bins.along(fluid.driving_force()),
        ]
    }

    /// Everything that a restart needs, the same on every rank. Collective.
    pub fn state(&self, fluid: &Fluid) -> Vec<(String, Vec<f64>)> {
        let communicator = fluid.mesh().halo.communicator();
        let head = vec![self.length, self.last, self.samples as f64];
        let sums: Vec<f64> = self.blocks.iter().flat_map(|b| b.sums.clone()).collect();
        let mut state = vec![
            (HEAD.to_owned(), head),
            (
                WEIGHTS.to_owned(),
                self.blocks.iter().map(|b| b.weight).collect(),
            ),
            (SUMS.to_owned(), lines::reduced(&sums, communicator)),
        ];
        for lines in &self.lines {
            let sums = lines::reduced(&lines.sums, communicator);
            state.push((SPECTRA[lines.axis].to_owned(), sums));
        }
        state
    }

    /// Goes on from a stored state; entries that are not of statistics are ignored. False where there is none.
    ///
    /// # Errors
    /// [`FluidError::State`] for a state of other bins or lines; nothing is changed then.
    pub fn restore(
        &mut self,
        fluid: &Fluid,
        state: &[(String, Vec<f64>)],
    ) -> Result<bool, FluidError> {
        let find = |name: &str| state.iter().find(|(n, _)| n == name).map(|(_, v)| v);
        let Some(head) = find(HEAD) else {
            return Ok(false);
        };
        let misfit = |name: &str| FluidError::State {
            name: name.to_owned(),
            problem: "does not fit the planes, rings or lines of `output.statistics`".to_owned(),
        };
        let &[length, last, samples] = head.as_slice() else {
            return Err(misfit(HEAD));
        };
        let weights = find(WEIGHTS).ok_or_else(|| misfit(WEIGHTS))?;
        let sums = find(SUMS).ok_or_else(|| misfit(SUMS))?;
        let each = self.bins.len() * COUNT + GLOBALS;
        if sums.len() != weights.len() * each {
            return Err(misfit(SUMS));
        }
        for lines in &self.lines {
            let name = SPECTRA[lines.axis];
            if find(name).map(Vec::len) != Some(lines.sums.len()) {
                return Err(misfit(name));
            }
        }
        // The first rank holds what all have summed so far.
        let keeps = f64::from(u8::from(fluid.mesh().halo.communicator().is_root()));
        let held = |values: &[f64]| values.iter().map(|v| keeps * v).collect::<Vec<f64>>();
        for lines in &mut self.lines {
            lines.sums = find(SPECTRA[lines.axis]).map_or_else(Vec::new, |s| held(s));
        }
        (self.length, self.last, self.samples) = (length, last, samples as u64);
        let blocks = weights.iter().zip(sums.chunks_exact(each));
        self.blocks = blocks
            .map(|(&weight, sums)| Block {
                weight,
                sums: held(sums),
            })
            .collect();
        Ok(true)
    }
}
