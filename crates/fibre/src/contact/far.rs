//! Forces at a distance: exponential repulsion with a weak attraction, van der Waals attraction, lubrication.
//!
//! All are functions of the gap h between the surfaces and act along the normal at the closest points. They end at an
//! outer range, where what is left of them is subtracted so that they set in without a step.

use crate::Vector3;
use crate::contact::ContactError;
use std::f64::consts::{PI, SQRT_2};

/// Short-range repulsion F₀ exp(−h/λ) (S 2.7), less a weak attraction A exp(−(h/w)²) (S 3.3.5).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Repulsion {
    /// F₀ \[N\].
    pub strength: f64,
    /// λ \[m\]; Switzer's 1/a.
    pub decay: f64,
    /// A \[N\]; 0 for pure repulsion.
    pub attraction: f64,
    /// w \[m\]; Switzer's a_A^(−½).
    pub attraction_width: f64,
    /// Gap beyond which there is no force \[m\]; Switzer's h_lim.
    pub range: f64,
    /// Gap below which friction acts \[m\]; Switzer's h_cut.
    pub contact_gap: f64,
}

/// Van der Waals attraction of cylinders (Derjaguin's approximation; Israelachvili 2011, table 13.1).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VanDerWaals {
    /// Hamaker constant A_H \[J\].
    pub hamaker: f64,
    /// Gap below which the force no longer grows \[m\].
    pub closest: f64,
    /// Gap beyond which there is no force \[m\].
    pub range: f64,
}

/// Lubrication force −c(h) u between surfaces that move relative to each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lubrication {
    /// Dynamic viscosity μ \[Pa·s\].
    pub viscosity: f64,
    /// Height of roughness: the gap below which the resistance no longer grows \[m\].
    pub roughness: f64,
    /// Gap beyond which there is no force \[m\].
    pub range: f64,
    /// What the surfaces are taken for.
    pub model: LubricationModel,
}

/// Leading term of the resistance to approach.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LubricationModel {
    /// Reynolds' equation between cylinders that cross or run side by side.
    #[default]
    Cylinders,
    /// Two spheres of the fibres' radius at the closest points (K 3.35).
    Spheres,
}

/// How two surfaces face each other.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Facing {
    /// Radii \[m\]; infinite for a plane.
    pub radii: [f64; 2],
    /// Unit vectors along the axes; zero where the second body has none.
    pub axes: [Vector3; 2],
    /// Length over which they run side by side \[m\].
    pub common: f64,
}

/// The forces at a distance of a scene.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Far {
    pub repulsion: Option<Repulsion>,
    pub adhesion: Option<VanDerWaals>,
    pub lubrication: Option<Lubrication>,
}

/// A force that pushes the bodies apart, and what goes with it.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Push {
    /// \[N\]
    pub force: f64,
    /// \[J\]
    pub energy: f64,
    /// Bound of −dF/dh \[N/m\].
    pub stiffness: f64,
}

/// Resistance to approach and to sliding \[N·s/m\].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Resistance {
    pub normal: f64,
    pub tangential: f64,
}

impl Far {
    /// Checks the settings.
    pub fn new(
        repulsion: Option<Repulsion>,
        adhesion: Option<VanDerWaals>,
        lubrication: Option<Lubrication>,
    ) -> Result<Self, ContactError> {
        if let Some(r) = &repulsion {
            positive("repulsion strength", r.strength, "a positive number of N")?;
            positive("repulsion decay", r.decay, "a positive length in m")?;
            positive("repulsion range", r.range, "a positive length in m")?;
            let attraction = r.attraction >= 0.0 && r.attraction.is_finite();
            let valid = "zero or a positive number of N";
            require(attraction, "repulsion attraction", r.attraction, valid)?;
            if r.attraction > 0.0 {
                let width = r.attraction_width;
                positive(
                    "repulsion attraction_width",
                    width,
                    "a positive length in m",
                )?;
            }
            let inside = (0.0..=r.range).contains(&r.contact_gap);
            let valid = "between 0 and the range";
            require(inside, "repulsion contact_gap", r.contact_gap, valid)?;
        }
        if let Some(a) = &adhesion {
            positive("van_der_waals hamaker", a.hamaker, "a positive number of J")?;
            inner_and_outer(
                ["van_der_waals closest", "van_der_waals range"],
                a.closest,
                a.range,
            )?;
        }
        if let Some(l) = &lubrication {
            let valid = "a positive number of Pa·s";
            positive("lubrication viscosity", l.viscosity, valid)?;
            inner_and_outer(
                ["lubrication roughness", "lubrication range"],
                l.roughness,
                l.range,
            )?;
        }
        Ok(Self {
            repulsion,
            adhesion,
            lubrication,
        })
    }

