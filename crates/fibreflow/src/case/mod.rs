//! The case file: typed schema, defaults, checks.
//!
//! A case is one TOML file. [`load`] reads it, applies `--set` overrides, checks it against the JSON schema that is
//! generated from the types here (so that every complaint names a key, its value and what would be valid), and then
//! against the rules that no schema can say (`validate.rs`).

// Units stand in plain brackets here: users read these comments as descriptions of the schema.
#![allow(rustdoc::broken_intra_doc_links)]

mod beads;
mod boundary;
mod contact;
mod coupling;
mod dimensionless;
mod document;
mod error;
mod fibres;
mod fluid;
mod force;
mod linked;
mod loads;
mod mechanics;
mod mesh;
mod network;
mod observables;
mod phase;
mod population;
mod run;
mod samples;
mod schema;
mod statistics;
mod validate;

pub use beads::{BeadChain, Beads};
pub use boundary::{Boundary, Factor, Profile};
pub use contact::{Contact, ContactWall, Lubrication, LubricationModel, Repulsion, VanDerWaals};
pub use coupling::{Correction, Coupling, CouplingMode, KernelKind, Scheme};
pub use dimensionless::Dimensionless;
pub use document::{Document, Place};
pub use error::CaseError;
pub use fibres::{
    AmbientFlow, Clamp, DragLaw, FibreGroup, Form, Gravity, Hydrodynamics, Joints, Kinematics,
    Placement, PointLoad, Shape, SlenderBody, Spheroid, TorqueLaw,
};
pub use fluid::{
    ChannelProfile, Diffusion, Fluid, Forcing, Inertia, Initial, Kernels, Mass, Poisson,
    Preconditioner, Turbulence, TurbulenceModel,
};
pub use force::PointForce;
pub use loads::{Coefficients, Loads};
pub use mechanics::{IntegratorKind, Mechanics};
pub use mesh::{Ambient, BoxElement, Domain, MeshSource, PeriodicPair, Stretching};
pub use network::{Face, Grips, Piston};
pub use observables::Observables;
pub use phase::{Phase, Solid};
pub use population::{Axis, Orbits, Orientation, Quantity, Region, Shortfall, Spread};
pub use run::{Exact, Output, Schedule, Time};
pub use samples::{SamplePoints, Samples};
pub use schema::{check_against, json_schema};
pub use statistics::{Average, Line, Statistics};
pub use validate::{validate_domain, validate_patches};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// A case file. All quantities are in SI units: m, kg, s, N, Pa.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Case {
    /// What the case is about.
    #[serde(rename = "case", default)]
    pub about: About,
    /// How long and in which steps.
    pub time: Time,
    /// The mesh of the fluid; goes with `[fluid]`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mesh: Option<MeshSource>,
    /// The fluid that is solved for; goes with `[mesh]`. Either this or `[ambient]`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fluid: Option<Fluid>,
    /// A second fluid beside the one of `[fluid]`, with surface tension; needs `[fluid]`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub phase: Option<Phase>,
    /// Rigid beads in creeping flow, alone or joined to fibres; needs `[fluid]`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub beads: Option<Beads>,
    /// Dimensionless numbers in place of viscosity, surface tension, diffusivity and Young's modulus of beads.
    #[serde(default, skip_serializing)]
    pub dimensionless: Option<Dimensionless>,
    /// A prescribed analytic flow in place of `[mesh]` and `[fluid]`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ambient: Option<Ambient>,
    /// Groups of equal fibres.
    #[serde(default)]
    pub fibres: Vec<FibreGroup>,
    /// Contacts between segments and with walls; without this table there are none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub contact: Option<Contact>,
    /// A face of the box that a weight presses on linked fibres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub piston: Option<Piston>,
    /// Planes that pull linked fibres apart.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub grips: Option<Grips>,
    /// How fibres advance in time.
    #[serde(default)]
    pub mechanics: Mechanics,
    /// Drag and torque laws.
    #[serde(default)]
    pub hydrodynamics: Hydrodynamics,
    /// How fibres and fluid act on each other.
    #[serde(default)]
    pub coupling: Coupling,
    /// Gravity.
    #[serde(default)]
    pub gravity: Gravity,
    /// What is written and when.
    #[serde(default)]
    pub output: Output,
    /// The exact answer, where the case has one; `summary.json` then lists the errors.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub exact: Option<Exact>,
}

