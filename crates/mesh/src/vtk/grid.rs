//! An unstructured grid as a file lists it.

/// Points, cells, and the cell arrays that were asked for.
#[derive(Debug, Default)]
pub(super) struct Grid {
    pub points: Vec<[f64; 3]>,
    /// VTK cell types.
    pub types: Vec<u8>,
    /// End of every cell in `connectivity`.
    pub ends: Vec<usize>,
    pub connectivity: Vec<u32>,
    /// Cell arrays by name, without numbers where they are not wanted.
    pub arrays: Vec<(String, Option<Vec<f64>>)>,
}

impl Grid {
    /// From the numbers of a file, all of which are checked against each other.
    pub fn new(
        coordinates: &[f64],
        types: &[f64],
        ends: &[f64],
        connectivity: &[f64],
    ) -> Result<Self, String> {
        if !coordinates.len().is_multiple_of(3) {
            return Err("the points do not have three coordinates each".into());
        }
        let points: Vec<[f64; 3]> = coordinates
            .chunks_exact(3)
            .map(|x| [x[0], x[1], x[2]])
            .collect();
        if types.len() != ends.len() {
            let (n, m) = (types.len(), ends.len());
            return Err(format!("{n} cells have a type and {m} have points"));
        }
        let mut last = 0.0;
        for &end in ends {
            if end.fract() != 0.0 || end < last || end > connectivity.len() as f64 {
                return Err(format!("a cell ends at entry {end} of the connectivity"));
            }
            last = end;
        }
        let beyond = |p: &&f64| !(0.0..points.len() as f64).contains(*p) || p.fract() != 0.0;
        if let Some(point) = connectivity.iter().find(beyond) {
            let count = points.len();
            return Err(format!("a cell has point {point}, but there are {count}"));
        }
        Ok(Self {
            types: types.iter().map(|&t| t as u8).collect(),
            ends: ends.iter().map(|&e| e as usize).collect(),
            connectivity: connectivity.iter().map(|&p| p as u32).collect(),
            points,
            arrays: Vec::new(),
        })
    }

    /// Type and points of every cell.
    pub fn cells(&self) -> impl Iterator<Item = (u8, &[u32])> {
        let starts = std::iter::once(0).chain(self.ends.iter().copied());
        let ranges = starts.zip(&self.ends);
        let points = ranges.map(|(start, &end)| &self.connectivity[start..end]);
        self.types.iter().copied().zip(points)
    }
}