    /// Largest gap at which there is a force \[m\]; 0 without any.
    pub fn range(&self) -> f64 {
        let ranges = [
            self.repulsion.map(|r| r.range),
            self.adhesion.map(|a| a.range),
            self.lubrication.map(|l| l.range),
        ];
        ranges.into_iter().flatten().fold(0.0, f64::max)
    }

    /// Length over which the forces change \[m\]; 0 without any. It softens the place of contact near the parallel.
    pub fn scale(&self) -> f64 {
        let scales = [
            self.repulsion.map(|r| r.decay),
            self.adhesion.map(|a| a.closest),
            self.lubrication.map(|l| l.roughness),
        ];
        let least = scales.into_iter().flatten().fold(f64::INFINITY, f64::min);
        if least.is_finite() { least } else { 0.0 }
    }

    /// Gap up to which friction acts \[m\].
    pub fn contact_gap(&self) -> f64 {
        self.repulsion.map_or(0.0, |r| r.contact_gap)
    }
}

impl Repulsion {
    /// Repulsion less attraction at gap `h` within the range, as S 2.7 has it: with a step at the range.
    pub(crate) fn bare(&self, h: f64) -> f64 {
        let attraction = if self.attraction > 0.0 {
            self.attraction * (-(h / self.attraction_width).powi(2)).exp()
        } else {
            0.0
        };
        self.strength * (-h / self.decay).exp() - attraction
    }

    /// At gap `h`; exponential in overlap (h < 0) too. The stiffness is at least that at touching.
    pub(crate) fn push(&self, h: f64) -> Push {
        if h >= self.range {
            return Push::default();
        }
        let repelled = self.strength * (-h / self.decay).exp();
        let left = self.strength * (-self.range / self.decay).exp();
        let width = self.attraction_width;
        let (pulled, rest, area) = if self.attraction > 0.0 {
            let at = |h: f64| self.attraction * (-(h / width).powi(2)).exp();
            let between = erf(self.range / width) - erf(h / width);
            let area = self.attraction * width * 0.5 * PI.sqrt() * between;
            (at(h), at(self.range), area)
        } else {
            (0.0, 0.0, 0.0)
        };
        let end = left - rest;
        // The steepest slope of the Gaussian is √(2/e)/w.
        let gaussian = if self.attraction > 0.0 {
            0.86 * self.attraction / width
        } else {
            0.0
        };
        Push {
            force: repelled - pulled - end,
            energy: self.decay * (repelled - left) - area - end * (self.range - h),
            stiffness: repelled.max(self.strength) / self.decay + gaussian,
        }
    }
}

impl VanDerWaals {
    /// At gap `h`, and the torque about the normal by which the second body turns the first one to its own direction:
    /// minus the derivative of the energy of crossed cylinders by the angle \[N·m\].
    pub(crate) fn push(&self, h: f64, facing: &Facing) -> (Push, Vector3) {
        if h >= self.range {
            return (Push::default(), Vector3::zeros());
        }
        let near = h.max(self.closest);
        let (deep, pull, crossed) = self.bond(near, facing);
        let (left, end, crossed_at_end) = self.bond(self.range, facing);
        let inner = -deep - pull * (near - h);
        let outer = left + end * (self.range - h);
        let push = Push {
            force: end - pull,
            energy: inner + outer,
            stiffness: 2.5 * pull / self.closest,
        };
        // Energies of crossed axes go with 1/sin θ.
        let turning = crossed * inner + crossed_at_end * outer;
        if turning == 0.0 {
            return (push, Vector3::zeros());
        }
        let [p, q] = facing.axes;
        let across = p.cross(&q);
        let cosine = p.dot(&q);
        (push, across * (-turning * cosine / across.norm_squared()))
    }

    /// Depth of the energy \[J\], force \[N\] at gap `h`, and 1 where the axes cross, else 0.
    ///
    /// Crossed: A√(r₁r₂)/(6h sin θ). Side by side over a length ℓ: Aℓ√R/(12√2 h^{3/2}), R = r₁r₂/(r₁ + r₂), and no less
    /// than two spheres, AR/(6h). The lesser of the two is taken: it is that of the shorter reach.
    fn bond(&self, h: f64, facing: &Facing) -> (f64, f64, f64) {
        let a = self.hamaker;
        let reduced = facing.reduced();
        let crossed = a * facing.mean_radius() / (6.0 * h * facing.sine());
        let line = a * facing.common * reduced.sqrt() / (12.0 * SQRT_2 * h.powf(1.5));
        let spheres = a * reduced / (6.0 * h);
        if crossed < line.max(spheres) {
            (crossed, crossed / h, 1.0)
        } else if line > spheres {
            (line, 1.5 * line / h, 0.0)
        } else {
            (spheres, spheres / h, 0.0)
        }
    }
}

