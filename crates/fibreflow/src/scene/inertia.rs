//! Which inertia a case needs.

use crate::case::{
    self, Boundary, Case, CaseError, Document, Factor, FibreGroup, Forcing, Initial, Placement,
    Profile, Shape,
};
use fibreflow_fluid::Inertia;
use fibreflow_mesh::LocalMesh;
use std::fmt;

/// Below this Reynolds number convection is left out.
const CREEPING: f64 = 0.1;

/// Which inertia a flow has, and why.
#[derive(Clone, Debug)]
pub struct InertiaChoice {
    /// What was chosen.
    pub inertia: Inertia,
    reason: String,
}

impl fmt::Display for InertiaChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = match self.inertia {
            Inertia::Full => "full",
            Inertia::Linear => "linear (unsteady Stokes flow)",
            Inertia::Steady => "none (steady Stokes flow)",
        };
        write!(f, "inertia {name}: {}", self.reason)
    }
}

impl InertiaChoice {
    /// As the case says, or by the Reynolds number that it gives; `bounds` are the lowest and highest coordinates of the
    /// mesh \[m\]. Flow without convection is chosen only where all velocities are known to be small.
    pub fn new(case: &Case, fluid: &case::Fluid, bounds: [[f64; 3]; 2]) -> Self {
        let set = |inertia| Self {
            inertia,
            reason: "as set".to_owned(),
        };
        match fluid.inertia {
            case::Inertia::Full => return set(Inertia::Full),
            case::Inertia::Linear => return set(Inertia::Linear),
            case::Inertia::Steady => return set(Inertia::Steady),
            case::Inertia::Auto => {}
        }
        let [low, high] = bounds;
        let extent = (0..3).map(|c| high[c] - low[c]).fold(0.0, f64::max);
        match largest_speed(case, fluid, bounds, extent) {
            Err(unknown) => Self {
                inertia: Inertia::Full,
                reason: format!("{unknown}, so that no Reynolds number is known"),
            },
            Ok(speed) => {
                let reynolds = fluid.density * speed * extent / fluid.viscosity;
                let creeps = speed > 0.0 && reynolds < CREEPING;
                let relation = if reynolds < CREEPING { "<" } else { "≥" };
                let reason = format!(
                    "Re = {reynolds:.3} {relation} {CREEPING} with at most {speed:.3e} m/s over {extent:.3e} m"
                );
                Self {
                    inertia: if creeps {
                        Inertia::Linear
                    } else {
                        Inertia::Full
                    },
                    reason: if speed > 0.0 {
                        reason
                    } else {
                        "nothing moves at the start".to_owned()
                    },
                }
            }
        }
    }

    /// What does not go with it.
    ///
    /// # Errors
    /// The key that has no meaning with this inertia.
    pub fn check(&self, fluid: &case::Fluid, document: &Document) -> Result<(), Box<CaseError>> {
        let refuse = |path: &str, problem: &str, help: &str| {
            let error = document.error(path, format!("`{path}` {problem} ({self})"));
            Err(error.with_help(help))
        };
        let full = self.inertia == Inertia::Full;
        if full && fluid.hold_mean_velocity {
            let help = "set `fluid.inertia = \"linear\"`, or hold the flow with `fluid.forcing`";
            return refuse(
                "fluid.hold_mean_velocity",
                "needs a flow without convection",
                help,
            );
        }
        if full {
            return Ok(());
        }
        if fluid.diffusion != case::Diffusion::Auto {
            let help = "without convection velocity and pressure are solved for together, always implicitly";
            return refuse("fluid.diffusion", "needs a flow with convection", help);
        }
        if fluid.order != 2 {
            let help = "`order = 2`, or `inertia = \"full\"`";
            return refuse("fluid.order", "must be 2 without convection", help);
        }
        if fluid.frame_velocity != [0.0; 3] {
            let help = "remove it, or set `inertia = \"full\"`";
            return refuse("fluid.frame_velocity", "needs a flow with convection", help);
        }
        if fluid.turbulence.is_some() {
            let help = "remove it, or set `inertia = \"full\"`";
            return refuse("fluid.turbulence", "needs a flow with convection", help);
        }
        if matches!(fluid.forcing, Forcing::Linear { .. }) {
            let help = "linear forcing keeps turbulence alive: `inertia = \"full\"`";
            return refuse("fluid.forcing.kind", "needs a flow with convection", help);
        }
        let convective = |b: &&Boundary| matches!(b, Boundary::ConvectiveOutlet { .. });
        let mut conditions = fluid.boundaries.iter();
        match conditions.find(|(_, b)| convective(b)) {
            None => Ok(()),
            Some((patch, _)) => {
                let help = "without convection an `outlet` lets the flow leave";
                let path = format!("fluid.boundaries.{patch}");
                refuse(&path, "is an outlet that lives on convection", help)
            }
        }
    }
}

