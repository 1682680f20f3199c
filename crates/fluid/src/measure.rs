//! How fast the kernels of a step are, one by one.

use crate::Fluid;
use crate::predict::SUB_STEPS;
use crate::rows::nothing;
use std::time::Instant;

/// Cost of a kernel of the time step.
#[derive(Clone, Debug, PartialEq)]
pub struct KernelCost {
    /// What it does.
    pub name: &'static str,
    /// How often a step runs it, with explicit diffusion and without boundaries that change.
    pub runs_per_step: usize,
    /// Bytes a node that it must move when every array is read and written once (what a store reads of its cache line
    /// first is not counted, as in STREAM).
    pub bytes_per_node: f64,
    /// Time of a run, the best of the repetitions \[s\].
    pub seconds: f64,
}

impl Fluid {
    /// Runs every kernel of the step `repetitions` times on the fields as they are, which it does not keep: the flow is
    /// of no use afterwards. Collective.
    pub fn kernel_costs(&mut self, repetitions: usize) -> Vec<KernelCost> {
        let nodes = self.mesh.owned();
        let fluxes = 8.0 * self.operators.flux_length() as f64 / nodes as f64;
        // Indices and, one by one or as (S, w), what the mesh gives to a pair.
        let entries = self.operators.entries_read() as f64 / nodes as f64;
        let (weights, faces) = (12.0 * entries, 36.0 * entries);
        let cycles = self.settings.cleaning_cycles;
        let mut costs = Vec::new();
        let mut add = |name, runs_per_step, bytes_per_node, run: &mut dyn FnMut()| {
            let time = |_| {
                let start = Instant::now();
                run();
                start.elapsed().as_secs_f64()
            };
            let seconds = (0..repetitions.max(1))
                .map(time)
                .fold(f64::INFINITY, f64::min);
            costs.push(KernelCost {
                name,
                runs_per_step,
                bytes_per_node,
                seconds,
            });
        };
        add("extrapolate fluxes", 1, 3.0 * fluxes, &mut || {
            self.extrapolate_flux(0.0);
        });
        add(
            "sources, V (f/ρ + g − G p)",
            1,
            8.0 + 32.0 + 8.0 + 32.0 + faces,
            &mut || {
                self.gather_sources();
            },
        );
        // u, source, V⁻¹, rate read and written, next.
        let moved = 32.0 + 32.0 + 8.0 + 64.0 + 32.0 + fluxes + weights;
        let corrected = std::mem::replace(&mut self.correcting, false);
        add("convection and diffusion", 3, moved, &mut || {
            self.explicit_sub_step(&SUB_STEPS[0], 0.0, 0.0);
        });
        if corrected {
            // x, V⁻¹, u, u + δ; indices and masses.
            let moved = 32.0 + 8.0 + 32.0 + 32.0 + 8.0 * entries;
            add("correction of mass", 3, moved, &mut || self.correct_step());
        }
        add("divergence", 1, 32.0 + 8.0 + faces, &mut || {
            let rhs = &mut self.poisson.rhs;
            let mut none = nothing(rhs.len());
            self.operators.divergence(
                &mut self.velocity,
                (&mut rhs[..], &mut none),
                |_, sum, rhs, ()| *rhs = -sum,
            );
        });
        let moved = 32.0 + 8.0 + fluxes + 32.0 + 16.0 + 8.0 + faces;
        add("correct fluxes, velocity, pressure", 1, moved, &mut || {
            self.correct(0.0)
        });
        // x and x of the step before, b and 1/D, three times, after one pass that reads the last two only.
        let moved = 3.0 * (32.0 + weights) + 24.0;
        add("short-wave inverse", cycles, moved, &mut || {
            self.poisson.polynomial.apply(&self.operators);
        });
        let moved =
            32.0 + 8.0 + faces + 3.0 * (32.0 + weights) + 24.0 + 8.0 + 64.0 + 16.0 + 8.0 + faces;
        add(
            "cleaning, with its short-wave inverse",
            0,
            moved,
            &mut || self.clean(0.0),
        );
        add("Rhie–Chow share", 1, 0.0, &mut || {
            self.find_mismatch(1e-3)
        });
        let settings = self.settings.pressure;
        add("pressure solve", 1, 52.0, &mut || {
            let _ = self.poisson.solve(&settings);
        });
        add(
            "search for values that are not finite",
            1,
            40.0,
            &mut || {
                let _ = self.check_finite();
            },
        );
        costs
    }
}
