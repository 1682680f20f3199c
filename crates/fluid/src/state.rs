//! What a checkpoint holds, and the search for values that are not finite.

use crate::poisson::PAST;
use crate::{Fluid, FluidError};
use fibreflow_parallel::block_sum;
use fibreflow_solve::SolveError;

/// All that a bitwise restart needs, by owned node and by owned row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FluidState {
    /// (name, numbers per node, values of the owned nodes in local order).
    pub node: Vec<(String, usize, Vec<f64>)>,
    /// (name, values of the owned rows in the order of [`fibreflow_mesh::DualGeometry`]).
    pub pair: Vec<(String, Vec<f64>)>,
    /// (name, value).
    pub scalars: Vec<(String, f64)>,
}

const VELOCITY: &str = "fluid.velocity";
const PRESSURE: &str = "fluid.pressure";
/// What the initial guess of the pressure solve is made of; none with direct solves.
const PAST_PRESSURE: &str = "fluid.pressure_past";
/// At the end of the last step and one step earlier.
const THROUGH: &str = "fluid.boundary_flux";
const FLUX: &str = "fluid.flux";
const FLUX_PREVIOUS: &str = "fluid.flux_previous";
const TIME: &str = "fluid.time";
const FLUX_RATE: &str = "fluid.flux_rate";
const EDDY_RATE: &str = "fluid.eddy_rate";
const LAST_DT: &str = "fluid.last_dt";
const STEPS: &str = "fluid.steps";
const DRIVING: [&str; 3] = ["fluid.driving_x", "fluid.driving_y", "fluid.driving_z"];

impl FluidState {
    pub(crate) fn node(
        &self,
        name: &str,
        width: usize,
        nodes: usize,
    ) -> Result<&[f64], FluidError> {
        let found = self.node.iter().find(|(n, ..)| n == name);
        let (_, stored, values) = found.ok_or_else(|| problem(name, "is missing"))?;
        if *stored != width || values.len() != width * nodes {
            let expected = format!("has {} values, expected {}", values.len(), width * nodes);
            return Err(problem(name, &expected));
        }
        Ok(values)
    }

    fn pair(&self, name: &str, entries: usize) -> Result<&[f64], FluidError> {
        let found = self.pair.iter().find(|(n, _)| n == name);
        let (_, values) = found.ok_or_else(|| problem(name, "is missing"))?;
        if values.len() != entries {
            let expected = format!("has {} values, expected {entries}", values.len());
            return Err(problem(name, &expected));
        }
        Ok(values)
    }

    pub(crate) fn scalar(&self, name: &str) -> Result<f64, FluidError> {
        let found = self.scalars.iter().find(|(n, _)| n == name);
        let (_, value) = found.ok_or_else(|| problem(name, "is missing"))?;
        Ok(*value)
    }
}

fn past_scalar(number: usize) -> String {
    format!("{PAST_PRESSURE}_{number}")
}

fn problem(name: &str, problem: &str) -> FluidError {
    FluidError::State {
        name: name.into(),
        problem: problem.into(),
    }
}

impl Fluid {
    /// The state of the owned nodes and rows. The body force is the caller's; wall forces come again with a step.
    pub fn state(&self) -> FluidState {
        let owned = self.mesh.owned();
        let velocity = &self.velocity[..owned];
        let node = |name: &str, values: &[f64]| (name.to_owned(), 1, values[..owned].to_vec());
        let components = velocity.iter().flat_map(|u| [u[0], u[1], u[2]]).collect();
        let mut scalars = vec![
            (TIME.to_owned(), self.time),
            (FLUX_RATE.to_owned(), self.flux_rate),
            (LAST_DT.to_owned(), self.last_dt),
            (STEPS.to_owned(), self.steps as f64),
        ];
        scalars.extend(DRIVING.map(str::to_owned).into_iter().zip(self.driving));
        if let Some(eddy) = &self.eddy {
            scalars.push((EDDY_RATE.to_owned(), eddy.rate));
        }
        let mut fields = vec![
            (VELOCITY.to_owned(), 3, components),
            node(PRESSURE, &self.pressure),
        ];
        if let Some(past) = self.poisson.past() {
            let (nodes, others) = past.state();
            fields.push((PAST_PRESSURE.to_owned(), PAST, nodes));
            let named = others.into_iter().enumerate();
            scalars.extend(named.map(|(k, value)| (past_scalar(k), value)));
        }
        if self.boundary.moves {
            fields.push((THROUGH.to_owned(), 2, self.boundary.fluxes(owned)));
        }
        FluidState {
            node: fields,
            pair: vec![
                (FLUX.to_owned(), self.operators.to_entries(&self.flux)),
                (
                    FLUX_PREVIOUS.to_owned(),
                    self.operators.to_entries(&self.flux_other),
                ),
            ],
            scalars,
        }
    }

