//! Centre lines from files: CSV tables, and VTK PolyData as meshio, pyvista and ParaView write it.

use super::csv::Csv;
use nalgebra::Vector3;
use std::collections::BTreeMap;
use std::path::Path;
use vtkio::Vtk;
use vtkio::model::{DataSet, PolyDataPiece};

type Nodes = Vec<Vector3<f64>>;

/// The polylines of a file by its ending, `csv` or `vtp`: nodes \[m\] of each.
///
/// # Errors
/// What is wrong with the file.
pub fn read(path: &Path) -> Result<Vec<Nodes>, String> {
    let lines = match path.extension().and_then(|ending| ending.to_str()) {
        Some("csv") => table(path),
        Some("vtp") => poly_data(path),
        _ => Err("it is neither a `.csv` nor a `.vtp` file".to_owned()),
    }?;
    match lines.iter().position(|line| line.len() < 2) {
        Some(k) => Err(format!("line {} of the file has no second node", k + 1)),
        None if lines.is_empty() => Err("it holds no line".to_owned()),
        None => Ok(lines),
    }
}

/// Columns x, y, z, and `fibre` where there are several: in the order of these numbers.
fn table(path: &Path) -> Result<Vec<Nodes>, String> {
    let table = Csv::read(path, &["x", "y", "z", "fibre"])?;
    let [Some(x), Some(y), Some(z)] = ["x", "y", "z"].map(|name| table.column(name)) else {
        return Err("line 1: the columns x, y and z are needed".to_owned());
    };
    let numbers = table.column("fibre");
    let mut fibres: BTreeMap<i64, Nodes> = BTreeMap::new();
    for k in 0..table.len() {
        let number = numbers.as_ref().map_or(0.0, |n| n[k]);
        if number.fract() != 0.0 || number.abs() > 1e15 {
            return Err(format!("`{number}` is no number of a fibre"));
        }
        let node = Vector3::new(x[k], y[k], z[k]);
        fibres.entry(number as i64).or_default().push(node);
    }
    Ok(fibres.into_values().collect())
}

/// Every line cell of every piece.
fn poly_data(path: &Path) -> Result<Vec<Nodes>, String> {
    let mut bytes = std::fs::read(path).map_err(|e| e.to_string())?;
    // `vtkio` refuses the empty cell arrays that VTK writes, and nothing but points and lines matters.
    for section in ["PointData", "CellData", "Verts", "Strips", "Polys"] {
        strip(&mut bytes, section);
    }
    let file = Vtk::parse_xml(&bytes[..]).map_err(|e| e.to_string())?;
    let DataSet::PolyData { pieces, .. } = file.data else {
        return Err("it holds no PolyData".to_owned());
    };
    let mut all = Vec::new();
    for piece in pieces {
        let piece = piece
            .into_loaded_piece_data(None)
            .map_err(|e| e.to_string())?;
        all.extend(lines(piece)?);
    }
    Ok(all)
}

/// Removes every XML element of this name.
fn strip(bytes: &mut Vec<u8>, name: &str) {
    let find = |bytes: &[u8], what: &str, from: usize| {
        let places = bytes[from..].windows(what.len());
        let place = places.into_iter().position(|w| w == what.as_bytes());
        place.map(|p| from + p)
    };
    let (opening, closing) = (format!("<{name}"), format!("</{name}>"));
    while let Some(start) = find(bytes, &opening, 0)
        && let Some(end) = find(bytes, &closing, start)
    {
        bytes.drain(start..end + closing.len());
    }
}

fn lines(piece: PolyDataPiece) -> Result<Vec<Nodes>, String> {
    let numbers = piece.points.cast_into::<f64>();
    let numbers = numbers.ok_or("its points are no numbers")?;
    let points: Nodes = numbers
        .chunks_exact(3)
        .map(|x| Vector3::new(x[0], x[1], x[2]))
        .collect();
    let (connectivity, ends) = piece.lines.map(|l| l.into_xml()).unwrap_or_default();
    let mut start = 0;
    let cell = |&end: &u64| {
        let range = start..end as usize;
        start = end as usize;
        let nodes = connectivity.get(range);
        let nodes = nodes.ok_or("its lines end beyond their points")?;
        let node = |&k: &u64| points.get(k as usize).copied();
        let line: Option<Nodes> = nodes.iter().map(node).collect();
        line.ok_or_else(|| "a line has a point that is not there".to_owned())
    };
    ends.iter().map(cell).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(name: &str, text: &str) -> (tempfile::TempDir, std::path::PathBuf) {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join(name);
        std::fs::write(&path, text).expect("written");
        (folder, path)
    }

    const TWO_LINES: &str = r#"<?xml version="1.0"?>
<VTKFile type="PolyData" version="0.1" byte_order="LittleEndian">
<PolyData><Piece NumberOfPoints="5" NumberOfVerts="0" NumberOfLines="2" NumberOfStrips="0" NumberOfPolys="0">
<Points><DataArray type="Float64" NumberOfComponents="3" format="ascii">
0 0 0 1 0 0 2 0.5 0 0 0 3 0 1 3
</DataArray></Points>
<Verts><DataArray type="Int64" Name="connectivity" format="ascii"></DataArray>
<DataArray type="Int64" Name="offsets" format="ascii">0</DataArray></Verts>
<Lines><DataArray type="Int64" Name="connectivity" format="ascii">2 1 0 3 4</DataArray>
<DataArray type="Int64" Name="offsets" format="ascii">3 5</DataArray></Lines>
</Piece></PolyData></VTKFile>"#;

    #[test]
    fn lines_of_poly_data_keep_their_order() {
        let (_folder, path) = file("lines.vtp", TWO_LINES);
        let lines = read(&path).expect("readable");
        assert_eq!(lines.len(), 2);
        assert_eq!(lines[0][0], Vector3::new(2.0, 0.5, 0.0));
        assert_eq!(lines[1][1], Vector3::new(0.0, 1.0, 3.0));
    }

    #[test]
    fn a_point_that_is_not_there_is_told() {
        let (_folder, path) = file("lines.vtp", &TWO_LINES.replace("3 4<", "3 7<"));
        let error = read(&path).expect_err("refused");
        assert!(error.contains("not there"), "{error}");
    }

    #[test]
    fn fibres_of_a_table_come_by_their_numbers() {
        let (_folder, path) = file("f.csv", "fibre,x,y,z\n7,0,0,0\n2,1,0,0\n7,0,1,0\n2,2,0,0\n");
        let lines = read(&path).expect("readable");
        assert_eq!(lines[0], vec![Vector3::x(), Vector3::x() * 2.0]);
        assert_eq!(lines[1][1], Vector3::y());
        let (_folder, path) = file("f.txt", "x,y,z\n0,0,0\n1,0,0\n");
        assert!(read(&path).expect_err("ending").contains(".csv"));
    }
}