impl Lubrication {
    /// At gap `h`, zero at the range.
    pub(crate) fn resistance(&self, h: f64, facing: &Facing) -> Resistance {
        if h >= self.range {
            return Resistance::default();
        }
        let near = self.leading(h.max(self.roughness), facing);
        let end = self.leading(self.range, facing);
        Resistance {
            normal: (near.normal - end.normal).max(0.0),
            tangential: (near.tangential - end.tangential).max(0.0),
        }
    }

    /// Cylinders that cross: 12πμR√(r₁r₂)/(h sin θ). Side by side over a length ℓ: 3√2πμℓ(R/h)^{3/2}, and no less than
    /// spheres, 6πμR²/h, which is K 3.35 for equal radii. All follow from Reynolds' equation between parabolic surfaces.
    /// Sliding: K 3.36 with the product of its last two terms.
    fn leading(&self, h: f64, facing: &Facing) -> Resistance {
        let mu = self.viscosity;
        let reduced = facing.reduced();
        let spheres = 6.0 * PI * mu * reduced * reduced / h;
        let normal = match self.model {
            LubricationModel::Spheres => spheres,
            LubricationModel::Cylinders => {
                let crossed = 12.0 * PI * mu * reduced * facing.mean_radius() / (h * facing.sine());
                let line = 3.0 * SQRT_2 * PI * mu * facing.common * (reduced / h).powf(1.5);
                crossed.min(line.max(spheres))
            }
        };
        let width = 4.0 * reduced;
        let tangential = 0.5 * PI * mu * ((width + h) * ((width + h) / h).ln() - width);
        Resistance { normal, tangential }
    }
}

impl Facing {
    /// A fibre that lies along a plane over the length `common`.
    pub fn plane(radius: f64, common: f64) -> Self {
        Self {
            radii: [radius, f64::INFINITY],
            axes: [Vector3::zeros(); 2],
            common,
        }
    }

    /// Two axes. Across each other they face over the shorter one's length, side by side over their common part.
    pub fn axes(a: &[Vector3; 2], b: &[Vector3; 2], radii: [f64; 2]) -> Self {
        let (p, q) = (a[1] - a[0], b[1] - b[0]);
        let (length_a, length_b) = (p.norm(), q.norm());
        let unit = |v: Vector3, length: f64| if length > 0.0 { v / length } else { v };
        let axes = [unit(p, length_a), unit(q, length_b)];
        let place = |x: &Vector3| (x - a[0]).dot(&axes[0]).clamp(0.0, length_a);
        let shared = (place(&b[1]) - place(&b[0])).abs();
        let cosine = axes[0].dot(&axes[1]).abs().min(1.0);
        Self {
            radii,
            axes,
            common: shared + (1.0 - cosine) * length_a.min(length_b),
        }
    }

    /// 1/(1/r₁ + 1/r₂) \[m\].
    fn reduced(&self) -> f64 {
        1.0 / (1.0 / self.radii[0] + 1.0 / self.radii[1])
    }

    /// √(r₁r₂) \[m\].
    fn mean_radius(&self) -> f64 {
        (self.radii[0] * self.radii[1]).sqrt()
    }

    /// Sine of the angle between the axes.
    fn sine(&self) -> f64 {
        self.axes[0].cross(&self.axes[1]).norm()
    }
}

/// erf(x) = 2/√π exp(−x²) Σ 2ⁿ x²ⁿ⁺¹/(2n+1)!!, whose terms have one sign.
fn erf(x: f64) -> f64 {
    if x.abs() > 6.0 {
        return x.signum();
    }
    let (mut term, mut sum, mut n) = (x, x, 1.0);
    while term.abs() > 1e-17 * sum.abs() {
        term *= 2.0 * x * x / (2.0 * n + 1.0);
        sum += term;
        n += 1.0;
    }
    2.0 / PI.sqrt() * (-x * x).exp() * sum
}

fn require(
    good: bool,
    name: &'static str,
    value: f64,
    valid: &'static str,
) -> Result<(), ContactError> {
    let error = ContactError::Setting { name, value, valid };
    if good { Ok(()) } else { Err(error) }
}

fn positive(name: &'static str, value: f64, valid: &'static str) -> Result<(), ContactError> {
    require(value > 0.0 && value.is_finite(), name, value, valid)
}

fn inner_and_outer(names: [&'static str; 2], inner: f64, outer: f64) -> Result<(), ContactError> {
    positive(names[0], inner, "a positive length in m")?;
    let valid = "a length in m above the inner cut-off";
    require(outer > inner && outer.is_finite(), names[1], outer, valid)
}

#[cfg(test)]
mod tests;
