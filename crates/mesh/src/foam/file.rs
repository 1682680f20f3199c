//! Files of an OpenFOAM mesh. Format: OpenFOAM user guide, "Basic input/output file format"; binary lists as it writes them.

use crate::MeshError;

/// A cursor over a file.
pub(super) struct File<'a> {
    path: &'a str,
    bytes: &'a [u8],
    at: usize,
    binary: bool,
    /// Bytes of a whole number.
    label: usize,
    /// Bytes of a real number.
    scalar: usize,
}

/// An entry of `boundary`.
#[derive(Debug, Default)]
pub(super) struct Patch {
    pub name: String,
    pub kind: String,
    pub start: usize,
    pub faces: usize,
    pub neighbour: Option<String>,
}

impl<'a> File<'a> {
    /// Reads the header.
    pub fn new(path: &'a str, bytes: &'a [u8]) -> Result<Self, MeshError> {
        let mut file = Self {
            path,
            bytes,
            at: 0,
            binary: false,
            label: 4,
            scalar: 8,
        };
        if file.token() != "FoamFile" {
            return Err(file.error("this is no OpenFOAM file: it does not begin with FoamFile"));
        }
        for (key, value) in file.dictionary()? {
            match key {
                "format" => file.binary = value == "binary",
                "arch" => {
                    let number = |key: &str, default| {
                        let place = value.find(key).map(|k| &value[k + key.len()..]);
                        let end =
                            |v: &str| v.find(|c: char| !c.is_ascii_digit()).unwrap_or(v.len());
                        place
                            .and_then(|v| v[..end(v)].parse::<usize>().ok())
                            .map_or(default, |bits| bits / 8)
                    };
                    if value.contains("MSB") {
                        return Err(file.error(
                            "the file is big-endian: write it on this machine, or as text",
                        ));
                    }
                    (file.label, file.scalar) = (number("label=", 4), number("scalar=", 8));
                }
                _ => {}
            }
        }
        if !([4, 8].contains(&file.label) && [4, 8].contains(&file.scalar)) {
            return Err(file.error("labels and scalars of 32 or 64 bits are read"));
        }
        Ok(file)
    }

    pub fn error(&self, reason: impl Into<String>) -> MeshError {
        let lines = self.bytes[..self.at].iter().filter(|b| **b == b'\n');
        MeshError::Read {
            path: self.path.to_owned(),
            place: format!("line {}", 1 + lines.count()),
            reason: reason.into(),
        }
    }

