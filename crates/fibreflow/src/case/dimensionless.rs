//! Two fluids and beads by dimensionless numbers in place of material constants.

use super::{CaseError, Document, schema};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// Numbers of Lecrivain et al. 2020 (L 39–42); what they stand for is then left out elsewhere.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Dimensionless {
    /// Reynolds number Re = ρUΔ/η, in place of `fluid.viscosity`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub reynolds: Option<f64>,
    /// Weber number We = ρU²Δ/σ_0 with σ_0 the energy density of mixing times Δ, in place of `phase.surface_tension` = (√8/3)(ξ/Δ)σ_0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub weber: Option<f64>,
    /// Péclet number Pe = UΔ/D, in place of `phase.diffusivity`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub peclet: Option<f64>,
    /// Elasto-capillary number Ec = k_0/σ_0 with the stiffness k_0 = πr_bE/2 of a link, in place of `youngs_modulus` of the chains of beads that have none; needs `weber`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0))]
    pub elastocapillary: Option<f64>,
    /// Length Δ of these numbers [m]; L takes the spacing of the mesh.
    #[serde(default = "one")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub length: f64,
    /// Velocity U of these numbers [m/s].
    #[serde(default = "one")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub velocity: f64,
}

fn one() -> f64 {
    1.0
}

/// Puts the constants where the numbers stand for them.
///
/// # Errors
/// [`CaseError`] when a number is wrong, a constant is given twice, or there is no place for it.
pub(super) fn resolve(document: &mut Document) -> Result<(), Box<CaseError>> {
    let Some(table) = document.value().get("dimensionless").cloned() else {
        return Ok(());
    };
    schema::check_part::<Dimensionless>(document, &table, "dimensionless")?;
    let numbers: Dimensionless = table
        .try_into()
        .map_err(|e: toml::de::Error| document.error("dimensionless", e.message().to_owned()))?;
    // Where a number that is needed is missing or none, the check of the whole file says so.
    let Some(density) = document.number("fluid.density") else {
        return Ok(());
    };
    let (length, velocity) = (numbers.length, numbers.velocity);
    if let Some(reynolds) = numbers.reynolds {
        let viscosity = density * velocity * length / reynolds;
        document.derive("fluid.viscosity", viscosity, "dimensionless.reynolds")?;
    }
    if let Some(peclet) = numbers.peclet {
        let diffusivity = velocity * length / peclet;
        document.derive("phase.diffusivity", diffusivity, "dimensionless.peclet")?;
    }
    let inertia = density * velocity * velocity * length;
    if let (Some(weber), Some(width)) = (numbers.weber, document.number("phase.interface_width")) {
        let tension = 8_f64.sqrt() / 3.0 * width / length * inertia / weber;
        document.derive("phase.surface_tension", tension, "dimensionless.weber")?;
    }
    let from = "dimensionless.elastocapillary";
    match (
        numbers.elastocapillary,
        numbers.weber,
        document.number("beads.radius"),
    ) {
        (Some(_), None, _) => {
            Err(document.error(from, format!("`{from}` needs `dimensionless.weber`")))
        }
        (Some(elastocapillary), Some(weber), Some(radius)) => {
            let modulus = 2.0 * elastocapillary * inertia / weber / (PI * radius);
            for key in without_modulus(document) {
                document.derive(&key, modulus, from)?;
            }
            Ok(())
        }
        _ => Ok(()),
    }
}

/// Keys of the moduli of chains that have none.
fn without_modulus(document: &Document) -> Vec<String> {
    let chains = document
        .value()
        .get("beads")
        .and_then(|beads| beads.get("chains"));
    let chains = chains.and_then(toml::Value::as_array).into_iter().flatten();
    let soft = chains
        .enumerate()
        .filter(|(_, chain)| chain.get("youngs_modulus").is_none());
    soft.map(|(k, _)| format!("beads.chains.{k}.youngs_modulus"))
        .collect()
}
