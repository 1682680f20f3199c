//! The stress of the suspension by its parts.

use crate::case::Case;
use crate::scene::{Flow, Scene};
use fibreflow_fibre::{FibreSystem, Inside, Matrix3, Shear, Vector3};
use fibreflow_fluid::Fluid;

pub(super) const COMPONENTS: [(&str, usize, usize); 6] = [
    ("xx", 0, 0),
    ("xy", 0, 1),
    ("xz", 0, 2),
    ("yy", 1, 1),
    ("yz", 1, 2),
    ("zz", 2, 2),
];

/// The columns of `series/stress.csv`: means over the domain \[Pa\], without the pressure (traces are zero).
pub struct StressColumns {
    shear: Shear,
    inside: Inside,
    viscosity: f64,
    /// Of the domain, less what lies nearer to walls than the margin \[m³\].
    volume: f64,
    /// Of the domain \[m³\].
    whole: f64,
    walls: Option<Walls>,
}

/// The two faces of a box across the gradient of the shear.
struct Walls {
    /// Indices of the patches at the low and the high face.
    patches: [usize; 2],
    /// Area of one \[m²\].
    area: f64,
}

/// Where the centre of a fibre must be for it to count: the domain less the margin along its walls.
pub fn inside(case: &Case) -> Inside {
    let mut inside = Inside::EVERYWHERE;
    let margin = (case.output.observables.as_ref()).map_or(0.0, |about| about.wall_margin);
    let Some(domain) = case.domain().filter(|_| margin > 0.0) else {
        return inside;
    };
    for c in (0..3).filter(|&c| !domain.periodic[c]) {
        inside.low[c] = domain.origin[c] + margin;
        inside.high[c] = domain.origin[c] + domain.size[c] - margin;
    }
    inside
}

impl StressColumns {
    /// For a case with fluid or a prescribed flow in a domain.
    pub fn new(case: &Case, scene: &Scene, shear: Shear) -> Self {
        let inside = inside(case);
        let viscosity = match (&case.fluid, &case.ambient) {
            (Some(fluid), _) => fluid.viscosity,
            (None, ambient) => ambient.as_ref().map_or(0.0, |ambient| ambient.viscosity),
        };
        let of_mesh = || scene.flow.fluid().map_or(f64::INFINITY, Fluid::volume);
        let domain = case.domain();
        let whole = domain.as_ref().map(|d| d.size.iter().product());
        let narrowed = domain.map(|domain| {
            let edge = |c: usize| domain.size[c].min(inside.high[c] - inside.low[c]);
            edge(0) * edge(1) * edge(2)
        });
        Self {
            volume: narrowed.unwrap_or_else(of_mesh),
            whole: whole.unwrap_or_else(of_mesh),
            walls: scene
                .flow
                .fluid()
                .and_then(|f| Walls::find(case, f, &shear)),
            shear,
            inside,
            viscosity,
        }
    }

    /// Names of the columns.
    pub fn names(&self) -> Vec<String> {
        let parts = ["fluid", "particle", "contact"].into_iter();
        let mut names: Vec<String> = parts
            .flat_map(|part| COMPONENTS.map(|(component, ..)| format!("{part}_{component}")))
            .collect();
        names.extend(["n1", "n2", "mu_rel", "mu_rel_particle"].map(str::to_owned));
        if self.walls.is_some() {
            names.extend(["mu_rel_wall", "mu_rel_whole"].map(str::to_owned));
        }
        names
    }

    /// A line. N1 and N2 are of the sum of the parts; `mu_rel` is the sum by 2μE along flow and gradient (K 6.14),
    /// `mu_rel_particle` without contacts, `mu_rel_wall` the mean shear stress of the two walls by the same, zero before the first step,
    /// and beside it `mu_rel_whole` the sum with all fibres, those near walls too. All are zero where there is no shear.
    /// Collective.
    pub fn values(&self, scene: &Scene, fibres: &FibreSystem) -> Vec<f64> {
        let add = |sum: Matrix3| {
            let mut numbers: Vec<f64> = sum.iter().copied().collect();
            scene.communicator.sum_slice(&mut numbers);
            Matrix3::from_column_slice(&numbers)
        };
        let mean = |sum: Matrix3| add(sum) / self.volume;
        let fluid = self.strain_rate(scene) * (2.0 * self.viscosity);
        let particle = mean(fibres.particle_stress(&self.inside));
        let contact = mean(fibres.contact_stress(&self.inside));
        let parts = [fluid, particle, contact].into_iter();
        let mut values: Vec<f64> = parts
            .flat_map(|part| COMPONENTS.map(|(_, i, j)| part[(i, j)]))
            .collect();

        let (flow, gradient, vorticity) =
            (self.shear.flow, self.shear.gradient, self.shear.vorticity());
        let total = fluid + particle + contact;
        let normal = |axis: &Vector3| axis.dot(&(total * axis));
        values.push(normal(&flow) - normal(&gradient));
        values.push(normal(&gradient) - normal(&vorticity));
        let by_fluid = |stress: f64| {
            let viscous = flow.dot(&(fluid * gradient));
            if viscous == 0.0 {
                0.0
            } else {
                stress / viscous
            }
        };
        values.push(by_fluid(flow.dot(&(total * gradient))));
        values.push(by_fluid(flow.dot(&((fluid + particle) * gradient))));
        if let (Some(walls), Some(solver)) = (&self.walls, scene.flow.fluid()) {
            values.push(by_fluid(walls.shear_stress(solver, &flow)));
            let all = Inside::EVERYWHERE;
            let sum = add(fibres.particle_stress(&all) + fibres.contact_stress(&all));
            let whole = fluid + sum / self.whole;
            values.push(by_fluid(flow.dot(&(whole * gradient))));
        }
        values
    }

    /// Mean rate of strain over the domain \[1/s\]: ∫∇u dV = ∮ u n dA on a mesh, exactly; of a prescribed flow that of its
    /// formula, zero for vortices, whose cells cancel. Collective.
    fn strain_rate(&self, scene: &Scene) -> Matrix3 {
        let gradient = match &scene.flow {
            Flow::Solved(solved) => {
                let rows = solved.fluid.mean_gradient();
                Matrix3::from_fn(|i, j| rows[i][j])
            }
            Flow::Prescribed(flow) => flow.mean_gradient(),
        };
        (gradient + gradient.transpose()) * 0.5
    }
}

impl Walls {
    /// The faces across the gradient, if it lies along an axis of a box that ends at walls there.
    fn find(case: &Case, fluid: &Fluid, shear: &Shear) -> Option<Self> {
        let domain = case.domain()?;
        let axis = (0..3).find(|&c| shear.gradient[c].abs() > 1.0 - 1e-12)?;
        let across = [(axis + 1) % 3, (axis + 2) % 3];
        let patches = &fluid.mesh().patches;
        let letter = ["x", "y", "z"][axis];
        let find = |end: &str| {
            let name = format!("{letter}_{end}");
            patches.iter().position(|patch| *patch == name)
        };
        Some(Self {
            patches: [find("min")?, find("max")?],
            area: domain.size[across[0]] * domain.size[across[1]],
        })
    }

    /// What the fluid passes on from the high wall to the low one \[Pa\]. Collective.
    fn shear_stress(&self, fluid: &Fluid, flow: &Vector3) -> f64 {
        let loads = fluid.patch_loads([0.0; 3]);
        let [low, high] = self
            .patches
            .map(|p| flow.dot(&Vector3::from(loads[p].force())));
        (low - high) / (2.0 * self.area)
    }
}
