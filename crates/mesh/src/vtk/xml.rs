//! VTK XML files. Format: VTK user's guide, "XML file formats".

use super::data::{Kind, Storage, Stream};
use super::failed;
use super::grid::Grid;
use crate::MeshError;
use std::collections::HashMap;

type Attributes<'a> = HashMap<&'a str, &'a str>;

/// An opening or closing tag.
struct Tag<'a> {
    /// With a `/` at its start where it closes.
    name: &'a str,
    attributes: Attributes<'a>,
    /// It has no content.
    empty: bool,
    /// Place behind it.
    end: usize,
}

/// A `DataArray` and its place.
struct Listed<'a> {
    section: &'a str,
    attributes: Attributes<'a>,
    text: &'a [u8],
}

/// Appended arrays.
struct Appended<'a> {
    bytes: &'a [u8],
    base64: bool,
}

pub(super) fn read(
    path: &str,
    bytes: &[u8],
    wanted: &dyn Fn(&str) -> bool,
) -> Result<Grid, MeshError> {
    let refuse = |reason: String| failed(path, "XML", reason);
    let mut at = 0;
    let mut file = None;
    let mut section = "";
    let mut pieces = 0;
    let mut listed = Vec::new();
    let mut appended = None;
    while let Some(tag) = next_tag(bytes, at).map_err(refuse)? {
        at = tag.end;
        match tag.name {
            "VTKFile" => file = Some(tag.attributes),
            "Piece" => pieces += 1,
            "Points" | "Cells" | "CellData" | "PointData" | "FieldData" => section = tag.name,
            "DataArray" => {
                let length = if tag.empty {
                    0
                } else {
                    let end = find(&bytes[at..], b"</DataArray");
                    end.ok_or_else(|| refuse("</DataArray> is missing".into()))?
                };
                listed.push(Listed {
                    section,
                    attributes: tag.attributes,
                    text: &bytes[at..at + length],
                });
                at += length;
            }
            "AppendedData" => {
                let mark = find(&bytes[at..], b"_");
                let start = mark.ok_or_else(|| refuse("appended data lack their `_`".into()))?;
                appended = Some(Appended {
                    bytes: &bytes[at + start + 1..],
                    base64: tag.attributes.get("encoding") == Some(&"base64"),
                });
                break;
            }
            _ => {}
        }
    }
    let file = file.ok_or_else(|| refuse("this is no VTK file: <VTKFile> is missing".into()))?;
    let storage = storage(&file).map_err(refuse)?;
    if pieces != 1 {
        return Err(refuse(format!(
            "the grid has {pieces} pieces; one is read: merge them (ParaView: Merge Blocks, with merged points)"
        )));
    }
    let reader = Reader {
        path,
        storage,
        appended,
        listed,
    };
    reader.grid(wanted)
}

fn storage(file: &Attributes<'_>) -> Result<Storage, String> {
    match file.get("type") {
        Some(&"UnstructuredGrid") => {}
        other => {
            let other = other.unwrap_or(&"of no type");
            return Err(format!("the file is {other}; an UnstructuredGrid is read"));
        }
    }
    let compressor = file.get("compressor").copied().unwrap_or("");
    if !["", "vtkZLibDataCompressor"].contains(&compressor) {
        return Err(format!(
            "compression by {compressor} is not read; save with zlib or without"
        ));
    }
    Ok(Storage {
        big: file.get("byte_order") == Some(&"BigEndian"),
        header: match file.get("header_type") {
            Some(&"UInt64") => Kind::U64,
            _ => Kind::U32,
        },
        compressed: !compressor.is_empty(),
    })
}

struct Reader<'a> {
    path: &'a str,
    storage: Storage,
    appended: Option<Appended<'a>>,
    listed: Vec<Listed<'a>>,
}

