//! VTK XML files: appended raw data, 64-bit headers, zlib in blocks of 4 MB.

use flate2::{Compression, write::ZlibEncoder};
use std::fmt::Write as _;
use std::io::{BufWriter, Write};
use std::path::Path;

/// Uncompressed bytes per block; readers decompress block by block.
const BLOCK: usize = 4 << 20;

/// Numbers of a data array.
#[derive(Clone, Debug)]
pub enum Numbers {
    /// `Float64`.
    Float(Vec<f64>),
    /// `Int64`.
    Integer(Vec<i64>),
    /// `UInt8`.
    Byte(Vec<u8>),
}

/// A named array with a fixed number of components per point or cell.
#[derive(Clone, Debug)]
pub struct Array {
    /// Name that ParaView shows.
    pub name: &'static str,
    /// Numbers per point or cell.
    pub components: usize,
    /// Point by point.
    pub numbers: Numbers,
}

impl Array {
    /// One number per point or cell.
    pub fn scalar(name: &'static str, values: Vec<f64>) -> Self {
        Self {
            name,
            components: 1,
            numbers: Numbers::Float(values),
        }
    }

    /// Three numbers per point or cell.
    pub fn vector(name: &'static str, values: impl IntoIterator<Item = [f64; 3]>) -> Self {
        Self {
            name,
            components: 3,
            numbers: Numbers::Float(values.into_iter().flatten().collect()),
        }
    }

    /// One integer per point or cell.
    pub fn integer(name: &'static str, values: Vec<i64>) -> Self {
        Self {
            name,
            components: 1,
            numbers: Numbers::Integer(values),
        }
    }

    fn vtk_type(&self) -> &'static str {
        match self.numbers {
            Numbers::Float(_) => "Float64",
            Numbers::Integer(_) => "Int64",
            Numbers::Byte(_) => "UInt8",
        }
    }

    fn bytes(&self) -> &[u8] {
        match &self.numbers {
            Numbers::Float(v) => bytemuck::cast_slice(v),
            Numbers::Integer(v) => bytemuck::cast_slice(v),
            Numbers::Byte(v) => v,
        }
    }

    pub(super) fn declaration(&self) -> String {
        format!(
            "type=\"{}\" Name=\"{}\" NumberOfComponents=\"{}\"",
            self.vtk_type(),
            self.name,
            self.components
        )
    }
}

/// Which grid a file holds.
#[derive(Clone, Debug)]
pub enum Topology {
    /// Cells of mixed types (`.vtu`).
    Unstructured {
        /// Points of all cells.
        connectivity: Vec<i64>,
        /// End of every cell in `connectivity`.
        offsets: Vec<i64>,
        /// VTK cell types.
        types: Vec<u8>,
    },
    /// Polylines (`.vtp`).
    Lines {
        /// Points of all lines.
        connectivity: Vec<i64>,
        /// End of every line in `connectivity`.
        offsets: Vec<i64>,
    },
}

impl Topology {
    fn grid(&self) -> &'static str {
        match self {
            Self::Unstructured { .. } => "UnstructuredGrid",
            Self::Lines { .. } => "PolyData",
        }
    }

    fn counts(&self) -> String {
        match self {
            Self::Unstructured { types, .. } => format!("NumberOfCells=\"{}\"", types.len()),
            Self::Lines { offsets, .. } => format!(
                "NumberOfVerts=\"0\" NumberOfLines=\"{}\" NumberOfStrips=\"0\" NumberOfPolys=\"0\"",
                offsets.len()
            ),
        }
    }

    fn arrays(&self) -> (&'static str, Vec<Array>) {
        let integers = |name, values: &[i64]| Array::integer(name, values.to_vec());
        match self {
            Self::Unstructured {
                connectivity,
                offsets,
                types,
            } => {
                let types = Array {
                    name: "types",
                    components: 1,
                    numbers: Numbers::Byte(types.clone()),
                };
                let (c, o) = (
                    integers("connectivity", connectivity),
                    integers("offsets", offsets),
                );
                ("Cells", vec![c, o, types])
            }
            Self::Lines {
                connectivity,
                offsets,
            } => {
                let (c, o) = (
                    integers("connectivity", connectivity),
                    integers("offsets", offsets),
                );
                ("Lines", vec![c, o])
            }
        }
    }
}

