//! Profiles, spectra and friction with their sampling errors, from the sums.

use super::bins::Bins;
use super::differences::derivatives;
use super::lines::{PRODUCTS, correlation, reduced};
use super::moments::Central;
use super::moments::slot::{COUNT, U};
use super::{Block, GLOBALS, Statistics};
use crate::Fluid;

/// A quantity by bin.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// Name, with the unit in SI.
    pub name: &'static str,
    /// Value in every bin.
    pub values: Vec<f64>,
    /// Sampling error of every value: the jackknife over blocks of time; empty with one block.
    pub errors: Vec<f64>,
}

/// Spectra and correlations along an axis.
#[derive(Clone, Debug, PartialEq)]
pub struct LineSpectrum {
    /// Axis: 0, 1 or 2, or [`super::AROUND`]: wavenumbers are then numbers of waves around, separations are angles.
    pub axis: usize,
    /// The bins that it is of.
    pub bins: Vec<usize>,
    /// Wavenumbers \[rad/m\].
    pub wavenumbers: Vec<f64>,
    /// Separations \[m\].
    pub separations: Vec<f64>,
    /// One-sided spectra of u₁, u₂, u₃ and the cospectrum of u₁u₂ \[m³/s²\], by bin and wavenumber: their sums times the
    /// spacing of wavenumbers are the Reynolds stresses. Bins are those of `bins`.
    pub spectra: [Vec<f64>; PRODUCTS],
    /// ⟨u'(x) u'(x + r)⟩ of u₁, u₂, u₃ and, even part, of u₁u₂ \[m²/s²\], by bin and separation.
    pub correlations: [Vec<f64>; PRODUCTS],
}

/// Friction on the walls, means over the samples; errors where there are blocks.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Friction {
    /// Mean stress of the flow on the walls \[Pa\].
    pub wall_stress: f64,
    /// Its sampling error \[Pa\].
    pub wall_stress_error: f64,
    /// Mean velocity over the domain \[m/s\].
    pub bulk_velocity: f64,
    /// Its sampling error \[m/s\].
    pub bulk_velocity_error: f64,
    /// Driving force per volume \[N/m³\].
    pub driving_force: f64,
    /// √(τ/ρ) \[m/s\].
    pub friction_velocity: f64,
    /// u_τ δ/ν, δ the half width, the extent or the radius.
    pub reynolds_number: f64,
    /// 2τ/(ρU²).
    pub coefficient: f64,
    /// Largest distance of the total stress from the straight line that balances the driving force, by its value at the wall:
    /// what averaging has left of acceleration, and the error of differences between bins. Zero where nothing drives the flow.
    pub stress_residual: f64,
}

/// What was averaged.
#[derive(Clone, Debug, PartialEq)]
pub struct StatisticsReport {
    /// Samples.
    pub samples: u64,
    /// Time over which they were taken \[s\].
    pub time: f64,
    /// Blocks that errors are from, and their length \[s\].
    pub blocks: (usize, f64),
    /// Position of every bin \[m\].
    pub positions: Vec<f64>,
    /// Quantities by bin.
    pub columns: Vec<Column>,
    /// Spectra, an entry for every axis that was asked for.
    pub spectra: Vec<LineSpectrum>,
    /// Friction; zeros without walls.
    pub friction: Friction,
    /// Half width, extent or radius \[m\].
    pub extent: f64,
}

const NAMES: [&str; 28] = [
    "u",
    "v",
    "w",
    "p",
    "uu",
    "vv",
    "ww",
    "uv",
    "uw",
    "vw",
    "pp",
    "skewness_u",
    "skewness_v",
    "skewness_w",
    "flatness_u",
    "flatness_v",
    "flatness_w",
    "viscous_stress",
    "reynolds_stress",
    "total_stress",
    "k",
    "production",
    "dissipation",
    "turbulent_transport",
    "pressure_transport",
    "viscous_diffusion",
    "budget_residual",
    "stress_line",
];

