//! The second fluid of a case.

use super::expression::Expression;
use crate::case;
use crate::error::ProgramError;
use fibreflow_fluid::{Fluid, FluidError, PhaseField, PhaseReport, PhaseSettings, affinity};

/// The order parameter with what the case wants of it.
pub struct Phase {
    /// The solver.
    pub field: PhaseField,
    /// Part of the free energy that may go in a step.
    decay: Option<f64>,
    /// Body force of the case \[N/m³\] by node, total length.
    given: Vec<[f64; 4]>,
}

impl Phase {
    /// At its start; `forces` are those of the case. Collective.
    ///
    /// # Errors
    /// Formulas that cannot be read or give values that are not finite.
    pub fn new(
        phase: &case::Phase,
        fluid: &Fluid,
        forces: &[[f64; 4]],
    ) -> Result<Self, ProgramError> {
        let read = |key: &str, text: &str| {
            Expression::parse(text, &["x", "y", "z"])
                .map_err(|e| ProgramError::input(format!("phase.{key}: {e}")))
        };
        let initial = read("initial", &phase.initial)?;
        let as_input = |e: FluidError| ProgramError::input(format!("[phase]: {e}"));
        let mut settings = PhaseSettings::new(
            phase.surface_tension,
            phase.interface_width,
            phase.diffusivity,
        );
        settings.solver.relative_tolerance = phase.tolerance;
        let mut field = PhaseField::new(fluid, settings).map_err(as_input)?;
        if let Some(solid) = &phase.solid {
            let fraction = read("solid.fraction", &solid.fraction)?;
            let wanted = affinity(solid.psi_0);
            let nodes = field.solid_mut().iter_mut().zip(&fluid.mesh().nodes);
            nodes.for_each(|(solid, x)| *solid = [fraction.at(x), wanted]);
        }
        field
            .set(fluid, |x| initial.at(&x))
            .map_err(|e| ProgramError::input(format!("phase.initial: {e}")))?;
        let mut given = vec![[0.0; 4]; fluid.mesh().total()];
        given[..forces.len()].copy_from_slice(forces);
        Ok(Self {
            field,
            decay: phase.decay,
            given,
        })
    }

    /// Moves ψ on in the present flow, then writes the force of the case and of capillarity. Collective.
    ///
    /// # Errors
    /// A step that is not solved.
    pub fn advance(
        &mut self,
        fluid: &Fluid,
        dt: f64,
        forces: &mut Vec<[f64; 4]>,
    ) -> Result<PhaseReport, ProgramError> {
        let report = self.field.advance(fluid, dt)?;
        forces.clone_from(&self.given);
        self.field.add_force(fluid, forces);
        Ok(report)
    }

    /// Longest step that the free energy asks for \[s\]. Collective.
    pub fn suggest_dt(&self, fluid: &Fluid, longest: f64) -> f64 {
        match self.decay {
            Some(decay) => self.field.suggest_dt(fluid, decay, longest),
            None => longest,
        }
    }
}