impl Case {
    /// Shear rate that `kinematics = "auto"` judges by \[1/s\].
    pub fn shear_rate(&self) -> Option<f64> {
        let prescribed = self
            .ambient
            .as_ref()
            .and_then(|ambient| match ambient.flow {
                AmbientFlow::Quiescent | AmbientFlow::Uniform { .. } => None,
                AmbientFlow::Shear { rate }
                | AmbientFlow::Extension { rate }
                | AmbientFlow::PlanarExtension { rate } => Some(rate.abs()),
                AmbientFlow::Vortex {
                    velocity,
                    wavelength,
                } => Some((2.0 * std::f64::consts::PI * velocity / wavelength).abs()),
            });
        self.mechanics.shear_rate.or(prescribed)
    }

    /// Whether the fibres are chains of rigid segments.
    pub fn linked(&self) -> bool {
        let linked = |group: &FibreGroup| group.kinematics == Kinematics::Linked;
        self.fibres.first().is_some_and(linked)
    }

    /// The box that holds the fibres, if the case says what it is.
    pub fn domain(&self) -> Option<Domain> {
        match (&self.mesh, &self.ambient) {
            (
                Some(MeshSource::Box {
                    origin,
                    size,
                    periodic,
                    ..
                }),
                _,
            ) => Some(Domain {
                origin: *origin,
                size: *size,
                periodic: *periodic,
            }),
            (None, Some(ambient)) => ambient.domain.clone(),
            _ => None,
        }
    }
}

/// What the case is about.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct About {
    /// Title, shown at the start of a run.
    pub title: String,
}

/// Reads and checks a case file.
///
/// `overrides` are `key=value` pairs as given to `--set`: dotted keys, list entries by number, TOML values (a value that is
/// not TOML is taken as a string).
///
/// # Errors
/// [`CaseError`] with the file, line, key and value of the first thing that is wrong.
pub fn load(path: &Path, overrides: &[String]) -> Result<(Case, Document), Box<CaseError>> {
    let mut document = Document::read(path)?;
    for text in overrides {
        document.set(text)?;
    }
    let case = parse(&mut document)?;
    Ok((case, document))
}

