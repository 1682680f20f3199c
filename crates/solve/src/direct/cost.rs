//! What a direct solve costs, before anything is set up.

use super::fourier::RealLines;
use super::{Direct, roles, spectrum};
use fibreflow_mesh::Line;

impl Direct {
    /// Floating-point operations of a solve of one component on all ranks, as [`Direct::operations`] counts them, from
    /// the lines alone: eigenvectors of long directions take n³ operations to find.
    pub fn estimate(lines: &[Line; 3], fixed_ends: [[bool; 2]; 3]) -> f64 {
        let [a, b, c] = roles(lines);
        let free = |d: usize| {
            let fixed = fixed_ends[d].into_iter().filter(|&fixed| fixed).count();
            lines[d].len().saturating_sub(fixed) as f64
        };
        let fourier = |d: usize| {
            RealLines::new(lines[d].len()).is_some() && spectrum::fourier(&lines[d]).is_some()
        };
        let transform = |d: usize, fourier: bool| {
            let n = lines[d].len() as f64;
            if fourier { 2.5 * n.log2() } else { 2.0 * n }
        };
        let first = fourier(a);
        let transforms = transform(a, first) + transform(b, first && fourier(b));
        let width = lines[c].pairs.iter().map(|p| p.distance).max().unwrap_or(1);
        let border = if lines[c].periodic { width } else { 0 };
        let banded = 1.0 + 4.0 * f64::from(width + border);
        free(a) * free(b) * free(c) * (2.0 * transforms + banded)
    }
}
