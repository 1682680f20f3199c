//! Statistics of the fibres, as series.

use super::Schedule;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Statistics of directions and shapes of the fibres.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Observables {
    /// Every so many steps; this or `interval`. Default: with `output.series`.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1))]
    pub every: Option<u64>,
    /// Every so much simulated time [s]; steps land on it exactly. This or `every`.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub interval: Option<f64>,
    /// Keeps a budget of the fibres' energy, in `series/energy.csv`.
    pub energy: bool,
    /// Stress of the suspension by its parts, in `series/stress.csv`: fluid 2μE, particle stress (Batchelor 1970) and contacts as
    /// means over the domain, N1 and N2, and the viscosity relative to that of the fluid. Of linked fibres in `series/structure.csv`: particle stress by
    /// slender bodies and contacts (Switzer 2002, 2.104), N1, N2 and the specific viscosity, and beside them mean forces of contacts, the share that slides, energy and
    /// bending of the joints, and ⟨(p·flow)²(p·gradient)²⟩ of the segments.
    pub stress: bool,
    /// Fibres whose centre is nearer to a face of the box that is not periodic count neither in directions nor in stress [m];
    /// their share of the box is left out of its volume.
    #[schemars(range(min = 0.0))]
    pub wall_margin: f64,
    /// Bins of every distribution.
    #[schemars(range(min = 2, max = 1000))]
    pub bins: usize,
    /// Largest distance in the pair distribution g(r) of the middles of linked fibres [m], at most half an edge of their box.
    /// Default: no distribution.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub pair_distance: Option<f64>,
    /// Largest curvature times length in the distribution of curvatures.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub curvature_max: f64,
    /// Direction of the flow, for orbit constants, phases and stress.
    pub flow: [f64; 3],
    /// Direction of the velocity gradient, for the same.
    pub gradient: [f64; 3],
}

impl Default for Observables {
    fn default() -> Self {
        Self {
            every: None,
            interval: None,
            energy: false,
            stress: false,
            wall_margin: 0.0,
            bins: 20,
            pair_distance: None,
            curvature_max: 20.0,
            flow: [1.0, 0.0, 0.0],
            gradient: [0.0, 1.0, 0.0],
        }
    }
}

impl Observables {
    /// When a line is written, beside a series of this schedule.
    pub fn schedule(&self, series: &Schedule) -> Schedule {
        let own = Schedule {
            every: self.every,
            interval: self.interval,
        };
        if self.every.is_some() || self.interval.is_some() {
            own
        } else {
            series.clone()
        }
    }
}
