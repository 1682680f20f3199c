//! Numbers of VTK files: types, base64, compressed blocks.

use flate2::read::ZlibDecoder;
use std::io::Read;

/// Type of the numbers of an array.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Kind {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl Kind {
    /// By its name in XML or legacy files (of which `long` has 8 bytes, and `vtkIdType` 4).
    pub fn named(name: &str) -> Option<Self> {
        Some(match name {
            "Int8" | "char" | "signed_char" | "vtktypeint8" => Self::I8,
            "UInt8" | "unsigned_char" | "vtktypeuint8" => Self::U8,
            "Int16" | "short" | "vtktypeint16" => Self::I16,
            "UInt16" | "unsigned_short" | "vtktypeuint16" => Self::U16,
            "Int32" | "int" | "vtktypeint32" | "vtkidtype" => Self::I32,
            "UInt32" | "unsigned_int" | "vtktypeuint32" => Self::U32,
            "Int64" | "long" | "vtktypeint64" => Self::I64,
            "UInt64" | "unsigned_long" | "vtktypeuint64" => Self::U64,
            "Float32" | "float" => Self::F32,
            "Float64" | "double" => Self::F64,
            _ => return None,
        })
    }

    /// Bytes of a number.
    pub fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }

    /// All numbers, big-endian or little.
    pub fn numbers(self, bytes: &[u8], big: bool) -> Vec<f64> {
        let ordered = |bytes: &[u8]| {
            let mut word = [0u8; 8];
            word[..bytes.len()].copy_from_slice(bytes);
            if big {
                word[..bytes.len()].reverse();
            }
            u64::from_le_bytes(word)
        };
        let words = bytes.chunks_exact(self.size()).map(ordered);
        match self {
            Self::I8 => words.map(|w| f64::from(w as i8)).collect(),
            Self::I16 => words.map(|w| f64::from(w as i16)).collect(),
            Self::I32 => words.map(|w| f64::from(w as i32)).collect(),
            Self::I64 => words.map(|w| w as i64 as f64).collect(),
            Self::U8 | Self::U16 | Self::U32 | Self::U64 => words.map(|w| w as f64).collect(),
            Self::F32 => words.map(|w| f64::from(f32::from_bits(w as u32))).collect(),
            Self::F64 => words.map(f64::from_bits).collect(),
        }
    }
}

/// How binary arrays of an XML file are stored.
#[derive(Clone, Copy, Debug)]
pub(super) struct Storage {
    pub big: bool,
    /// Type of the numbers in headers.
    pub header: Kind,
    pub compressed: bool,
}

/// Bytes that follow each other, as they are or in base64.
pub(super) struct Stream<'a> {
    pub bytes: &'a [u8],
    pub base64: bool,
}

impl Storage {
    /// The array at the beginning of a stream.
    pub fn array(self, mut stream: Stream<'_>, kind: Kind) -> Result<Vec<f64>, String> {
        let bytes = if self.compressed {
            self.blocks(&mut stream)?
        } else {
            // Length and numbers are one piece of base64.
            let length = self.words(&stream.peek(self.header.size())?)[0];
            let both = stream.take(length.saturating_add(self.header.size()))?;
            both[self.header.size()..].to_vec()
        };
        Ok(kind.numbers(&bytes, self.big))
    }

    fn words(self, bytes: &[u8]) -> Vec<usize> {
        let numbers = self.header.numbers(bytes, self.big);
        numbers.into_iter().map(|n| n as usize).collect()
    }

    /// Count, size, size of the last (0: full), compressed sizes; then all blocks as one piece.
    fn blocks(self, stream: &mut Stream<'_>) -> Result<Vec<u8>, String> {
        let word = self.header.size();
        let count = self.words(&stream.peek(word)?)[0];
        let header = stream.take(count.saturating_add(3).saturating_mul(word))?;
        let header = self.words(&header);
        let total = header[3..].iter().fold(0usize, |a, &b| a.saturating_add(b));
        let packed = stream.take(total)?;
        let mut rest = &packed[..];
        let mut bytes = Vec::new();
        for (k, &size) in header[3..].iter().enumerate() {
            let full = if k + 1 == count && header[2] > 0 {
                header[2]
            } else {
                header[1]
            };
            let (block, others) = rest.split_at(size);
            let before = bytes.len();
            let mut decoder = ZlibDecoder::new(block).take(full as u64);
            decoder
                .read_to_end(&mut bytes)
                .map_err(|e| format!("block {k} is damaged: {e}"))?;
            if bytes.len() - before != full {
                return Err(format!("block {k} is not of the size that its header says"));
            }
            rest = others;
        }
        Ok(bytes)
    }
}

const SHORT: &str = "the file ends before the array does";

impl Stream<'_> {
    /// The next bytes, which stay.
    fn peek(&self, count: usize) -> Result<Vec<u8>, String> {
        let length = self.length(count);
        let found = self.bytes.get(..length).ok_or(SHORT)?;
        if !self.base64 {
            return Ok(found.to_vec());
        }
        let mut decoded = decode(found)?;
        if decoded.len() < count {
            return Err(SHORT.into());
        }
        decoded.truncate(count);
        Ok(decoded)
    }

    fn take(&mut self, count: usize) -> Result<Vec<u8>, String> {
        let taken = self.peek(count)?;
        self.bytes = &self.bytes[self.length(count)..];
        Ok(taken)
    }

    /// Of so many bytes in the file.
    fn length(&self, count: usize) -> usize {
        if self.base64 {
            count.div_ceil(3).saturating_mul(4)
        } else {
            count
        }
    }
}

/// Base64 (RFC 4648) of whole groups of four.
fn decode(text: &[u8]) -> Result<Vec<u8>, String> {
    let digit = |c: u8| match c {
        b'A'..=b'Z' => Some(c - b'A'),
        b'a'..=b'z' => Some(c - b'a' + 26),
        b'0'..=b'9' => Some(c - b'0' + 52),
        b'+' => Some(62),
        b'/' => Some(63),
        _ => None,
    };
    let mut bytes = Vec::with_capacity(text.len() / 4 * 3);
    for group in text.chunks_exact(4) {
        let padding = group.iter().rev().take_while(|c| **c == b'=').count();
        let mut word = 0u32;
        for &c in &group[..4 - padding] {
            let digit = digit(c).ok_or_else(|| format!("`{}` is no base64", char::from(c)))?;
            word = word << 6 | u32::from(digit);
        }
        word <<= 6 * padding;
        bytes.extend_from_slice(&word.to_be_bytes()[1..4 - padding.min(2)]);
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_of_any_length() {
        for (text, bytes) in [
            ("TWFu", "Man"),
            ("TWE=", "Ma"),
            ("TQ==", "M"),
            ("+/8A", "\u{0}"),
        ] {
            let decoded = decode(text.as_bytes()).expect("base64");
            if text.starts_with('T') {
                assert_eq!(decoded, bytes.as_bytes());
            } else {
                assert_eq!(decoded, [0xfb, 0xff, 0x00]);
            }
        }
        assert!(decode(b"TW!u").is_err());
    }

    #[test]
    fn numbers_of_either_order() {
        assert_eq!(Kind::I16.numbers(&[0xff, 0xfe], true), [-2.0]);
        assert_eq!(Kind::I16.numbers(&[0xfe, 0xff], false), [-2.0]);
        assert_eq!(Kind::F64.numbers(&1.5f64.to_be_bytes(), true), [1.5]);
        assert_eq!(Kind::F32.numbers(&1.5f32.to_le_bytes(), false), [1.5]);
    }
}
