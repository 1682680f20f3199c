//! Products of velocity and pressure whose means are kept, and what follows from them.

/// Places of the products in a bin's list; 1, 2, 3 are the directions of the bin.
pub(super) mod slot {
    /// u₁, u₂, u₃.
    pub const U: usize = 0;
    /// u₁u₁, u₂u₂, u₃u₃, u₁u₂, u₁u₃, u₂u₃.
    pub const UU: usize = 3;
    /// u₁³, u₂³, u₃³.
    pub const CUBE: usize = 9;
    /// u₁⁴, u₂⁴, u₃⁴.
    pub const FOURTH: usize = 12;
    /// |u|² u₂.
    pub const FLUX: usize = 15;
    /// p/ρ, its square, and its products with u₁, u₂, u₃.
    pub const P: usize = 16;
    pub const PP: usize = 17;
    pub const PU: usize = 18;
    /// Discrete Laplacian of the velocity, and its product with u.
    pub const L: usize = 21;
    pub const UL: usize = 24;
    /// ũ₁, ũ₂, ũ₃, and ½(u ũ + ũ u) in the order of [`UU`].
    pub const SMOOTH: usize = 25;
    pub const SMOOTH_UU: usize = 28;
    /// Length of the list.
    pub const COUNT: usize = 34;
}

use slot::{COUNT, CUBE, FLUX, FOURTH, L, P, PP, PU, SMOOTH, SMOOTH_UU, U, UL, UU};

/// Pairs of components in the order of [`slot::UU`].
pub(super) const PAIRS: [(usize, usize); 6] = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)];

/// Adds `weight` times the products of a node; `smooth` is ũ = V⁻¹ M u with the mass matrix M of the elements.
pub(super) fn add(
    sums: &mut [f64],
    weight: f64,
    [u, smooth]: [[f64; 3]; 2],
    p: f64,
    laplacian: [f64; 3],
) {
    let mut products = [0.0; COUNT];
    let square = u[0] * u[0] + u[1] * u[1] + u[2] * u[2];
    for c in 0..3 {
        products[U + c] = u[c];
        products[CUBE + c] = u[c] * u[c] * u[c];
        products[FOURTH + c] = u[c] * u[c] * u[c] * u[c];
        products[PU + c] = p * u[c];
        products[L + c] = laplacian[c];
        products[SMOOTH + c] = smooth[c];
        products[UL] += u[c] * laplacian[c];
    }
    for (k, (a, b)) in PAIRS.into_iter().enumerate() {
        products[UU + k] = u[a] * u[b];
        products[SMOOTH_UU + k] = 0.5 * (u[a] * smooth[b] + smooth[a] * u[b]);
    }
    products[FLUX] = square * u[1];
    products[P] = p;
    products[PP] = p * p;
    for (sum, product) in sums.iter_mut().zip(products) {
        *sum += weight * product;
    }
}

/// Moments of the fluctuations in one bin.
#[derive(Clone, Copy, Debug)]
pub(super) struct Central {
    /// ⟨u⟩.
    pub mean: [f64; 3],
    /// ⟨p⟩/ρ.
    pub pressure: f64,
    /// ⟨u'ᵢu'ⱼ⟩ in the order of [`slot::UU`], averaged over the volume of the elements: a wave as long as two spacings has
    /// a third of the square of its nodal values for each direction.
    pub stress: [f64; 6],
    /// ⟨p'²⟩/ρ².
    pub pressure_square: f64,
    /// ⟨u'ᵢ³⟩/⟨u'ᵢ²⟩^{3/2}.
    pub skewness: [f64; 3],
    /// ⟨u'ᵢ⁴⟩/⟨u'ᵢ²⟩².
    pub flatness: [f64; 3],
    /// ½⟨u'·u' u'₂⟩.
    pub transport: f64,
    /// ⟨p'u'₂⟩/ρ.
    pub pressure_transport: f64,
    /// ⟨u'·∇²u'⟩ of the discrete Laplacian.
    pub diffusion: f64,
}