/// Lowest and highest coordinates of all nodes \[m\]. Collective.
pub fn bounds(mesh: &LocalMesh) -> [[f64; 3]; 2] {
    let communicator = mesh.halo.communicator();
    let along = |c: usize| mesh.nodes.iter().map(move |x| x[c]);
    let low = [0, 1, 2].map(|c| communicator.min(along(c).fold(f64::INFINITY, f64::min)));
    let high = [0, 1, 2].map(|c| communicator.max(along(c).fold(f64::NEG_INFINITY, f64::max)));
    [low, high]
}

/// No velocity is larger \[m/s\]; or what leaves that open.
fn largest_speed(
    case: &Case,
    fluid: &case::Fluid,
    bounds: [[f64; 3]; 2],
    extent: f64,
) -> Result<f64, String> {
    if let Some(k) = case.fibres.iter().position(|g| drives(case, fluid, g)) {
        return Err(format!("`fibres[{k}]` drives the flow"));
    }
    if !fluid.forces.is_empty() {
        return Err("`fluid.forces` drives the flow".to_owned());
    }
    let mut largest = speed_at_start(&fluid.initial)?;
    largest = largest.max(speed_of_forcing(fluid, extent)?);
    let mut pressures = Vec::new();
    for (patch, condition) in &fluid.boundaries {
        let open = |what: &str| Err(format!("`fluid.boundaries.{patch}` is {what}"));
        let speed = match condition {
            Boundary::Wall {} | Boundary::Slip {} => Some(0.0),
            Boundary::MovingWall { velocity, factor } => times(length(velocity), factor),
            Boundary::RotatingWall {
                point,
                rate,
                factor,
                ..
            } => {
                let [low, high] = bounds;
                let reach =
                    [0, 1, 2].map(|c| (point[c] - low[c]).abs().max((point[c] - high[c]).abs()));
                times(rate.abs() * length(&reach), factor)
            }
            Boundary::Inlet {
                velocity: Some(velocity),
                profile,
                factor,
            } => {
                let peak = if *profile == Profile::Parabolic {
                    2.25
                } else {
                    1.0
                };
                times(peak * length(velocity), factor)
            }
            Boundary::Inlet { .. } => None,
            Boundary::Outlet { pressure, factor } => {
                pressures.push(*pressure);
                if *pressure == 0.0 || factor.is_none() {
                    Some(0.0)
                } else {
                    None
                }
            }
            Boundary::ConvectiveOutlet { .. } => return open("an outlet that lives on convection"),
        };
        match speed {
            Some(speed) => largest = largest.max(speed),
            None => return open("given by a formula or file"),
        }
    }
    if pressures.windows(2).any(|p| p[0] != p[1]) {
        return Err("outlets of different pressure drive the flow".to_owned());
    }
    Ok(largest)
}

/// Weight, loads or stored energy of the fibres set the fluid in motion.
fn drives(case: &Case, fluid: &case::Fluid, group: &FibreGroup) -> bool {
    let heavy = group.density != fluid.density && case.gravity.acceleration != [0.0; 3];
    let bent = matches!(group.placement, Placement::Nodes { .. })
        && !matches!(group.shape, Shape::AsPlaced);
    heavy || bent || !group.point_loads.is_empty()
}

fn speed_at_start(initial: &Initial) -> Result<f64, String> {
    match initial {
        Initial::Rest => Ok(0.0),
        Initial::Uniform { velocity } => Ok(length(velocity)),
        Initial::Poiseuille { bulk_velocity } => Ok(1.5 * length(bulk_velocity)),
        Initial::TaylorGreen {
            amplitude, drift, ..
        } => Ok(amplitude.abs() + drift[0].hypot(drift[1])),
        Initial::PerturbedChannel { .. }
        | Initial::PerturbedPipe { .. }
        | Initial::Isotropic { .. } => Err("`fluid.initial` has random eddies".to_owned()),
        Initial::Expression { .. } | Initial::File { .. } => {
            Err("`fluid.initial` is a formula or file".to_owned())
        }
    }
}

