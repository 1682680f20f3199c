//! Legacy VTK files. Format: "VTK file formats" of the VTK user's guide; 5.1 lists cells by offsets.

use super::data::Kind;
use super::grid::Grid;
use crate::MeshError;
use crate::source::Source;

pub(super) fn read(
    path: &str,
    bytes: &[u8],
    wanted: &dyn Fn(&str) -> bool,
) -> Result<Grid, MeshError> {
    let mut source = Source::new(path, bytes);
    let first = source.line();
    if !first.to_ascii_lowercase().starts_with("# vtk datafile") {
        return Err(source.error(
            "this is no VTK file: it begins neither with `<VTKFile` nor with `# vtk DataFile Version`",
        ));
    }
    let _title = source.line();
    let binary = match source.line().to_ascii_uppercase().as_str() {
        "ASCII" => false,
        "BINARY" => true,
        other => return Err(source.error(format!("`{other}` where ASCII or BINARY should be"))),
    };
    let mut file = File {
        source,
        binary,
        cells: 0,
        arrays: Vec::new(),
        of_cells: false,
    };
    file.grid(wanted)
}

/// The numbers of a grid, before they are checked against each other.
#[derive(Default)]
struct Raw {
    points: Vec<f64>,
    types: Vec<f64>,
    ends: Vec<f64>,
    connectivity: Vec<f64>,
}

struct File<'a> {
    source: Source<'a>,
    binary: bool,
    /// Tuples of the attributes that are being read.
    cells: usize,
    arrays: Vec<(String, Option<Vec<f64>>)>,
    /// Attributes belong to cells, not points.
    of_cells: bool,
}

impl File<'_> {
    fn grid(&mut self, wanted: &dyn Fn(&str) -> bool) -> Result<Grid, MeshError> {
        let mut raw = Raw::default();
        while let Some(word) = self.source.word() {
            self.source.section = word.to_owned();
            match word.to_ascii_uppercase().as_str() {
                "DATASET" => {
                    let kind = self.source.word().unwrap_or("nothing");
                    if kind != "UNSTRUCTURED_GRID" {
                        return Err(self.source.error(format!(
                            "the file is of {kind}; an UNSTRUCTURED_GRID is read"
                        )));
                    }
                }
                "POINTS" => {
                    let count = self.count()?;
                    let kind = self.kind()?;
                    raw.points = self.numbers(3 * count, kind)?;
                }
                "CELLS" => self.cells(&mut raw)?,
                "CELL_TYPES" => {
                    let count = self.count()?;
                    raw.types = self.numbers(count, Kind::I32)?;
                }
                "CELL_DATA" => {
                    self.cells = self.count()?;
                    self.of_cells = true;
                }
                "POINT_DATA" => {
                    self.cells = self.count()?;
                    self.of_cells = false;
                }
                "METADATA" => while !self.source.line().is_empty() {},
                _ => self.attribute(word, wanted)?,
            }
        }
        let grid = Grid::new(&raw.points, &raw.types, &raw.ends, &raw.connectivity);
        self.source.section.clear();
        let mut grid = grid.map_err(|reason| self.source.error(reason))?;
        grid.arrays = std::mem::take(&mut self.arrays);
        Ok(grid)
    }

    fn count(&mut self) -> Result<usize, MeshError> {
        self.source.count()
    }

    fn kind(&mut self) -> Result<Kind, MeshError> {
        let name = self.source.word().unwrap_or("");
        // VTK writes the ids of 64-bit builds as `vtktypeint64`, older ones as `vtkIdType`, in four bytes.
        let kind = Kind::named(&name.to_ascii_lowercase());
        kind.ok_or_else(|| {
            self.source
                .error(format!("numbers of type `{name}` are not read"))
        })
    }

    /// Numbers in the mode of the file; binary ones begin on the next line.
    fn numbers(&mut self, count: usize, kind: Kind) -> Result<Vec<f64>, MeshError> {
        if self.binary {
            self.source.line();
            let bytes = self.source.take(count.saturating_mul(kind.size()))?;
            return Ok(kind.numbers(bytes, true));
        }
        (0..count).map(|_| self.source.text()).collect()
    }

    /// As sizes and points, or (5.1) as offsets and points.
    fn cells(&mut self, raw: &mut Raw) -> Result<(), MeshError> {
        let (first, second) = (self.count()?, self.count()?);
        if self.source.next_is("OFFSETS") {
            self.source.word();
            let kind = self.kind()?;
            let offsets = self.numbers(first, kind)?;
            raw.ends = offsets.get(1..).unwrap_or_default().to_vec();
            let word = self.source.word().unwrap_or("the end of the file");
            if word != "CONNECTIVITY" {
                return Err(self
                    .source
                    .error(format!("{word} where CONNECTIVITY should be")));
            }
            let kind = self.kind()?;
            raw.connectivity = self.numbers(second, kind)?;
            return Ok(());
        }
        let listed = self.numbers(second, Kind::I32)?;
        let mut rest = &listed[..];
        while let [size, others @ ..] = rest {
            let Some((points, others)) = others.split_at_checked(*size as usize) else {
                return Err(self.source.error("the list ends inside a cell"));
            };
            raw.connectivity.extend_from_slice(points);
            raw.ends.push(raw.connectivity.len() as f64);
            rest = others;
        }
        Ok(())
    }

    /// An array of points or cells.
    fn attribute(&mut self, word: &str, wanted: &dyn Fn(&str) -> bool) -> Result<(), MeshError> {
        match word.to_ascii_uppercase().as_str() {
            "FIELD" => {
                let _name = self.source.word();
                for _ in 0..self.count()? {
                    let name = self.source.word().unwrap_or("").to_owned();
                    let (components, tuples) = (self.count()?, self.count()?);
                    let kind = self.kind()?;
                    let count = components.saturating_mul(tuples);
                    let values = self.numbers(count, kind)?;
                    // A block about the array may follow, up to an empty line.
                    if self.source.next_is("METADATA") {
                        self.source.word();
                        self.source.line();
                        while !self.source.line().is_empty() {}
                    }
                    self.keep(name, components, values, wanted);
                }
                Ok(())
            }
            "SCALARS" => {
                let name = self.source.word().unwrap_or("").to_owned();
                let kind = self.kind()?;
                let components = match self.source.line() {
                    "" => 1,
                    text => {
                        let number = text.parse();
                        number.map_err(|_| self.source.error(format!("`{text}` is no count")))?
                    }
                };
                if self.source.next_is("LOOKUP_TABLE") {
                    self.source.word();
                    self.source.word();
                } else if self.binary {
                    return Err(self.source.error("LOOKUP_TABLE is missing"));
                }
                let values = self.numbers(self.cells.saturating_mul(components), kind)?;
                self.keep(name, components, values, wanted);
                Ok(())
            }
            "VECTORS" | "NORMALS" | "TENSORS" => {
                let components = if word.eq_ignore_ascii_case("TENSORS") {
                    9
                } else {
                    3
                };
                let _name = self.source.word();
                let kind = self.kind()?;
                self.numbers(self.cells.saturating_mul(components), kind)?;
                Ok(())
            }
            _ => Err(self.source.error(format!("`{word}` is not read here"))),
        }
    }

    fn keep(
        &mut self,
        name: String,
        components: usize,
        values: Vec<f64>,
        wanted: &dyn Fn(&str) -> bool,
    ) {
        if self.of_cells {
            let values = (components == 1 && wanted(&name)).then_some(values);
            self.arrays.push((name, values));
        }
    }
}
