//! The coarse matrix, factored on every rank by Cholesky's method inside its envelope (George & Liu 1981).

use crate::{PairMatrix, SolveError, vectors::dot};

/// Pivot over diagonal entry below which a matrix counts as singular.
const SMALLEST_PIVOT: f64 = 1e-12;

/// Factor L of a whole matrix in the order of reverse Cuthill & McKee: rows from their first entry to the diagonal.
pub(super) struct Factor {
    /// Row of the matrix at every place.
    order: Vec<u32>,
    /// First column of every row, and where the rows begin.
    first: Vec<u32>,
    starts: Vec<usize>,
    values: Vec<f64>,
    /// Answer in the factor's order.
    x: Vec<f64>,
}

impl Factor {
    /// Of a singular matrix the last row in the order is left out, whose unknown is then zero.
    ///
    /// # Errors
    /// [`SolveError::Coarsest`] when the matrix is not positive definite.
    pub(super) fn new(matrix: &PairMatrix, singular: bool) -> Result<Self, SolveError> {
        let unknowns = matrix.owned();
        let mut order = cuthill_mckee(matrix);
        let mut places = vec![0; unknowns];
        for (place, &i) in order.iter().enumerate() {
            places[i as usize] = place;
        }
        if singular {
            order.pop();
        }
        let size = order.len();
        let mut factor = Self {
            first: Vec::with_capacity(size),
            starts: vec![0],
            values: Vec::new(),
            x: vec![0.0; size],
            order,
        };
        for place in 0..size {
            factor.append(matrix, &places, place);
            if !factor.eliminate(place) {
                return Err(SolveError::Coarsest { unknowns });
            }
        }
        Ok(factor)
    }

    /// The matrix' entries of the row at a place.
    fn append(&mut self, matrix: &PairMatrix, places: &[usize], place: usize) {
        let i = self.order[place] as usize;
        let before = |&(j, _): &(usize, f64)| places[j] < place;
        let columns = matrix.row(i).filter(before).map(|(j, _)| places[j]);
        let first = columns.min().unwrap_or(place);
        let start = self.values.len();
        self.values.resize(start + place - first + 1, 0.0);
        for (j, w) in matrix.row(i).filter(before) {
            self.values[start + places[j] - first] -= w;
        }
        self.values[start + place - first] = matrix.diagonal()[i];
        self.first.push(first as u32);
        self.starts.push(self.values.len());
    }

    /// The row's entries of L from those of A; false when the pivot is none.
    fn eliminate(&mut self, place: usize) -> bool {
        let first = self.first[place] as usize;
        let (done, row) = self.values.split_at_mut(self.starts[place]);
        for column in first..place {
            let above = &done[self.starts[column]..self.starts[column + 1]];
            let from = self.first[column] as usize;
            let common = from.max(first);
            let (left, pivot) = (&above[common - from..column - from], above[column - from]);
            let k = column - first;
            row[k] = (row[k] - dot(left, &row[common - first..k])) / pivot;
        }
        let (left, pivot) = row.split_at_mut(place - first);
        let square = pivot[0] - dot(left, left);
        let regular = square > SMALLEST_PIVOT * pivot[0];
        pivot[0] = square.sqrt();
        regular
    }

    /// Right-hand side into answer, in place, by row of the matrix.
    pub(super) fn solve(&mut self, field: &mut [f64]) {
        let x = &mut self.x;
        for (x, &i) in x.iter_mut().zip(&self.order) {
            *x = field[i as usize];
        }
        field.fill(0.0);
        let row = |place: usize| {
            let (left, pivot) = self.values[self.starts[place]..self.starts[place + 1]]
                .split_at(place - self.first[place] as usize);
            (self.first[place] as usize, left, pivot[0])
        };
        for place in 0..x.len() {
            let (first, left, pivot) = row(place);
            x[place] = (x[place] - dot(left, &x[first..place])) / pivot;
        }
        for place in (0..x.len()).rev() {
            let (first, left, pivot) = row(place);
            let value = x[place] / pivot;
            x[place] = value;
            let above = x[first..place].iter_mut().zip(left);
            above.for_each(|(x, l)| *x -= value * l);
        }
        for (&x, &i) in x.iter().zip(&self.order) {
            field[i as usize] = x;
        }
    }
}

/// Rows in breadth-first order from a row at the rim, turned round; piece after piece.
fn cuthill_mckee(matrix: &PairMatrix) -> Vec<u32> {
    let size = matrix.owned();
    let degrees: Vec<usize> = (0..size).map(|i| matrix.row(i).count()).collect();
    let mut order = Vec::with_capacity(size);
    let mut seen = vec![false; size];
    for start in 0..size {
        if seen[start] {
            continue;
        }
        // The last row of a search lies at the rim.
        let begin = order.len();
        search(matrix, &degrees, start as u32, &mut seen, &mut order);
        let rim = order[order.len() - 1];
        order.drain(begin..).for_each(|i| seen[i as usize] = false);
        search(matrix, &degrees, rim, &mut seen, &mut order);
    }
    order.reverse();
    order
}

/// Appends the piece of a row, level by level, rows of few couplings first.
fn search(
    matrix: &PairMatrix,
    degrees: &[usize],
    start: u32,
    seen: &mut [bool],
    order: &mut Vec<u32>,
) {
    let mut next = order.len();
    order.push(start);
    seen[start as usize] = true;
    while next < order.len() {
        let from = order.len();
        for (j, _) in matrix.row(order[next] as usize) {
            if !std::mem::replace(&mut seen[j], true) {
                order.push(j as u32);
            }
        }
        order[from..].sort_by_key(|&j| degrees[j as usize]);
        next += 1;
    }
}