    /// Goes on from a stored state: bitwise on the same ranks. Entries that are not the fluid's are ignored. Collective.
    ///
    /// # Errors
    /// [`FluidError::State`] when something is missing or of the wrong length, [`FluidError::NotFinite`] for values
    /// that are not finite; nothing is changed in the first case.
    pub fn restore(&mut self, state: FluidState) -> Result<(), FluidError> {
        let entries = self.operators.geometry.columns.len();
        let owned = self.mesh.owned();
        let velocity = state.node(VELOCITY, 3, owned)?;
        let pressure = state.node(PRESSURE, 1, owned)?;
        let past = self.poisson.past();
        let past = past.map(|_| state.node(PAST_PRESSURE, PAST, owned));
        let past = past.transpose()?;
        let flux = state.pair(FLUX, entries)?;
        let flux_previous = state.pair(FLUX_PREVIOUS, entries)?;
        let (last_dt, steps) = (state.scalar(LAST_DT)?, state.scalar(STEPS)?);
        let time = state.scalar(TIME)?;
        let through = self.boundary.moves.then(|| state.node(THROUGH, 2, owned));
        let through = through.transpose()?;
        let flux_rate = state.scalar(FLUX_RATE)?;
        let eddy_rate = (self.eddy.as_ref()).map(|_| state.scalar(EDDY_RATE));
        let eddy_rate = eddy_rate.transpose()?;
        let mut driving = [0.0; 3];
        for (value, name) in driving.iter_mut().zip(DRIVING) {
            *value = state.scalar(name)?;
        }
        for (u, v) in self.velocity.iter_mut().zip(velocity.chunks_exact(3)) {
            *u = [v[0], v[1], v[2], 0.0];
        }
        self.pressure[..owned].copy_from_slice(pressure);
        if let (Some(nodes), Some(past)) = (past, self.poisson.past_mut()) {
            let others = (0..).map_while(|k| state.scalar(&past_scalar(k)).ok());
            past.restore(nodes, &others.collect::<Vec<_>>());
        }
        self.operators.take_entries(flux, &mut self.flux);
        self.operators
            .take_entries(flux_previous, &mut self.flux_other);
        self.mesh.halo.update(&mut self.velocity);
        self.mesh.halo.update(&mut self.pressure);
        self.flux_rate = flux_rate;
        if let (Some(eddy), Some(rate)) = (&mut self.eddy, eddy_rate) {
            eddy.rate = rate;
        }
        (self.last_dt, self.steps, self.driving) = (last_dt, steps as u64, driving);
        self.time = time;
        if let Some(through) = through {
            self.boundary.restore(&self.velocity, through);
        }
        self.reaction.fill([0.0; 4]);
        self.check_finite()
    }

    /// Refuses a velocity or pressure that is not finite, on any rank.
    pub(crate) fn check_finite(&self) -> Result<(), FluidError> {
        let owned = self.mesh.owned();
        // 0·x is NaN for infinities and NaN, zero otherwise.
        let marked = block_sum(owned, |range| {
            let mark = |i: usize| {
                let u = self.velocity[i];
                0.0 * (u[0] + u[1] + u[2] + self.pressure[i])
            };
            range.map(mark).sum()
        });
        if !self.mesh.halo.communicator().any(marked.is_nan()) {
            return Ok(());
        }
        self.find_non_finite().map_or(Ok(()), Err)
    }

    /// The first node, over ranks, whose value is not finite. Collective.
    fn find_non_finite(&self) -> Option<FluidError> {
        const FIELDS: [&str; 4] = ["body force", "velocity", "pressure", "predicted velocity"];
        // Beyond this, squares overflow and solves fail first.
        const LIMIT: f64 = 1e100;
        let vector = |v: &[f64; 4]| v.iter().all(|x| x.abs() < LIMIT);
        let bad = |field: usize, i: usize| match field {
            0 => !vector(&self.body_force[i]),
            1 => !vector(&self.velocity[i]),
            2 => !vector(&[self.pressure[i]; 4]),
            _ => !vector(&self.momentum.next[i]),
        };
        let owned = self.mesh.owned();
        let first = (0..FIELDS.len())
            .find_map(|field| (0..owned).find(|&i| bad(field, i)).map(|i| (field, i)));
        let record = first.map(|(field, i)| {
            let [x, y, z] = self.mesh.nodes[i];
            [field as f64, self.mesh.global_nodes[i] as f64, x, y, z]
        });
        let records = self.mesh.halo.communicator().all_gather(record.as_slice());
        let [field, node, x, y, z] = *records.iter().flatten().next()?;
        Some(FluidError::NotFinite {
            field: FIELDS[field as usize],
            node: node as u64,
            position: [x, y, z],
            step: self.steps,
        })
    }

    /// Names the node when a solve failed for a value that is not finite. Collective.
    pub(crate) fn solve_failed(&self, equation: &'static str, source: SolveError) -> FluidError {
        let culprit = match source {
            SolveError::NotFinite { .. } => self.find_non_finite(),
            _ => None,
        };
        culprit.unwrap_or(FluidError::Solve { equation, source })
    }
}
