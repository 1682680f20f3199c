//! Derivatives of profiles on points at any distance.

/// First and second derivative at every point, from polynomials through it and the points nearest in the list: `width` in all.
pub(super) fn derivatives(x: &[f64], f: &[f64], width: usize) -> (Vec<f64>, Vec<f64>) {
    let width = width.min(x.len());
    let at = |i: usize| {
        let first = i.saturating_sub(width / 2).min(x.len() - width);
        let points = &x[first..first + width];
        let weights = weights(x[i], points);
        let sum =
            |order: usize| -> f64 { (0..width).map(|k| weights[k][order] * f[first + k]).sum() };
        (sum(1), sum(2))
    };
    (0..x.len()).map(at).unzip()
}

/// Weights of the value and of two derivatives at `z` (Fornberg 1988, Math. Comp. 51:699).
fn weights(z: f64, x: &[f64]) -> Vec<[f64; 3]> {
    let mut weights = vec![[0.0; 3]; x.len()];
    weights[0][0] = 1.0;
    let mut product = 1.0;
    let mut before = x[0] - z;
    for i in 1..x.len() {
        let mut next = 1.0;
        let here = x[i] - z;
        let last = weights[i - 1];
        for j in 0..i {
            let distance = x[i] - x[j];
            next *= distance;
            if j == i - 1 {
                for k in (0..3).rev() {
                    let lower = if k > 0 { k as f64 * last[k - 1] } else { 0.0 };
                    weights[i][k] = product / next * (lower - before * last[k]);
                }
            }
            for k in (0..3).rev() {
                let lower = if k > 0 {
                    k as f64 * weights[j][k - 1]
                } else {
                    0.0
                };
                weights[j][k] = (here * weights[j][k] - lower) / distance;
            }
        }
        product = next;
        before = here;
    }
    weights
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polynomials_of_the_width_are_exact() {
        let x = [0.0, 0.1, 0.25, 0.5, 0.8, 1.3, 1.4];
        let value = |x: f64| 1.0 + x * (2.0 + x * (-3.0 + x * (0.5 + 0.7 * x)));
        let f = x.map(value);
        let (first, second) = derivatives(&x, &f, 5);
        for (k, &x) in x.iter().enumerate() {
            let slope = 2.0 + x * (-6.0 + x * (1.5 + 2.8 * x));
            let curve = -6.0 + x * (3.0 + 8.4 * x);
            assert!((first[k] - slope).abs() < 1e-10, "{k}");
            assert!((second[k] - curve).abs() < 1e-9, "{k}");
        }
    }
}