impl Reader<'_> {
    fn grid(&self, wanted: &dyn Fn(&str) -> bool) -> Result<Grid, MeshError> {
        let of_cells = |name| self.one("Cells", Some(name));
        let points = self.one("Points", None)?;
        let (types, ends) = (of_cells("types")?, of_cells("offsets")?);
        let grid = Grid::new(&points, &types, &ends, &of_cells("connectivity")?);
        let mut grid = grid.map_err(|reason| failed(self.path, "<Piece>", reason))?;
        for array in self.listed.iter().filter(|a| a.section == "CellData") {
            let name = array.attributes.get("Name").copied().unwrap_or("");
            let components = array.attributes.get("NumberOfComponents");
            let scalar = components.is_none_or(|n| ["", "0", "1"].contains(n));
            let values = (scalar && wanted(name)).then(|| self.values(array));
            grid.arrays.push((name.to_owned(), values.transpose()?));
        }
        Ok(grid)
    }

    /// An array that must be there.
    fn one(&self, section: &str, name: Option<&str>) -> Result<Vec<f64>, MeshError> {
        let fits = |a: &&Listed<'_>| {
            a.section == section && (name.is_none() || a.attributes.get("Name").copied() == name)
        };
        match self.listed.iter().find(fits) {
            Some(array) => self.values(array),
            None => {
                let name = name.unwrap_or("points");
                let reason = format!("the array `{name}` of <{section}> is missing");
                Err(failed(self.path, "<Piece>", reason))
            }
        }
    }

    fn values(&self, array: &Listed<'_>) -> Result<Vec<f64>, MeshError> {
        let attribute = |key: &str| array.attributes.get(key).copied();
        let refuse = |reason: String| {
            let name = attribute("Name").unwrap_or("points");
            failed(
                self.path,
                &format!("array `{name}` of <{}>", array.section),
                reason,
            )
        };
        let kind = attribute("type").unwrap_or("");
        let kind = Kind::named(kind).ok_or_else(|| refuse(format!("type `{kind}` is not read")))?;
        match attribute("format").unwrap_or("ascii") {
            "ascii" => {
                let text = std::str::from_utf8(array.text);
                let text = text.map_err(|e| refuse(e.to_string()))?;
                let number = |word: &str| {
                    word.parse::<f64>()
                        .map_err(|_| refuse(format!("`{word}` is no number")))
                };
                text.split_ascii_whitespace().map(number).collect()
            }
            "binary" => {
                let solid: Vec<u8> = (array.text.iter().copied())
                    .filter(|b| !b.is_ascii_whitespace())
                    .collect();
                let stream = Stream {
                    bytes: &solid,
                    base64: true,
                };
                self.storage.array(stream, kind).map_err(refuse)
            }
            "appended" => {
                let offset = attribute("offset").and_then(|o| o.trim().parse::<usize>().ok());
                let place = self.appended.as_ref().zip(offset);
                let place = place.and_then(|(a, offset)| Some((a, a.bytes.get(offset..)?)));
                let (appended, bytes) = place
                    .ok_or_else(|| refuse("there are no appended data at its offset".into()))?;
                let stream = Stream {
                    bytes,
                    base64: appended.base64,
                };
                self.storage.array(stream, kind).map_err(refuse)
            }
            other => Err(refuse(format!("format `{other}` is not known"))),
        }
    }
}

fn find(bytes: &[u8], text: &[u8]) -> Option<usize> {
    bytes.windows(text.len()).position(|w| w == text)
}

/// The next tag at or behind a place; comments and declarations are passed over.
fn next_tag(bytes: &[u8], mut at: usize) -> Result<Option<Tag<'_>>, String> {
    loop {
        let Some(start) = bytes[at..].iter().position(|&b| b == b'<') else {
            return Ok(None);
        };
        at += start + 1;
        let rest = &bytes[at..];
        let skipped: &[u8] = match rest {
            [b'?', ..] => b"?>",
            [b'!', b'-', b'-', ..] => b"-->",
            [b'!', ..] => b">",
            _ => break,
        };
        let end = find(rest, skipped).ok_or("a comment does not end")?;
        at += end + skipped.len();
    }
    let mut quote = None;
    let close = bytes[at..].iter().position(|&b| {
        match quote {
            Some(q) if b == q => quote = None,
            None if b == b'"' || b == b'\'' => quote = Some(b),
            _ => {}
        }
        quote.is_none() && b == b'>'
    });
    let close = close.ok_or("a tag does not end")?;
    let text = std::str::from_utf8(&bytes[at..at + close]).map_err(|e| e.to_string())?;
    let body = text.trim_end_matches('/');
    let (name, mut rest) = body.split_at(body.find(char::is_whitespace).unwrap_or(body.len()));
    let mut attributes = Attributes::new();
    while let Some((key, after)) = rest.split_once('=') {
        let after = after.trim_start();
        let mark = after.chars().next().filter(|c| "\"'".contains(*c));
        let mark = mark.ok_or_else(|| format!("attribute `{}` has no quotes", key.trim()))?;
        let (value, left) = after[1..]
            .split_once(mark)
            .ok_or_else(|| format!("attribute `{}` does not end", key.trim()))?;
        attributes.insert(key.trim(), value);
        rest = left;
    }
    Ok(Some(Tag {
        name,
        attributes,
        empty: text.ends_with('/'),
        end: at + close + 1,
    }))
}