/// A film of the thickness of the whole domain is the fastest that a gradient can drive, if anything holds it.
fn speed_of_forcing(fluid: &case::Fluid, extent: f64) -> Result<f64, String> {
    let open = "`fluid.forcing` drives a flow that nothing holds";
    match &fluid.forcing {
        Forcing::None => Ok(0.0),
        Forcing::Linear { .. } => Err("`fluid.forcing` grows with the flow".to_owned()),
        Forcing::BulkVelocity { value, .. } => Ok(2.25 * value.abs()),
        Forcing::PressureGradient { value, factor } => {
            let holds = |b: &Boundary| !matches!(b, Boundary::Slip {} | Boundary::Outlet { .. });
            if !fluid.boundaries.values().any(holds) {
                return Err(open.to_owned());
            }
            let film = length(value) * extent * extent / (2.0 * fluid.viscosity);
            times(film, factor).ok_or_else(|| "`fluid.forcing` is a formula or file".to_owned())
        }
    }
}

/// A speed times the largest size of its factor, if that is known.
fn times(speed: f64, factor: &Option<Factor>) -> Option<f64> {
    match factor {
        None => Some(speed),
        Some(Factor::Table { values, .. }) => {
            Some(speed * values.iter().fold(0.0, |m: f64, v| m.max(v.abs())))
        }
        Some(_) => None,
    }
}

fn length(v: &[f64; 3]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHEAR: &str = r#"
[time]
end = 1.0
step = 0.1
[mesh]
kind = "box"
size = [2, 1, 1]
cells = [4, 4, 4]
periodic = [true, false, true]
[fluid]
density = 1000.0
viscosity = 1.0
boundaries.y_min = { kind = "wall" }
boundaries.y_max = { kind = "moving-wall", velocity = [4e-5, 0, 0] }
"#;

    /// The choice for a case with another text in the place of one.
    fn choice(old: &str, new: &str) -> InertiaChoice {
        assert!(SHEAR.contains(old));
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("case.toml");
        std::fs::write(&path, SHEAR.replace(old, new)).expect("written");
        let (case, _) = case::load(&path, &[]).expect("a case");
        let fluid = case.fluid.as_ref().expect("fluid");
        InertiaChoice::new(&case, fluid, [[0.0; 3], [2.0, 1.0, 1.0]])
    }

    #[test]
    fn slow_flows_creep_and_the_reason_is_a_number() {
        let slow = choice("4e-5", "4e-5");
        assert_eq!(slow.inertia, Inertia::Linear);
        let text = slow.to_string();
        assert!(
            text.contains("Re = 0.080 < 0.1") && text.contains("4.000e-5 m/s"),
            "{text}"
        );
        let fast = choice("4e-5", "6e-5");
        assert_eq!(fast.inertia, Inertia::Full);
        assert!(fast.to_string().contains("Re = 0.120 ≥ 0.1"), "{fast}");
        let table = "factor = { kind = \"table\", times = [0, 1], values = [0, -2] }";
        let doubled = choice("[4e-5, 0, 0]", &format!("[4e-5, 0, 0], {table}"));
        assert_eq!(doubled.inertia, Inertia::Full);
        assert_eq!(
            choice("[fluid]", "[fluid]\ninertia = \"steady\"").inertia,
            Inertia::Steady
        );
    }

    #[test]
    fn what_is_not_known_keeps_convection() {
        let formula = "[4e-5, 0, 0], factor = { kind = \"formula\", value = \"cos(t)\" }";
        let initial =
            "initial = { kind = \"expression\", velocity = [\"1e-9\", \"0\", \"0\"] }\nviscosity";
        let heavy = "[gravity]\nacceleration = [0, -9.81, 0]\n[[fibres]]\ndiameter = 0.01\nsegments = 4\ndensity = 1200.0\nyoungs_modulus = 1e6\nplacement = { kind = \"line\", start = [0.2, 0.5, 0.5], end = [0.8, 0.5, 0.5] }\n[time]";
        for (old, new, why) in [
            ("[4e-5, 0, 0]", formula, "y_max` is given by a formula"),
            ("viscosity", initial, "`fluid.initial` is a formula"),
            ("[4e-5, 0, 0]", "[0, 0, 0]", "nothing moves"),
            ("[time]", heavy, "`fibres[0]` drives the flow"),
        ] {
            let found = choice(old, new);
            assert_eq!(found.inertia, Inertia::Full, "{found}");
            assert!(found.to_string().contains(why), "{found}");
        }
        // Neutrally buoyant, they move with the flow.
        let light = heavy.replace("1200.0", "1000.0");
        assert_eq!(choice("[time]", &light).inertia, Inertia::Linear);
        // A film of 1 Pa/m over 2 m moves with 2 m/s.
        let driven = "[fluid]\nforcing = { kind = \"pressure-gradient\", value = [1, 0, 0] }";
        let found = choice("[fluid]", driven).to_string();
        assert!(found.contains("Re = 4000.000 ≥ 0.1"), "{found}");
    }
}