/// Columns of [`NAMES`] from the means of the products of every bin; `stress` is that of the straight line at the wall \[Pa\].
fn columns(means: &[f64], bins: &Bins, stress: f64, viscosity: f64, density: f64) -> Vec<Vec<f64>> {
    let central: Vec<Central> = means.chunks_exact(COUNT).map(Central::new).collect();
    let of = |f: &dyn Fn(&Central) -> f64| central.iter().map(f).collect::<Vec<f64>>();
    let x = &bins.positions;
    // Rings around the axis hold nodes of several radii: no high order there.
    let width = if bins.rings() { 3 } else { 5 };
    let slope = |f: &[f64]| derivatives(x, f, width).0;
    // ∇·(q e₂): dq/dx₂ on planes, dq/dr + q/r on rings.
    let divergence = |q: &[f64]| {
        let mut d = slope(q);
        if bins.rings() {
            let around = |k: usize| if x[k] > 0.0 { q[k] / x[k] } else { d[k] };
            let around: Vec<f64> = (0..x.len()).map(around).collect();
            d.iter_mut().zip(around).for_each(|(d, a)| *d += a);
        }
        d
    };
    let laplacian = |f: &[f64]| {
        let (first, mut second) = derivatives(x, f, width);
        if bins.rings() {
            let around = |k: usize| {
                if x[k] > 0.0 {
                    first[k] / x[k]
                } else {
                    second[k]
                }
            };
            let around: Vec<f64> = (0..x.len()).map(around).collect();
            second.iter_mut().zip(around).for_each(|(s, a)| *s += a);
        }
        second
    };
    let shear = slope(&of(&|c| c.mean[0]));
    let viscous: Vec<f64> = shear.iter().map(|s| density * viscosity * s).collect();
    let reynolds = of(&|c| -density * c.stress[3]);
    let k = of(&Central::energy);
    let spread: Vec<f64> = laplacian(&k).iter().map(|l| viscosity * l).collect();
    let production: Vec<f64> = (central.iter().zip(&shear))
        .map(|(c, s)| -c.stress[3] * s)
        .collect();
    let dissipation: Vec<f64> = (central.iter().zip(&spread))
        .map(|(c, d)| d - viscosity * c.diffusion)
        .collect();
    let minus = |q: Vec<f64>| divergence(&q).iter().map(|d| -d).collect::<Vec<f64>>();
    let turbulent = minus(of(&|c| c.transport));
    let pressure = minus(of(&|c| c.pressure_transport));
    let residual = (0..x.len())
        .map(|i| production[i] - dissipation[i] + turbulent[i] + pressure[i] + spread[i])
        .collect();
    let total = viscous.iter().zip(&reynolds).map(|(a, b)| a + b).collect();
    let line = |&x: &f64| match (bins.rings(), bins.symmetric()) {
        (true, _) => -stress * x / bins.extent,
        (false, true) => stress * (1.0 - x / bins.extent),
        (false, false) => 0.0,
    };
    vec![
        of(&|c| c.mean[0]),
        of(&|c| c.mean[1]),
        of(&|c| c.mean[2]),
        of(&|c| density * c.pressure),
        of(&|c| c.stress[0]),
        of(&|c| c.stress[1]),
        of(&|c| c.stress[2]),
        of(&|c| c.stress[3]),
        of(&|c| c.stress[4]),
        of(&|c| c.stress[5]),
        of(&|c| density * density * c.pressure_square),
        of(&|c| c.skewness[0]),
        of(&|c| c.skewness[1]),
        of(&|c| c.skewness[2]),
        of(&|c| c.flatness[0]),
        of(&|c| c.flatness[1]),
        of(&|c| c.flatness[2]),
        viscous,
        reynolds,
        total,
        k,
        production,
        dissipation,
        turbulent,
        pressure,
        spread,
        residual,
        x.iter().map(line).collect(),
    ]
}

/// Weighted mean of blocks without one of them.
fn mean_without(blocks: &[Block], left_out: Option<usize>) -> Vec<f64> {
    let kept = || (blocks.iter().enumerate()).filter(|&(k, _)| Some(k) != left_out);
    let weight: f64 = kept().map(|(_, b)| b.weight).sum();
    let mut mean = vec![0.0; blocks.first().map_or(0, |b| b.sums.len())];
    for (_, block) in kept() {
        (mean.iter_mut().zip(&block.sums)).for_each(|(m, s)| *m += s / weight);
    }
    mean
}

/// Jackknife error of every number, from its values without one block each.
fn jackknife(values: &[Vec<f64>]) -> Vec<f64> {
    let n = values.len() as f64;
    let error = |k: usize| {
        let mean = values.iter().map(|v| v[k]).sum::<f64>() / n;
        let square: f64 = values.iter().map(|v| (v[k] - mean).powi(2)).sum();
        (square * (n - 1.0) / n).sqrt()
    };
    (0..values.first().map_or(0, Vec::len)).map(error).collect()
}

impl Statistics {
    /// Friction of the last sample, where there are walls.
    pub fn friction_now(&self, fluid: &Fluid) -> Friction {
        self.friction(fluid, self.now)
    }

