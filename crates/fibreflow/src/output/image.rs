//! Fields on regular grids as VTK image data, a slab a rank (`.vti`), joined by a `.pvti`.

use super::vtk::{Appended, Array, header};
use std::fmt::Write as _;
use std::io::{BufWriter, Write};
use std::path::Path;

/// A regular grid of points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Image {
    /// First point \[m\].
    pub origin: [f64; 3],
    /// Distances \[m\]; any positive number along directions of one point.
    pub spacing: [f64; 3],
    /// Points in each direction.
    pub counts: [usize; 3],
}

/// First and last point in each direction.
pub type Extent = [[usize; 2]; 3];

fn numbers<T: std::fmt::Debug>(values: impl IntoIterator<Item = T>) -> String {
    let words: Vec<String> = values.into_iter().map(|v| format!("{v:?}")).collect();
    words.join(" ")
}

impl Image {
    fn declaration(&self) -> String {
        let whole = self.counts.map(|n| [0, n - 1]).concat();
        format!(
            "WholeExtent=\"{}\" Origin=\"{}\" Spacing=\"{}\"",
            numbers(whole),
            numbers(self.origin),
            numbers(self.spacing)
        )
    }

    /// Writes a slab with the values of its points, x fastest.
    ///
    /// # Errors
    /// Any error of the file system.
    pub fn write(&self, path: &Path, extent: Extent, arrays: &[Array]) -> std::io::Result<()> {
        let mut body = Appended::default();
        let mut xml = header("ImageData", " compressor=\"vtkZLibDataCompressor\"");
        let extent = numbers(extent.concat());
        let _ = writeln!(xml, "\n<ImageData {}>", self.declaration());
        let _ = writeln!(xml, "<Piece Extent=\"{extent}\">");
        body.section(&mut xml, "PointData", arrays)?;
        let _ = writeln!(
            xml,
            "</Piece>\n</ImageData>\n<AppendedData encoding=\"raw\">"
        );
        xml.push('_');
        let mut file = BufWriter::new(std::fs::File::create(path)?);
        file.write_all(xml.as_bytes())?;
        file.write_all(&body.bytes)?;
        file.write_all(b"\n</AppendedData>\n</VTKFile>\n")?;
        file.flush()
    }

    /// Writes the file that joins slabs; their names are relative to it.
    ///
    /// # Errors
    /// Any error of the file system.
    pub fn write_index(
        &self,
        path: &Path,
        slabs: &[(Extent, String)],
        arrays: &[Array],
    ) -> std::io::Result<()> {
        let mut xml = header("PImageData", "");
        let _ = writeln!(
            xml,
            "\n<PImageData {} GhostLevel=\"0\">",
            self.declaration()
        );
        let _ = writeln!(xml, "<PPointData>");
        for array in arrays {
            let _ = writeln!(xml, "<PDataArray {}/>", array.declaration());
        }
        let _ = writeln!(xml, "</PPointData>");
        for (extent, source) in slabs {
            let extent = numbers(extent.concat());
            let _ = writeln!(xml, "<Piece Extent=\"{extent}\" Source=\"{source}\"/>");
        }
        let _ = writeln!(xml, "</PImageData>\n</VTKFile>");
        std::fs::write(path, xml)
    }
}
