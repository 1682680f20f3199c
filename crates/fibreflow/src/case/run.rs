//! Time, output, exact answers.

use super::{Loads, Observables, Samples, Statistics};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How long and in which steps.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Time {
    /// Simulated time at the end [s].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub end: f64,
    /// Constant time step [s]; this or `cfl`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub step: Option<f64>,
    /// Courant number that the step follows; this or `step`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0), range(max = 1.7))]
    pub cfl: Option<f64>,
    /// Largest step with `cfl` [s].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub max_step: Option<f64>,
}

/// What is written and when.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Output {
    /// VTK files of fluid and fibres. Default: at the start and at the end.
    pub vtk: Schedule,
    /// Vorticity [1/s] and Q-criterion [1/s²] at the nodes in the VTK files of the fluid, too.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub vortices: bool,
    /// Lines of the CSV series. Default: every step.
    pub series: Schedule,
    /// Checkpoints; the last two are kept. Default: at the end.
    pub checkpoint: Schedule,
    /// Forces, torques and flow on patches of the boundary, in `series/loads.csv`. Default: none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub loads: Option<Loads>,
    /// Statistics of directions and shapes of the fibres, in `series/orientation.csv` and `series/shape.csv`. Default: none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub observables: Option<Observables>,
    /// Averages of the flow over time and over planes or rings. Default: none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub statistics: Option<Statistics>,
    /// The flow at chosen points. Default: none.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub samples: Vec<Samples>,
    /// Energy budget and scales of turbulence, in `series/turbulence.csv`. Default: none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub turbulence: Option<Schedule>,
    /// Energy spectrum E(k) [m³/s²] by shells, in `series/spectrum.csv` with the wave numbers [1/m] as columns; on boxes of uniform
    /// hexahedra that are periodic in all directions. Default: none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub spectrum: Option<Schedule>,
    /// Fibres, by number from 0, of which a series is kept: middle, ends, end-to-end vector.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub track: Vec<u64>,
    /// Wall time after which the run writes a checkpoint and stops cleanly [s].
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub wall_time_limit: Option<f64>,
}

impl Default for Output {
    fn default() -> Self {
        Self {
            vtk: Schedule::default(),
            vortices: false,
            series: Schedule {
                every: Some(1),
                interval: None,
            },
            checkpoint: Schedule::default(),
            loads: None,
            observables: None,
            statistics: None,
            samples: Vec::new(),
            turbulence: None,
            spectrum: None,
            track: Vec::new(),
            wall_time_limit: None,
        }
    }
}

impl Output {
    /// Everything that is done from time to time.
    pub fn schedules(&self) -> Vec<Schedule> {
        let loads = self.loads.as_ref().map(|l| l.schedule(&self.series));
        let observables = self.observables.as_ref();
        let observables = observables.map(|o| o.schedule(&self.series));
        let statistics = self.statistics.as_ref().map(Statistics::schedule);
        let mut all = vec![
            self.vtk.clone(),
            self.series.clone(),
            self.checkpoint.clone(),
            loads.unwrap_or_default(),
            observables.unwrap_or_default(),
            statistics.unwrap_or_default(),
            self.turbulence.clone().unwrap_or_default(),
            self.spectrum.clone().unwrap_or_default(),
        ];
        all.extend(self.samples.iter().map(|s| s.schedule(&self.series)));
        all
    }
}

/// When something is done, apart from the end of the run.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Schedule {
    /// Every so many steps; this or `interval`.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1))]
    pub every: Option<u64>,
    /// Every so much simulated time [s]; steps land on it exactly. This or `every`.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub interval: Option<f64>,
}

/// The exact answer of a case.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Exact {
    /// Decaying Taylor–Green vortices, from the parameters of `fluid.initial`.
    TaylorGreen,
    /// Plane Poiseuille flow between the two walls of a box, driven by `fluid.forcing`.
    Poiseuille,
    /// Static deflection of the first fibre, clamped at its first node, under its point load (Euler–Bernoulli).
    Cantilever,
    /// Period of the first fibre in simple shear (Jeffery 1922, equivalent aspect ratio of Cox 1971).
    Jeffery,
}