fn parse(document: &mut Document) -> Result<Case, Box<CaseError>> {
    dimensionless::resolve(document)?;
    schema::check(document)?;
    let case: Case = document.value().clone().try_into().map_err(
        // The schema has accepted the document, so this is a rule that only serde knows.
        |e: toml::de::Error| document.error("", e.message().to_owned()),
    )?;
    validate::validate(&case, document)?;
    Ok(case)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn complaint(text: &str, overrides: &[&str]) -> String {
        let mut document = Document::parse("case.toml", text).expect("toml");
        for o in overrides {
            document.set(o).expect("override");
        }
        let error = parse(&mut document).expect_err("the case is wrong");
        error.render()
    }

    const GOOD: &str = r#"
[time]
end = 1.0
step = 0.1

[mesh]
kind = "box"
size = [1, 1, 1]
cells = [4, 4, 4]
periodic = [true, false, true]

[fluid]
density = 1000.0
viscosity = 0.1
boundaries.y_min = { kind = "wall" }
boundaries.y_max = { kind = "wall" }

[[fibres]]
length = 0.1
diameter = 0.01
segments = 4
youngs_modulus = 1e6
density = 1000.0
placement = { kind = "random", count = 3, seed = 1 }
"#;

    #[test]
    fn defaults_are_filled_in() {
        let mut document = Document::parse("case.toml", GOOD).expect("toml");
        let case = parse(&mut document).expect("a good case");
        assert_eq!(case.fibres[0].poisson_ratio, 0.3);
        let text = toml::to_string(&case).expect("written");
        let mut again = Document::parse("resolved.toml", &text).expect("toml");
        parse(&mut again).expect("the resolved case is a case");
    }

    /// A drop and two chains in units in which nothing is 1.
    const DROP: &str = r#"
[time]
end = 1.0
step = 0.1

[mesh]
kind = "box"
size = [8, 8, 1]
cells = [16, 16, 2]
periodic = [true, true, true]

[fluid]
density = 3
inertia = "steady"

[phase]
interface_width = 1
initial = "1"

[dimensionless]
reynolds = 0.01
weber = 0.1
peclet = 2
elastocapillary = 40
length = 0.5
velocity = 7.0

[beads]
radius = 2.0
chains = [{ start = [2, 2, 0], count = 2 }, { start = [2, 6, 0], count = 2, youngs_modulus = 5 }]
"#;

    #[test]
    fn dimensionless_numbers_give_constants() {
        let mut document = Document::parse("case.toml", DROP).expect("toml");
        let case = parse(&mut document).expect("a good case");
        let (fluid, phase) = (case.fluid.as_ref(), case.phase.as_ref());
        let (fluid, phase) = (fluid.expect("a fluid"), phase.expect("a phase"));
        let beads = case.beads.as_ref().expect("beads");
        // ρU²Δ = 73.5, and a link of k_0 = πr_bE/2.
        let stiffness = std::f64::consts::PI * 2.0 * beads.chains[0].youngs_modulus / 2.0;
        let near = |found: f64, wanted: f64| assert!((found / wanted - 1.0).abs() < 1e-14);
        near(fluid.viscosity, 3.0 * 7.0 * 0.5 / 0.01);
        near(phase.diffusivity, 7.0 * 0.5 / 2.0);
        near(phase.surface_tension, 8_f64.sqrt() / 3.0 * 2.0 * 735.0);
        near(stiffness, 40.0 * 735.0);
        assert_eq!(beads.chains[1].youngs_modulus, 5.0);

        let text = toml::to_string(&case).expect("written");
        let mut again = Document::parse("resolved.toml", &text).expect("toml");
        let case = parse(&mut again).expect("the resolved case is a case");
        assert!(case.dimensionless.is_none());
    }

    #[test]
    fn dimensionless_numbers_that_do_not_fit() {
        let message = complaint(DROP, &["fluid.viscosity=1.0"]);
        assert!(message.contains("dimensionless.reynolds"), "{message}");
        assert!(message.contains("leave one of them out"), "{message}");
        let message = complaint(DROP, &["dimensionless.weber=-1"]);
        assert!(message.contains("dimensionless.weber = -1"), "{message}");
        let message = complaint(&DROP.replace("weber = 0.1", ""), &[]);
        assert!(message.contains("needs `dimensionless.weber`"), "{message}");
        let message = complaint(GOOD, &["dimensionless.peclet=1.0"]);
        assert!(message.contains("there is no `phase`"), "{message}");
        let message = complaint(DROP, &["dimensionless.capillary=1.0"]);
        assert!(message.contains("dimensionless.capillary"), "{message}");
        let message = complaint(&DROP.replace("density = 3", ""), &[]);
        assert!(message.contains("density"), "{message}");
    }

    #[test]
    fn an_unknown_key_names_its_neighbour() {
        let text = GOOD.replace("viscosity = 0.1", "viscosity = 0.1\nviscocity = 2");
        let message = complaint(&text, &[]);
        assert!(message.contains("fluid.viscocity"), "{message}");
        assert!(message.contains("did you mean `viscosity`"), "{message}");
        assert!(message.contains("case.toml:15"), "{message}");
    }

    #[test]
    fn a_wrong_type_names_key_and_value() {
        let message = complaint(&GOOD.replace("end = 1.0", "end = \"long\""), &[]);
        assert!(
            message.contains("time.end = \"long\"") && message.contains("number"),
            "{message}"
        );
    }

    #[test]
    fn bounds_hold_for_overrides_too() {
        let message = complaint(GOOD, &["fluid.viscosity=-1"]);
        assert!(
            message.contains("fluid.viscosity = -1") && message.contains("greater than 0"),
            "{message}"
        );
        assert!(message.contains("--set"), "{message}");
        let message = complaint(GOOD, &["fibres.0.placement.kind=randon"]);
        assert!(
            message.contains("fibres[0].placement.kind") && message.contains("`random`"),
            "{message}"
        );
    }

    #[test]
    fn spectra_go_along_planes_and_around_rings() {
        let average = |kind: &str, spectra: &str| {
            format!(
                "{GOOD}\n[output.statistics]\naverage = {{ kind = {kind} }}\nspectra = [{spectra}]\n"
            )
        };
        let planes = r#""planes", normal = "y", flow = "x""#;
        for (kind, line) in [
            (planes, "around"),
            (planes, "y"),
            (r#""rings", axis = "x""#, "z"),
        ] {
            let message = complaint(&average(kind, &format!("\"{line}\"")), &[]);
            assert!(message.contains("across the planes or rings"), "{message}");
        }
        let text = average(r#""rings", axis = "x""#, r#""x", "around""#);
        let mut document = Document::parse("case.toml", &text).expect("toml");
        parse(&mut document).expect("a good case");
    }

    #[test]
    fn rules_across_keys_are_checked() {
        let message = complaint(&GOOD.replace("step = 0.1", ""), &[]);
        assert!(
            message.contains("time") && message.contains("cfl"),
            "{message}"
        );
        let message = complaint(GOOD, &["fibres.0.diameter=0.2"]);
        assert!(message.contains("fibres[0].diameter"), "{message}");
        let message = complaint(GOOD, &["fibres.0.kinematics=auto"]);
        assert!(message.contains("mechanics.shear_rate"), "{message}");
        let rigid = ["fibres.0.kinematics=rigid", "fibres.0.clamp=first"];
        let message = complaint(GOOD, &rigid);
        assert!(message.contains("fibres[0].clamp"), "{message}");
    }

    #[test]
    fn couplings_that_do_not_fit_are_refused() {
        for (overrides, key) in [
            (&["coupling.kernel=gaussian"][..], "coupling.width"),
            (&["coupling.width=0.3"], "coupling.width"),
            (&["coupling.correction=undisturbed"], "coupling.correction"),
            (
                &[
                    "coupling.kernel=gaussian",
                    "coupling.width=0.2",
                    "coupling.mode=one-way",
                    "coupling.correction=undisturbed",
                ],
                "coupling.correction",
            ),
            (
                &["coupling.mode=one-way", "coupling.scheme=iterated"],
                "coupling.scheme",
            ),
            (&["coupling.tolerance=0"], "coupling.tolerance"),
            (&["coupling.kernel=gauss"], "coupling.kernel"),
        ] {
            let message = complaint(GOOD, overrides);
            assert!(message.contains(key), "{overrides:?}: {message}");
        }
    }

    #[test]
    fn contact_laws_are_checked() {
        let with = |text: &str| {
            complaint(
                &format!("{GOOD}\n[contact]\nstiffness = 1.0\n{text}\n"),
                &[],
            )
        };
        let message = with("lubrication = { roughness = 1e-3, range = 1e-4 }");
        assert!(
            message.contains("contact.lubrication.roughness = 0.001")
                && message.contains("below the range"),
            "{message}"
        );
        let message = with("repulsion = { strength = -1, decay = 1e-4, range = 1e-3 }");
        assert!(
            message.contains("contact.repulsion.strength = -1"),
            "{message}"
        );
        let message = with("walls = [{ kind = \"tube\", point = [0, 0, 0] }]");
        assert!(
            message.contains("contact.walls[0].kind") && message.contains("pipe"),
            "{message}"
        );
    }
}
