//! Force coefficients of an infinite circular cylinder against the Reynolds number Re = ρ d |slip_n| / μ of the
//! *normal* slip: force per length f = ½ ρ d |slip_n| (C_n slip_n + C_l slip_t).
//!
//! K 4.21–4.23 with corrections: 4.21 lacks the factor 1/Re (C_n = 8π/(Re s)(1 − … Re²) reproduces K table 4.4);
//! the three laws join at Re = 0.1 and 100, not at K's limits; p_τ,3 is 7.4966e-4 (K prints e-3) and the axial law
//! above 100 is 4/√Re (K prints 5.4/√Re): only then do the axial laws join.

use std::f64::consts::PI;

/// Values and their derivatives.
type Law = (Coefficients, Coefficients);

/// C_n Re and C_l Re, both finite for Re → 0 (there they vary like 1/ln Re).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Coefficients {
    /// C_n Re; the normal resistance is ½ μ C_n Re.
    pub normal: f64,
    /// C_l Re; the axial resistance is ½ μ C_l Re.
    pub axial: f64,
}

/// Below this Reynolds number the logarithm is levelled off smoothly: Re → √(Re² + Re_0²).
const SMALLEST: f64 = 1e-6;
/// Where the low and the middle law meet.
const LOW: f64 = 0.1;
/// Where the middle and the high law meet.
const HIGH: f64 = 100.0;
/// Half width in ln Re over which neighbouring laws are blended; they differ by 1e-4 at the joins.
const BLEND: f64 = 0.2;

/// Marheineke & Wegener 2011 (K tables 4.2, 4.3): ln(C/2) as cubics in ln Re.
const NORMAL: [f64; 4] = [1.6911, -6.722e-1, 3.3287e-2, 3.5015e-3];
const AXIAL: [f64; 4] = [1.1552, -6.8479e-1, 1.4884e-2, 7.4966e-4];

/// All ranges, C¹ in Re: the coefficients and their derivatives by the logarithm of [`regular`].
pub(super) fn coefficients(reynolds: f64) -> Law {
    let re = regular(reynolds);
    let from_low = (re / LOW).ln();
    let from_high = (re / HIGH).ln();
    if from_low <= -BLEND {
        tomotika(re)
    } else if from_low < BLEND {
        blend(tomotika(re), marheineke_wegener(re), from_low / BLEND)
    } else if from_high <= -BLEND {
        marheineke_wegener(re)
    } else if from_high < BLEND {
        blend(marheineke_wegener(re), taylor(re), from_high / BLEND)
    } else {
        taylor(re)
    }
}

/// √(Re² + Re_0²): the argument of the laws.
pub(super) fn regular(reynolds: f64) -> f64 {
    reynolds.hypot(SMALLEST)
}

/// K 4.21 (Tomotika, Aoi & Yosinobu 1953) with 1/Re; s = 2.0022 − ln Re, t = 2s − 1:
/// C_n Re = 8π (1/s − Re² (1 − 1/2s + 5/16s²)/32), C_l Re = 8π (1/t − Re² (1 + 1/t²)/32).
fn tomotika(re: f64) -> Law {
    let (s, re2) = (1.0 / (2.0022 - re.ln()), re * re / 32.0);
    let t = s / (2.0 - s);
    let value = Coefficients {
        normal: 8.0 * PI * (s - re2 * (1.0 - 0.5 * s + 5.0 / 16.0 * s * s)),
        axial: 8.0 * PI * (t - re2 * (1.0 + t * t)),
    };
    let slope = Coefficients {
        normal: 8.0 * PI * (s * s - re2 * (2.0 - s + s * s * (5.0 / 8.0 - 0.5 + 5.0 / 8.0 * s))),
        axial: 8.0 * PI * (2.0 * t * t - re2 * (2.0 + 2.0 * t * t + 4.0 * t * t * t)),
    };
    (value, slope)
}

/// K 4.22.
fn marheineke_wegener(re: f64) -> Law {
    let x = re.ln();
    let law = |p: &[f64; 4]| 2.0 * re * (p[0] + x * (p[1] + x * (p[2] + x * p[3]))).exp();
    let growth = |p: &[f64; 4]| 1.0 + p[1] + x * (2.0 * p[2] + x * 3.0 * p[3]);
    let value = Coefficients {
        normal: law(&NORMAL),
        axial: law(&AXIAL),
    };
    let slope = Coefficients {
        normal: value.normal * growth(&NORMAL),
        axial: value.axial * growth(&AXIAL),
    };
    (value, slope)
}

/// K 4.23 (Taylor 1952), axial constant 4.
fn taylor(re: f64) -> Law {
    let root = re.sqrt();
    let value = Coefficients {
        normal: re + 4.0 * root,
        axial: 4.0 * root,
    };
    let slope = Coefficients {
        normal: re + 2.0 * root,
        axial: 2.0 * root,
    };
    (value, slope)
}

