//! CSV series: one line per observed step.

use std::fs::{File, OpenOptions};
use std::io::{BufWriter, Write};
use std::path::Path;

/// An open CSV file whose first two columns are step and time.
#[derive(Debug)]
pub struct Series {
    file: BufWriter<File>,
    columns: usize,
}

impl Series {
    /// Starts a file, or goes on with one after `resume_step`, dropping later lines.
    ///
    /// # Errors
    /// Any error of the file system.
    pub fn open(path: &Path, columns: &[&str], resume_step: Option<u64>) -> std::io::Result<Self> {
        let header = format!("step,time,{}\n", columns.join(","));
        let mut kept = header.clone();
        if let Some(last) = resume_step {
            let text = std::fs::read_to_string(path).unwrap_or_default();
            let step = |line: &str| line.split(',').next().and_then(|s| s.parse::<u64>().ok());
            // A line that was cut short by a kill is later than any checkpoint, or it is dropped by its length.
            let whole = |line: &&str| line.split(',').count() == columns.len() + 2;
            let lines = text.lines().skip(1).filter(whole);
            for line in lines.filter(|l| step(l).is_some_and(|s| s <= last)) {
                kept.push_str(line);
                kept.push('\n');
            }
        }
        super::replace_file(path, kept.as_bytes())?;
        let file = OpenOptions::new().append(true).open(path)?;
        Ok(Self {
            file: BufWriter::new(file),
            columns: columns.len(),
        })
    }

    /// Adds a line. Numbers are written so that they read back bit by bit.
    ///
    /// # Errors
    /// Any error of the file system.
    pub fn line(&mut self, step: u64, time: f64, values: &[f64]) -> std::io::Result<()> {
        debug_assert_eq!(values.len(), self.columns);
        write!(self.file, "{step},{time:?}")?;
        for value in values {
            write!(self.file, ",{value:?}")?;
        }
        writeln!(self.file)
    }

    /// Hands buffered lines to the system.
    ///
    /// # Errors
    /// Any error of the file system.
    pub fn flush(&mut self) -> std::io::Result<()> {
        self.file.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_resumed_series_drops_later_and_broken_lines() {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("fluid.csv");
        let mut series = Series::open(&path, &["energy"], None).expect("open");
        for step in 0..5u32 {
            series
                .line(u64::from(step), 0.1 * f64::from(step), &[1.0 / 3.0])
                .expect("line");
        }
        series.flush().expect("flush");
        drop(series);
        let mut text = std::fs::read_to_string(&path).expect("read");
        text.push_str("2,0.");
        std::fs::write(&path, text).expect("write");
        drop(Series::open(&path, &["energy"], Some(2)).expect("open"));
        let text = std::fs::read_to_string(&path).expect("read");
        assert_eq!(text.lines().count(), 4, "{text}");
        assert!(text.ends_with("2,0.2,0.3333333333333333\n"), "{text}");
    }
}