    /// All averages so far; None before the first sample. Collective.
    pub fn report(&self, fluid: &Fluid) -> Option<StatisticsReport> {
        let communicator = fluid.mesh().halo.communicator();
        if self.samples == 0 {
            return None;
        }
        let filled = self.blocks.iter().filter(|b| b.weight > 0.0);
        let blocks: Vec<Block> = filled
            .map(|block| Block {
                weight: block.weight,
                sums: reduced(&block.sums, communicator),
            })
            .collect();
        let time: f64 = blocks.iter().map(|b| b.weight).sum();
        let settings = fluid.settings();
        let (viscosity, density) = (settings.kinematic_viscosity(), settings.density);
        let split = self.bins.len() * COUNT;
        let derive = |mean: &[f64]| {
            let stress = self.balancing_stress(mean[split + 2]);
            columns(&mean[..split], &self.bins, stress, viscosity, density)
        };
        let means = mean_without(&blocks, None);
        let values = derive(&means);
        // A last block that is not full would count as much as the others.
        let full: Vec<Block> = (blocks.iter())
            .filter(|b| b.weight > 0.5 * self.length)
            .cloned()
            .collect();
        let many = full.len() > 1;
        let without: Vec<Vec<f64>> = (0..if many { full.len() } else { 0 })
            .map(|k| mean_without(&full, Some(k)))
            .collect();
        let derived: Vec<Vec<Vec<f64>>> = without.iter().map(|mean| derive(mean)).collect();
        let columns = NAMES
            .iter()
            .zip(values)
            .enumerate()
            .map(|(c, (&name, values))| {
                let each: Vec<Vec<f64>> = derived.iter().map(|d| d[c].clone()).collect();
                Column {
                    name,
                    values,
                    errors: jackknife(&each),
                }
            });
        let columns: Vec<Column> = columns.collect();
        let globals: Vec<Vec<f64>> = without.iter().map(|mean| mean[split..].to_vec()).collect();
        let errors = jackknife(&globals);
        let mut friction = self.friction(fluid, [means[split], means[split + 1], means[split + 2]]);
        if let [stress, bulk, _] = errors[..] {
            (friction.wall_stress_error, friction.bulk_velocity_error) = (stress, bulk);
        }
        let balancing = self.balancing_stress(friction.driving_force).abs();
        if balancing > 0.0 {
            let find = |name: &str| columns.iter().find(|c| c.name == name).map(|c| &c.values);
            if let (Some(total), Some(line)) = (find("total_stress"), find("stress_line")) {
                let off = total.iter().zip(line).map(|(t, l)| (t - l).abs());
                friction.stress_residual = off.fold(0.0, f64::max) / balancing;
            }
        }
        Some(StatisticsReport {
            samples: self.samples,
            time,
            blocks: (full.len(), self.length),
            positions: self.bins.positions.clone(),
            columns,
            spectra: self.spectra(fluid, &means, time),
            friction,
            extent: self.bins.extent,
        })
    }

    /// Wall stress that balances a driving force in a steady flow \[Pa\]; zero where bins do not tell where the walls are.
    fn balancing_stress(&self, driving: f64) -> f64 {
        match (self.bins.rings(), self.bins.symmetric()) {
            (true, _) => 0.5 * driving * self.bins.extent,
            (false, true) => driving * self.bins.extent,
            (false, false) => 0.0,
        }
    }

    fn friction(&self, fluid: &Fluid, [stress, bulk, driving]: [f64; GLOBALS]) -> Friction {
        let settings = fluid.settings();
        let friction_velocity = (stress.abs() / settings.density).sqrt();
        Friction {
            wall_stress: stress,
            bulk_velocity: bulk,
            driving_force: driving,
            friction_velocity,
            reynolds_number: friction_velocity * self.bins.extent / settings.kinematic_viscosity(),
            coefficient: if bulk == 0.0 {
                0.0
            } else {
                2.0 * stress / (settings.density * bulk * bulk)
            },
            ..Friction::default()
        }
    }

    /// Collective.
    fn spectra(&self, fluid: &Fluid, means: &[f64], time: f64) -> Vec<LineSpectrum> {
        let communicator = fluid.mesh().halo.communicator();
        let spectrum = |lines: &super::Lines| {
            let waves = lines.waves();
            let mut sums = reduced(&lines.sums, communicator);
            let step = 2.0 * std::f64::consts::PI / lines.length;
            let mut spectra: [Vec<f64>; PRODUCTS] = Default::default();
            let mut correlations: [Vec<f64>; PRODUCTS] = Default::default();
            for &bin in &lines.bins {
                let start = bin * PRODUCTS * waves;
                let sums = &mut sums[start..start + PRODUCTS * waves];
                let u = &means[bin * COUNT + U..];
                let square = [u[0] * u[0], u[1] * u[1], u[2] * u[2], u[0] * u[1]];
                for (product, sums) in sums.chunks_exact_mut(waves).enumerate() {
                    sums.iter_mut().for_each(|s| *s /= time);
                    sums[0] -= square[product];
                    correlations[product].extend(correlation(sums, lines.count));
                    spectra[product].extend(sums.iter().map(|s| s / step));
                }
            }
            LineSpectrum {
                axis: lines.axis,
                bins: lines.bins.clone(),
                wavenumbers: (0..waves).map(|k| k as f64 * step).collect(),
                separations: (0..waves)
                    .map(|k| k as f64 * lines.length / lines.count as f64)
                    .collect(),
                spectra,
                correlations,
            }
        };
        self.lines.iter().map(spectrum).collect()
    }
}