/// Cubic smooth step from `a` at x = −1 to `b` at x = 1; x runs through ln Re / [`BLEND`].
fn blend(a: Law, b: Law, x: f64) -> Law {
    let y = 0.5 * (x + 1.0);
    let w = y * y * (3.0 - 2.0 * y);
    let rate = 3.0 * y * (1.0 - y) / BLEND;
    let mix = |a: f64, b: f64| a + w * (b - a);
    let value = Coefficients {
        normal: mix(a.0.normal, b.0.normal),
        axial: mix(a.0.axial, b.0.axial),
    };
    let slope = Coefficients {
        normal: mix(a.1.normal, b.1.normal) + rate * (b.0.normal - a.0.normal),
        axial: mix(a.1.axial, b.1.axial) + rate * (b.0.axial - a.0.axial),
    };
    (value, slope)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn c_n(re: f64) -> f64 {
        coefficients(re).0.normal / re
    }

    fn c_l(re: f64) -> f64 {
        coefficients(re).0.axial / re
    }

    #[test]
    fn the_laws_join_at_their_known_values() {
        assert!((c_n(0.1) - 58.31).abs() < 0.005, "{}", c_n(0.1));
        assert!((c_l(0.1) - 32.95).abs() < 0.005, "{}", c_l(0.1));
        assert!((c_n(100.0) - 1.400).abs() < 5e-4, "{}", c_n(100.0));
        assert!((c_l(100.0) - 0.400).abs() < 5e-4, "{}", c_l(100.0));
    }

    /// The blend only hides round-off of the printed constants: the laws themselves agree at the joins.
    #[test]
    fn neighbouring_laws_agree_in_value_and_slope_at_the_joins() {
        let slope = |law: fn(f64) -> Law, re: f64| {
            let (up, down) = (law(re * 1.0001).0, law(re / 1.0001).0);
            let h = 2.0 * 1.0001_f64.ln();
            [
                (up.normal / down.normal).ln() / h,
                (up.axial / down.axial).ln() / h,
            ]
        };
        for (low, high, re) in [
            (
                tomotika as fn(f64) -> Law,
                marheineke_wegener as fn(f64) -> Law,
                LOW,
            ),
            (marheineke_wegener, taylor, HIGH),
        ] {
            let (a, b) = (low(re).0, high(re).0);
            assert!((a.normal / b.normal - 1.0).abs() < 1.5e-4, "{re}");
            assert!((a.axial / b.axial - 1.0).abs() < 1.5e-4, "{re}");
            let (a, b) = (slope(low, re), slope(high, re));
            assert!(
                (a[0] - b[0]).abs() < 5e-5,
                "normal slope at {re}: {a:?} {b:?}"
            );
            assert!(
                (a[1] - b[1]).abs() < 5e-5,
                "axial slope at {re}: {a:?} {b:?}"
            );
        }
    }

    #[test]
    fn the_combined_law_is_continuously_differentiable() {
        let mut previous: Option<[f64; 2]> = None;
        let ratio = 1.002_f64;
        let mut re = 1e-3;
        while re < 1e4 {
            let (a, b) = (coefficients(re).0, coefficients(re * ratio).0);
            let slope = [
                (b.normal / a.normal).ln() / ratio.ln(),
                (b.axial / a.axial).ln() / ratio.ln(),
            ];
            if let Some(last) = previous {
                for k in 0..2 {
                    assert!(
                        (slope[k] - last[k]).abs() < 2e-3,
                        "kink at {re}: {last:?} {slope:?}"
                    );
                }
            }
            previous = Some(slope);
            re *= ratio;
        }
    }

    #[test]
    fn slopes_are_those_of_the_coefficients() {
        let h = 1e-5;
        for k in -20..40 {
            let re = 10f64.powf(0.1 * f64::from(k) + 0.013);
            let (up, down) = (
                coefficients(re * f64::exp(h)).0,
                coefficients(re * f64::exp(-h)).0,
            );
            let slope = coefficients(re).1;
            for (found, up, down) in [
                (slope.normal, up.normal, down.normal),
                (slope.axial, up.axial, down.axial),
            ] {
                let expected = (up - down) / (2.0 * h);
                assert!(
                    (found / expected - 1.0).abs() < 1e-6,
                    "{re}: {found} {expected}"
                );
            }
        }
    }

    /// K table 4.4, column "model", as in the case folder; the entries above Re = 0.1 are of Tomotika's law itself.
    #[test]
    fn table_4_4_is_reproduced() {
        let table = include_str!("../../../../cases/drag-laws/table_4_4_cn_vs_re.csv");
        let mut rows = 0;
        for line in table.lines().skip(1) {
            let mut numbers = line.split(',').map(|n| n.parse::<f64>().expect("a number"));
            let (Some(re), Some(expected)) = (numbers.next(), numbers.next()) else {
                panic!("{line}");
            };
            let model = tomotika(re).0.normal / re;
            let tolerance = if re > 0.1 { 0.03 } else { 6e-3 };
            assert!((model / expected - 1.0).abs() < tolerance, "{re}: {model}");
            if re < 0.08 {
                assert!((c_n(re) / model - 1.0).abs() < 1e-6);
            }
            rows += 1;
        }
        assert_eq!(rows, 11);
    }
}
