//! One-dimensional summation-by-parts operators, of which the geometry of a tensor-product mesh is made.

mod fourth;

/// A one-dimensional operator on the nodes of one direction.
///
/// The three-dimensional pair geometry is its tensor product: along an axis S_ab = `skew` H H and w_ab = `stiffness` H H
/// with the norms of the two other directions, and V = H H H. Periodic lines of one and two nodes keep all their pairs:
/// a node with its own image (b = a), and two pairs of opposite direction between the same nodes.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// True when the last node is followed by the first.
    pub periodic: bool,
    /// H: dual length of every node \[m\].
    pub norm: Vec<f64>,
    /// Pairs, each once, by (a, distance).
    pub pairs: Vec<LinePair>,
}

/// The pair (a, b) with b = a + distance, modulo the number of nodes when periodic.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinePair {
    /// The lower node (before wrapping).
    pub a: u32,
    /// 1, 2 or 3 nodes on.
    pub distance: u32,
    /// 2 Q_ab, one for second order.
    pub skew: f64,
    /// Diffusive weight \[1/m\].
    pub stiffness: f64,
}

impl Line {
    /// Second order, two-point: H half the distance of the neighbours (of the neighbour, at an end), stiffness 1/h.
    ///
    /// `coordinates` \[m\] ascend; with a `period` \[m\] the repeated end is left out.
    pub fn second(coordinates: &[f64], period: Option<f64>) -> Self {
        let n = coordinates.len();
        let mut spacings: Vec<f64> = coordinates.windows(2).map(|x| x[1] - x[0]).collect();
        if let (Some(period), [first, .., last] | [first @ last]) = (period, coordinates) {
            spacings.push(first + period - last);
        }
        let mut norm = vec![0.0; n];
        let mut pairs = Vec::with_capacity(spacings.len());
        for (a, &h) in spacings.iter().enumerate() {
            norm[a] += 0.5 * h;
            norm[(a + 1) % n] += 0.5 * h;
            pairs.push(LinePair {
                a: a as u32,
                distance: 1,
                skew: 1.0,
                stiffness: 1.0 / h,
            });
        }
        Self {
            periodic: period.is_some(),
            norm,
            pairs,
        }
    }

    /// Number of nodes.
    pub fn len(&self) -> usize {
        self.norm.len()
    }

    /// True without nodes.
    pub fn is_empty(&self) -> bool {
        self.norm.is_empty()
    }

    /// The higher node of a pair.
    pub fn other(&self, pair: &LinePair) -> usize {
        (pair.a + pair.distance) as usize % self.len()
    }
}
