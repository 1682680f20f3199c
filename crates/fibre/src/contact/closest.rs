//! Closest points of two straight axes, exact and as a contact point that moves continuously.

use crate::Vector3;

/// Below this sin² of the enclosed angle two axes count as parallel: their distance along the overlap then varies
/// by less than 1e-14 of its length.
const PARALLEL: f64 = 1e-28;
/// An axis shorter than this fraction of the pair's extent is a point.
const POINT: f64 = 1e-15;

/// Each reduces the error of the contact point by a factor of three at least.
const REFINEMENTS: usize = 3;

/// Points A(s) = a₀ + s(a₁ − a₀) and B(t) = b₀ + t(b₁ − b₀) on two axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClosestPoints {
    /// Position on a, 0 to 1.
    pub s: f64,
    /// Position on b, 0 to 1.
    pub t: f64,
    /// B(t) − A(s) \[m\].
    pub separation: Vector3,
    /// |B(t) − A(s)| \[m\].
    pub distance: f64,
}

/// The closest points of two axes (K 3.21; K 3.23 lacks the squares and the clamping).
///
/// Where parallel axes run side by side, the centre of the common part; a zero-length axis answers 0.5.
pub fn closest_points(a: &[Vector3; 2], b: &[Vector3; 2]) -> ClosestPoints {
    Axes::new(a, b).closest()
}

/// The contact point of two capsules whose radii add up to `reach`; `None` when they do not overlap.
///
/// Closest points jump from end to end when axes turn through the parallel. The contact point is where δ²g is largest,
/// with δ = reach − |A − B| and the share g(s, t) = exp(−(s − ½)² − (t − ½)²). The logarithm of that is strictly concave,
/// so the point is a continuous function of the four ends, moves over the tilts at which δ still reaches over the axes,
/// and is the closest one in the limit of no overlap. A contact of energy ½kδ²g has the force kδg along B − A alone.
pub fn contact_points(a: &[Vector3; 2], b: &[Vector3; 2], reach: f64) -> Option<ClosestPoints> {
    near_points(a, b, reach, 0.0, 0.0).ok()
}

/// The share of a contact's stiffness at a place of the two axes: about one half at a common end of two segments, which
/// both touch there.
pub(super) fn share(points: &ClosestPoints) -> f64 {
    let off = |x: f64| (x - 0.5) * (x - 0.5);
    (-off(points.s) - off(points.t)).exp()
}

/// As [`contact_points`], up to a gap `range`, for forces that change over the length `scale`: the contact point moves as
/// if the overlap were larger by that much. When the two are apart, how far beyond that range \[m\].
pub(super) fn near_points(
    a: &[Vector3; 2],
    b: &[Vector3; 2],
    reach: f64,
    range: f64,
    scale: f64,
) -> Result<ClosestPoints, f64> {
    let axes = Axes::new(a, b);
    let mut points = axes.closest();
    let overlap = reach - points.distance;
    if overlap.is_nan() || overlap <= -range {
        return Err(-overlap - range);
    }
    // Stationary where |A − B|² + |A − B|δ((s − ½)² + (t − ½)²) is least, with the factor of the place itself.
    for _ in 0..REFINEMENTS {
        let depth = (reach - points.distance).max(0.0) + scale;
        points = axes.minimise(points.distance * depth, [0.5; 2]);
    }
    if points.distance < reach + range {
        Ok(points)
    } else {
        Err(0.0)
    }
}

/// Two axes a₀ + s p and b₀ + t q.
struct Axes {
    /// a₀ − b₀.
    offset: Vector3,
    p: Vector3,
    q: Vector3,
    pp: f64,
    qq: f64,
    pq: f64,
    /// Centre of the common part, on each axis.
    centre: [f64; 2],
}

impl Axes {
    fn new(a: &[Vector3; 2], b: &[Vector3; 2]) -> Self {
        let (offset, p, q) = (a[0] - b[0], a[1] - a[0], b[1] - b[0]);
        let extent = p.norm_squared() + q.norm_squared() + offset.norm_squared();
        let span = |v: &Vector3| {
            let square = v.norm_squared();
            if square > POINT * POINT * extent {
                square
            } else {
                0.0
            }
        };
        let (pp, qq) = (span(&p), span(&q));
        let common = |square: f64, along: &Vector3, first: Vector3, last: Vector3| {
            let place = |x: Vector3| (along.dot(&x) / square).clamp(0.0, 1.0);
            if square == 0.0 {
                0.5
            } else {
                0.5 * (place(first) + place(last))
            }
        };
        let centre = [
            common(pp, &p, -offset, q - offset),
            common(qq, &q, offset, p + offset),
        ];
        let pq = p.dot(&q);
        Self {
            offset,
            p,
            q,
            pp,
            qq,
            pq,
            centre,
        }
    }

    fn closest(&self) -> ClosestPoints {
        self.minimise(0.0, self.centre)
    }

    /// Minimiser over the unit square of |A − B|² + w((s − m)² + (t − n)²).
    fn minimise(&self, weight: f64, [m, n]: [f64; 2]) -> ClosestPoints {
        let weigh = |square: f64| if square > 0.0 { weight } else { 0.0 };
        let (u2, v2) = (weigh(self.pp), weigh(self.qq));
        let (pp, qq) = (self.pp + u2, self.qq + v2);
        let f = u2 * m - self.p.dot(&self.offset);
        let g = v2 * n + self.q.dot(&self.offset);
        let best_s = |t: f64| {
            if pp > 0.0 {
                ((t * self.pq + f) / pp).clamp(0.0, 1.0)
            } else {
                m
            }
        };
        let best_t = |s: f64| {
            if qq > 0.0 { (s * self.pq + g) / qq } else { n }
        };
        let s = if self.pp == 0.0 || self.qq == 0.0 {
            best_s(n)
        } else {
            // Parts of p and of the offset across q: the normal equations would lose twice the digits near the parallel.
            let (along, ahead) = (self.pq / qq, g / qq);
            let across = self.p - self.q * along;
            let width = across.norm_squared() + u2 + along * along * v2;
            if width > PARALLEL * pp {
                let lever = self.q * ahead - self.offset;
                let pull = across.dot(&lever) + u2 * m + along * v2 * (n - ahead);
                (pull / width).clamp(0.0, 1.0)
            } else {
                m
            }
        };
        // The minimum over the strip 0 ≤ s ≤ 1; when its t leaves the square, convexity puts the answer on that edge.
        let t = best_t(s);
        let (s, t) = if (0.0..=1.0).contains(&t) {
            (s, t)
        } else {
            let t = t.clamp(0.0, 1.0);
            (best_s(t), t)
        };
        let separation = t * self.q - s * self.p - self.offset;
        ClosestPoints {
            s,
            t,
            separation,
            distance: separation.norm(),
        }
    }
}

#[cfg(test)]
mod tests;
