//! The beads of a case.

use crate::case;
use crate::error::ProgramError;
use fibreflow_coupling::smooth_profile::Profile;
use fibreflow_coupling::{BeadSettings, Beads, Chain};
use fibreflow_fluid::{Fluid, Inertia};

/// At their start. Collective.
///
/// # Errors
/// A flow with convection, a direction of no length.
pub fn beads(
    beads: &case::Beads,
    phase: Option<&case::Phase>,
    fluid: &Fluid,
) -> Result<Beads, ProgramError> {
    if fluid.settings().inertia == Inertia::Full {
        return Err(ProgramError::input(
            "[beads]: the flow has convection, and beads are rigid in creeping flow only; `fluid.inertia = \"steady\"` or \"linear\"",
        ));
    }
    let width = beads.interface_width.or(phase.map(|p| p.interface_width));
    let width = width.unwrap_or(beads.radius / 6.0);
    let mut settings = BeadSettings::new(Profile {
        radius: beads.radius,
        width,
        cutoff: beads.cutoff.unwrap_or(5.0 * width),
    });
    settings.screening = beads.screening;
    let chain = |(k, chain): (usize, &case::BeadChain)| {
        if chain.direction == [0.0; 3] {
            return Err(ProgramError::input(format!(
                "`beads.chains[{k}].direction` has no length"
            )));
        }
        Ok(Chain {
            start: chain.start,
            direction: chain.direction,
            count: chain.count,
            psi_0: chain.psi_0,
            youngs_modulus: chain.youngs_modulus,
            fixed: chain.fixed,
        })
    };
    let chains: Result<Vec<Chain>, ProgramError> =
        beads.chains.iter().enumerate().map(chain).collect();
    Ok(Beads::new(fluid, settings, &chains?))
}
