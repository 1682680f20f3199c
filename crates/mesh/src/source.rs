//! Numbers and lines of a mesh file, in text or binary.

use crate::MeshError;
use std::path::Path;

/// A cursor over the bytes of a file; the same calls read text and binary sections.
pub(crate) struct Source<'a> {
    path: &'a str,
    bytes: &'a [u8],
    at: usize,
    /// Numbers are little-endian binary; otherwise text.
    pub binary: bool,
    /// Name of the section being read, for messages.
    pub section: String,
}

impl<'a> Source<'a> {
    pub fn new(path: &'a str, bytes: &'a [u8]) -> Self {
        Self {
            path,
            bytes,
            at: 0,
            binary: false,
            section: String::new(),
        }
    }

    /// An error at the present place.
    pub fn error(&self, reason: impl Into<String>) -> MeshError {
        let place = if self.binary {
            format!("byte {}", self.at)
        } else {
            let lines = self.bytes[..self.at].iter().filter(|&&b| b == b'\n');
            format!("line {}", 1 + lines.count())
        };
        let section = match self.section.as_str() {
            "" => String::new(),
            name => format!("{name}, "),
        };
        MeshError::Read {
            path: self.path.to_owned(),
            place: section + &place,
            reason: reason.into(),
        }
    }

    /// The next word, whatever the mode; None at the end of the file.
    pub fn word(&mut self) -> Option<&'a str> {
        let rest = &self.bytes[self.at..];
        let start = rest.iter().position(|b| !b.is_ascii_whitespace())?;
        let word = &rest[start..];
        let length = word.iter().position(u8::is_ascii_whitespace);
        let word = &word[..length.unwrap_or(word.len())];
        self.at += start + word.len();
        std::str::from_utf8(word).ok()
    }

    /// The rest of the present line, whatever the mode.
    pub fn line(&mut self) -> &'a str {
        let rest = &self.bytes[self.at..];
        let end = rest.iter().position(|&b| b == b'\n').unwrap_or(rest.len());
        self.at += (end + 1).min(rest.len());
        std::str::from_utf8(&rest[..end]).unwrap_or("").trim()
    }

    /// Moves behind the next occurrence of `text`; false when there is none.
    pub fn skip_past(&mut self, text: &str) -> bool {
        let rest = &self.bytes[self.at..];
        let found = rest.windows(text.len()).position(|w| w == text.as_bytes());
        self.at += found.map_or(rest.len(), |n| n + text.len());
        found.is_some()
    }

    /// A number in text, whatever the mode.
    pub fn text<T: std::str::FromStr>(&mut self) -> Result<T, MeshError> {
        let word = self.word();
        let word = word.ok_or_else(|| self.error("the file ends where a number should be"))?;
        word.parse()
            .map_err(|_| self.error(format!("`{word}` is not the number expected here")))
    }

    /// The next bytes.
    pub fn take(&mut self, count: usize) -> Result<&'a [u8], MeshError> {
        let rest = &self.bytes[self.at..];
        let Some((bytes, _)) = rest.split_at_checked(count) else {
            return Err(self.error("the file ends inside an array"));
        };
        self.at += count;
        Ok(bytes)
    }

    /// Whether this word comes next.
    pub fn next_is(&self, word: &str) -> bool {
        let rest = self.bytes[self.at..].trim_ascii_start();
        rest.starts_with(word.as_bytes())
    }

    fn raw<const N: usize>(&mut self) -> Result<[u8; N], MeshError> {
        let rest = &self.bytes[self.at..];
        let Some(bytes) = rest.first_chunk::<N>() else {
            return Err(self.error("the file ends where a number should be"));
        };
        self.at += N;
        Ok(*bytes)
    }

    /// An `int`.
    pub fn int(&mut self) -> Result<i32, MeshError> {
        if self.binary {
            self.raw().map(i32::from_le_bytes)
        } else {
            self.text()
        }
    }

    /// A `size_t` that is a tag.
    pub fn tag(&mut self) -> Result<u64, MeshError> {
        if self.binary {
            self.raw().map(u64::from_le_bytes)
        } else {
            self.text()
        }
    }

    /// A `size_t` that counts things which follow.
    pub fn count(&mut self) -> Result<usize, MeshError> {
        let count = self.tag()?;
        // Each takes two bytes at least; more is a damaged file, not a reason to ask for the memory.
        if count > self.bytes.len() as u64 {
            return Err(self.error(format!("a count of {count} is more than the file can hold")));
        }
        Ok(count as usize)
    }

    /// A `double`.
    pub fn real(&mut self) -> Result<f64, MeshError> {
        if self.binary {
            self.raw().map(f64::from_le_bytes)
        } else {
            self.text()
        }
    }

    /// Three coordinates.
    pub fn point(&mut self) -> Result<[f64; 3], MeshError> {
        Ok([self.real()?, self.real()?, self.real()?])
    }
}

/// All of a file.
///
/// # Errors
/// [`MeshError::Read`] with what the system says.
pub(crate) fn bytes_of(path: &Path) -> Result<Vec<u8>, MeshError> {
    std::fs::read(path).map_err(|error| MeshError::Read {
        path: path.display().to_string(),
        place: "file".into(),
        reason: error.to_string(),
    })
}