/// One rank's piece: points \[m\], cells or lines, data on both.
#[derive(Clone, Debug)]
pub struct Piece {
    /// Point coordinates \[m\].
    pub points: Vec<[f64; 3]>,
    /// Cells or lines.
    pub topology: Topology,
    /// Arrays with an entry for every point.
    pub point_data: Vec<Array>,
    /// Arrays with an entry for every cell or line.
    pub cell_data: Vec<Array>,
}

impl Piece {
    /// Writes the piece as a file of its own (`.vtu` or `.vtp`).
    ///
    /// # Errors
    /// Any error of the file system.
    pub fn write(&self, path: &Path) -> std::io::Result<()> {
        let points = Array::vector("Points", self.points.iter().copied());
        let (cells, topology) = self.topology.arrays();
        let mut body = Appended::default();
        let mut xml = String::new();
        let grid = self.topology.grid();
        let _ = writeln!(
            xml,
            "{}",
            header(grid, " compressor=\"vtkZLibDataCompressor\"")
        );
        let _ = writeln!(xml, "<{grid}>");
        let (n, counts) = (self.points.len(), self.topology.counts());
        let _ = writeln!(xml, "<Piece NumberOfPoints=\"{n}\" {counts}>");
        body.section(&mut xml, "PointData", &self.point_data)?;
        body.section(&mut xml, "CellData", &self.cell_data)?;
        body.section(&mut xml, "Points", std::slice::from_ref(&points))?;
        body.section(&mut xml, cells, &topology)?;
        let _ = writeln!(xml, "</Piece>\n</{grid}>\n<AppendedData encoding=\"raw\">");
        xml.push('_');
        let mut file = BufWriter::new(std::fs::File::create(path)?);
        file.write_all(xml.as_bytes())?;
        file.write_all(&body.bytes)?;
        file.write_all(b"\n</AppendedData>\n</VTKFile>\n")?;
        file.flush()
    }

    /// Writes the file that joins the pieces (`.pvtu`); `sources` are relative to it.
    ///
    /// # Errors
    /// Any error of the file system.
    pub fn write_index(&self, path: &Path, sources: &[String]) -> std::io::Result<()> {
        let grid = format!("P{}", self.topology.grid());
        let mut xml = header(&grid, "");
        let _ = writeln!(xml, "\n<{grid} GhostLevel=\"0\">");
        for (section, arrays) in [
            ("PPointData", &self.point_data),
            ("PCellData", &self.cell_data),
        ] {
            let _ = writeln!(xml, "<{section}>");
            for array in arrays {
                let _ = writeln!(xml, "<PDataArray {}/>", array.declaration());
            }
            let _ = writeln!(xml, "</{section}>");
        }
        let point = "<PDataArray type=\"Float64\" Name=\"Points\" NumberOfComponents=\"3\"/>";
        let _ = writeln!(xml, "<PPoints>{point}</PPoints>");
        for source in sources {
            let _ = writeln!(xml, "<Piece Source=\"{source}\"/>");
        }
        let _ = writeln!(xml, "</{grid}>\n</VTKFile>");
        std::fs::write(path, xml)
    }
}

pub(super) fn header(grid: &str, extra: &str) -> String {
    let order = if cfg!(target_endian = "big") {
        "BigEndian"
    } else {
        "LittleEndian"
    };
    format!(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"{grid}\" version=\"1.0\" byte_order=\"{order}\" header_type=\"UInt64\"{extra}>"
    )
}

/// The binary part, with the XML that points into it.
#[derive(Default)]
pub(super) struct Appended {
    pub bytes: Vec<u8>,
}

impl Appended {
    pub fn section(
        &mut self,
        xml: &mut String,
        name: &str,
        arrays: &[Array],
    ) -> std::io::Result<()> {
        let _ = writeln!(xml, "<{name}>");
        for array in arrays {
            let (declaration, offset) = (array.declaration(), self.bytes.len());
            let _ = writeln!(
                xml,
                "<DataArray {declaration} format=\"appended\" offset=\"{offset}\"/>"
            );
            self.push(array.bytes())?;
        }
        let _ = writeln!(xml, "</{name}>");
        Ok(())
    }