    /// The next word or bracket, comments passed over; empty at the end.
    fn token(&mut self) -> &'a str {
        loop {
            let rest = &self.bytes[self.at..];
            self.at += rest.iter().take_while(|b| b.is_ascii_whitespace()).count();
            let rest = &self.bytes[self.at..];
            let end: &[u8] = if rest.starts_with(b"//") {
                b"\n"
            } else if rest.starts_with(b"/*") {
                b"*/"
            } else {
                break;
            };
            let found = rest.windows(end.len()).skip(2).position(|w| w == end);
            self.at += found.map_or(rest.len(), |n| n + 2 + end.len());
        }
        let rest = &self.bytes[self.at..];
        let single = |b: &u8| b"(){};".contains(b);
        let length = match rest.first() {
            None => 0,
            Some(b'"') => rest[1..]
                .iter()
                .position(|b| *b == b'"')
                .map_or(rest.len(), |n| n + 2),
            Some(b) if single(b) => 1,
            Some(_) => rest
                .iter()
                .take_while(|b| !b.is_ascii_whitespace() && !single(b))
                .count(),
        };
        self.at += length;
        std::str::from_utf8(&rest[..length])
            .unwrap_or("?")
            .trim_matches('"')
    }

    fn expect(&mut self, wanted: &str) -> Result<(), MeshError> {
        match self.token() {
            found if found == wanted => Ok(()),
            "" => Err(self.error(format!("the file ends where `{wanted}` should be"))),
            found => Err(self.error(format!("`{found}` where `{wanted}` should be"))),
        }
    }

    fn number<T: std::str::FromStr>(&mut self) -> Result<T, MeshError> {
        let word = self.token();
        word.parse()
            .map_err(|_| self.error(format!("`{word}` where a number should be")))
    }

    /// `{ key value; … }`; of values in several words the first.
    fn dictionary(&mut self) -> Result<Vec<(&'a str, &'a str)>, MeshError> {
        self.expect("{")?;
        let mut entries = Vec::new();
        loop {
            let key = self.token();
            if key == "}" {
                return Ok(entries);
            }
            let value = self.token();
            let mut word = value;
            while word != ";" {
                if ["", "}"].contains(&word) {
                    return Err(self.error(format!("the entry `{key}` does not end with `;`")));
                }
                word = self.token();
            }
            entries.push((key, value));
        }
    }

    /// A count that the file can hold.
    fn count(&mut self) -> Result<usize, MeshError> {
        let count: usize = self.number()?;
        if count > self.bytes.len() {
            return Err(self.error(format!("a count of {count} is more than the file can hold")));
        }
        Ok(count)
    }

    /// `(`, so many bytes, `)`.
    fn block(&mut self, count: usize) -> Result<&'a [u8], MeshError> {
        self.expect("(")?;
        let rest = &self.bytes[self.at..];
        let block = rest.get(..count);
        let block = block.ok_or_else(|| self.error("the file ends inside a list"))?;
        self.at += count;
        self.expect(")")?;
        Ok(block)
    }

    /// A list of whole numbers.
    pub fn labels(&mut self) -> Result<Vec<i64>, MeshError> {
        let count = self.count()?;
        if self.binary {
            if count == 0 {
                return Ok(Vec::new());
            }
            let size = self.label;
            let words = self.block(count * size)?.chunks_exact(size);
            return Ok(words
                .map(|w| match *w {
                    [a, b, c, d] => i32::from_le_bytes([a, b, c, d]).into(),
                    _ => i64::from_le_bytes(std::array::from_fn(|k| w[k])),
                })
                .collect());
        }
        match self.token() {
            "(" => {
                let labels = (0..count)
                    .map(|_| self.number())
                    .collect::<Result<_, _>>()?;
                self.expect(")")?;
                Ok(labels)
            }
            // All the same.
            "{" => {
                let label = self.number()?;
                self.expect("}")?;
                Ok(vec![label; count])
            }
            other => Err(self.error(format!("`{other}` where a list should begin"))),
        }
    }

    /// A list of points \[m\].
    pub fn points(&mut self) -> Result<Vec<[f64; 3]>, MeshError> {
        let count = self.count()?;
        if self.binary {
            let size = self.scalar;
            let words = self.block(3 * count * size)?.chunks_exact(size);
            let numbers: Vec<f64> = words
                .map(|w| match *w {
                    [a, b, c, d] => f32::from_le_bytes([a, b, c, d]).into(),
                    _ => f64::from_le_bytes(std::array::from_fn(|k| w[k])),
                })
                .collect();
            return Ok(numbers
                .chunks_exact(3)
                .map(|x| [x[0], x[1], x[2]])
                .collect());
        }
        self.expect("(")?;
        let mut points = Vec::with_capacity(count);
        for _ in 0..count {
            self.expect("(")?;
            points.push([self.number()?, self.number()?, self.number()?]);
            self.expect(")")?;
        }
        self.expect(")")?;
        Ok(points)
    }

    /// Corners of every face, each of `points` points.
    pub fn faces(&mut self, points: usize) -> Result<Vec<Vec<u32>>, MeshError> {
        let mut faces: Vec<Vec<i64>> = Vec::new();
        if self.binary {
            let (offsets, corners) = (self.labels()?, self.labels()?);
            for pair in offsets.windows(2) {
                let range = usize::try_from(pair[0])
                    .ok()
                    .zip(usize::try_from(pair[1]).ok());
                let face = range.and_then(|(a, b)| corners.get(a..b));
                let face = face.ok_or_else(|| {
                    self.error("the offsets of the faces do not fit their points")
                })?;
                faces.push(face.to_vec());
            }
        } else {
            let count = self.count()?;
            self.expect("(")?;
            for _ in 0..count {
                faces.push(self.labels()?);
            }
            self.expect(")")?;
        }
        let corner = |&p: &i64| {
            let inside = u32::try_from(p).ok().filter(|p| (*p as usize) < points);
            inside
                .ok_or_else(|| self.error(format!("a face has point {p}, but there are {points}")))
        };
        let face = |face: &Vec<i64>| face.iter().map(corner).collect();
        faces.iter().map(face).collect()
    }

    /// The patches; text in binary files too.
    pub fn patches(&mut self) -> Result<Vec<Patch>, MeshError> {
        let count = self.count()?;
        self.expect("(")?;
        let mut patches = Vec::new();
        for _ in 0..count {
            let mut patch = Patch {
                name: self.token().to_owned(),
                ..Patch::default()
            };
            for (key, value) in self.dictionary()? {
                let number = || {
                    let number = value.parse::<usize>();
                    number.map_err(|_| {
                        self.error(format!("{key} = `{value}` of patch `{}`", patch.name))
                    })
                };
                match key {
                    "type" => patch.kind = value.to_owned(),
                    "nFaces" => patch.faces = number()?,
                    "startFace" => patch.start = number()?,
                    "neighbourPatch" => patch.neighbour = Some(value.to_owned()),
                    _ => {}
                }
            }
            patches.push(patch);
        }
        self.expect(")")?;
        Ok(patches)
    }
}