impl Central {
    /// From the means of a bin's products.
    pub fn new(m: &[f64]) -> Self {
        let u = [m[U], m[U + 1], m[U + 2]];
        let nodal: [f64; 6] = std::array::from_fn(|k| {
            let (a, b) = PAIRS[k];
            m[UU + k] - u[a] * u[b]
        });
        let smooth = &m[SMOOTH..SMOOTH + 3];
        let stress: [f64; 6] = std::array::from_fn(|k| {
            let (a, b) = PAIRS[k];
            m[SMOOTH_UU + k] - 0.5 * (u[a] * smooth[b] + smooth[a] * u[b])
        });
        let third = |c: usize| m[CUBE + c] - 3.0 * u[c] * m[UU + c] + 2.0 * u[c].powi(3);
        let fourth = |c: usize| {
            m[FOURTH + c] - 4.0 * u[c] * m[CUBE + c] + 6.0 * u[c] * u[c] * m[UU + c]
                - 3.0 * u[c].powi(4)
        };
        // Where nothing fluctuates, moments by powers of the variance are round-off.
        let scaled = |value: f64, c: usize, power: f64| {
            if nodal[c] > 1e-12 * m[UU + c].max(f64::MIN_POSITIVE) {
                value / nodal[c].powf(power)
            } else {
                0.0
            }
        };
        // ⟨u'ᵢu'ᵢu'₂⟩ = ⟨uᵢuᵢu₂⟩ − 2 Uᵢ⟨u'ᵢu'₂⟩ − U₂⟨u'ᵢu'ᵢ⟩ − UᵢUᵢU₂.
        let with_second = [nodal[3], nodal[1], nodal[5]];
        let kinetic: f64 = (0..3).map(|c| nodal[c]).sum();
        let mean_square: f64 = u.iter().map(|v| v * v).sum();
        let carried: f64 = (0..3).map(|c| u[c] * with_second[c]).sum();
        let transport = m[FLUX] - 2.0 * carried - u[1] * (kinetic + mean_square);
        Self {
            mean: u,
            pressure: m[P],
            stress,
            pressure_square: m[PP] - m[P] * m[P],
            skewness: [0, 1, 2].map(|c| scaled(third(c), c, 1.5)),
            flatness: [0, 1, 2].map(|c| scaled(fourth(c), c, 2.0)),
            transport: 0.5 * transport,
            pressure_transport: m[PU + 1] - m[P] * u[1],
            diffusion: m[UL] - (0..3).map(|c| u[c] * m[L + c]).sum::<f64>(),
        }
    }

    /// Turbulent kinetic energy ½⟨u'·u'⟩.
    pub fn energy(&self) -> f64 {
        0.5 * (self.stress[0] + self.stress[1] + self.stress[2])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Central moments of a few samples, by definition and from the sums.
    #[test]
    fn raw_moments_give_those_of_the_fluctuations() {
        let samples = [
            ([18.2, 0.1, -0.3], [18.0, 0.0, -0.1], 0.5, [1.0, 2.0, -1.0]),
            ([17.1, -0.4, 0.2], [17.5, -0.2, 0.2], -0.2, [0.3, -2.0, 0.5]),
            ([19.5, 0.2, 0.6], [19.1, 0.1, 0.4], 0.9, [-1.5, 0.2, 0.1]),
            ([18.8, 0.3, -0.1], [18.6, 0.4, 0.0], 0.1, [0.7, 0.9, -2.2]),
        ];
        let mut sums = [0.0; COUNT];
        for (u, smooth, p, l) in samples {
            add(&mut sums, 0.25, [u, smooth], p, l);
        }
        let central = Central::new(&sums);
        let mean = |f: &dyn Fn(usize) -> f64| (0..4).map(f).sum::<f64>() / 4.0;
        let u: [f64; 3] = [0, 1, 2].map(|c| mean(&|s| samples[s].0[c]));
        let smooth: [f64; 3] = [0, 1, 2].map(|c| mean(&|s| samples[s].1[c]));
        let p = mean(&|s| samples[s].2);
        let l: [f64; 3] = [0, 1, 2].map(|c| mean(&|s| samples[s].3[c]));
        let f = |s: usize, c: usize| samples[s].0[c] - u[c];
        let g = |s: usize, c: usize| samples[s].1[c] - smooth[c];
        let close = |found: f64, wanted: f64| {
            assert!((found - wanted).abs() < 1e-10, "{found} {wanted}");
        };
        for (k, (a, b)) in PAIRS.into_iter().enumerate() {
            let wanted = mean(&|s| 0.5 * (f(s, a) * g(s, b) + g(s, a) * f(s, b)));
            close(central.stress[k], wanted);
        }
        for c in 0..3 {
            let variance = mean(&|s| f(s, c).powi(2));
            close(
                central.skewness[c],
                mean(&|s| f(s, c).powi(3)) / variance.powf(1.5),
            );
            close(
                central.flatness[c],
                mean(&|s| f(s, c).powi(4)) / variance.powi(2),
            );
        }
        let square = |s: usize| (0..3).map(|c| f(s, c).powi(2)).sum::<f64>();
        close(central.transport, mean(&|s| 0.5 * square(s) * f(s, 1)));
        close(
            central.pressure_transport,
            mean(&|s| (samples[s].2 - p) * f(s, 1)),
        );
        let along = |s: usize| (0..3).map(|c| f(s, c) * (samples[s].3[c] - l[c])).sum();
        close(central.diffusion, mean(&along));
    }
}