    /// Header (blocks, block size, size of a partial last block, compressed sizes), then the blocks.
    fn push(&mut self, data: &[u8]) -> std::io::Result<()> {
        let blocks = data
            .chunks(BLOCK)
            .map(|block| {
                let mut encoder = ZlibEncoder::new(Vec::new(), Compression::fast());
                encoder.write_all(block)?;
                encoder.finish()
            })
            .collect::<std::io::Result<Vec<_>>>()?;
        let partial = data.len() % BLOCK;
        let sizes = blocks.iter().map(Vec::len);
        for number in [blocks.len(), BLOCK, partial].into_iter().chain(sizes) {
            self.bytes.extend_from_slice(&(number as u64).to_ne_bytes());
        }
        for block in &blocks {
            self.bytes.extend_from_slice(block);
        }
        Ok(())
    }
}

/// A `.pvd` file: which data set belongs to which time.
#[derive(Clone, Debug, Default)]
pub struct Collection {
    entries: Vec<(f64, String)>,
}

impl Collection {
    /// Reads the entries of an earlier run up to `time` \[s\]; none when there is no file.
    pub fn resume(path: &Path, time: f64) -> Self {
        let text = std::fs::read_to_string(path).unwrap_or_default();
        let attribute = |line: &str, name: &str| {
            let start = line.find(&format!("{name}=\""))? + name.len() + 2;
            let length = line[start..].find('"')?;
            Some(line[start..start + length].to_owned())
        };
        let entry = |line: &str| {
            let t: f64 = attribute(line, "timestep")?.parse().ok()?;
            Some((t, attribute(line, "file")?))
        };
        let entries = text.lines().filter_map(entry);
        Self {
            entries: entries.filter(|(t, _)| *t <= time).collect(),
        }
    }

    /// Adds the files of a time, in place of earlier ones of the same time, and writes the collection anew.
    ///
    /// # Errors
    /// Any error of the file system.
    pub fn add(&mut self, path: &Path, time: f64, files: Vec<String>) -> std::io::Result<()> {
        self.entries.retain(|(t, _)| *t != time);
        self.entries.extend(files.into_iter().map(|f| (time, f)));
        let mut xml = String::from(
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\">\n<Collection>\n",
        );
        let (mut part, mut previous) = (0, f64::NAN);
        for (time, file) in &self.entries {
            part = if *time == previous { part + 1 } else { 0 };
            previous = *time;
            let _ = writeln!(
                xml,
                "<DataSet timestep=\"{time:?}\" part=\"{part}\" file=\"{file}\"/>"
            );
        }
        xml.push_str("</Collection>\n</VTKFile>\n");
        super::replace_file(path, xml.as_bytes())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn piece() -> Piece {
        let points: Vec<[f64; 3]> = (0..4).map(|i| [f64::from(i), 0.5, -1.0]).collect();
        Piece {
            topology: Topology::Unstructured {
                connectivity: vec![0, 1, 2, 3],
                offsets: vec![4],
                types: vec![10],
            },
            point_data: vec![Array::vector("velocity", points.clone())],
            cell_data: vec![Array::integer("rank", vec![3])],
            points,
        }
    }

    #[test]
    fn files_are_repeatable_and_offsets_point_at_headers() {
        let folder = tempfile::tempdir().expect("folder");
        let paths = ["a.vtu", "b.vtu"].map(|n| folder.path().join(n));
        paths
            .iter()
            .for_each(|p| piece().write(p).expect("written"));
        let [a, b] = paths.map(|p| std::fs::read(p).expect("read"));
        assert_eq!(a, b);
        let start = a.windows(6).position(|w| w == b"raw\">\n").expect("data") + 7;
        let text = String::from_utf8_lossy(&a[..start]).into_owned();
        let offsets = text.match_indices("offset=\"").map(|(i, m)| {
            let rest = &text[i + m.len()..];
            rest[..rest.find('"').expect("quote")]
                .parse::<usize>()
                .expect("offset")
        });
        for offset in offsets {
            let word = |k: usize| {
                let at = start + offset + 8 * k;
                u64::from_ne_bytes(a[at..at + 8].try_into().expect("eight bytes"))
            };
            assert_eq!((word(0), word(1)), (1, BLOCK as u64));
            assert!(word(2) > 0 && word(3) > 0);
        }
    }

    #[test]
    fn a_collection_forgets_what_is_later_than_the_checkpoint() {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("fluid.pvd");
        let mut collection = Collection::default();
        for k in 0..4 {
            collection
                .add(&path, 0.1 * f64::from(k), vec![format!("fluid/{k}.pvtu")])
                .expect("written");
        }
        let again = Collection::resume(&path, 0.2 + 1e-12);
        assert_eq!(again.entries.len(), 3);
        assert_eq!(again.entries[1], (0.1, "fluid/1.pvtu".to_owned()));
    }
}
