//! What members gave: `members.csv`, one line a run, and `results.csv`, one line a combination.

use super::file::Sweep;
use super::member::Outcome;
use super::steady;
use crate::error::ProgramError;
use crate::output::replace_file;
use std::fmt::Write;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

/// What one member gave.
#[derive(Clone, Debug)]
pub struct Row {
    /// How it ended.
    pub outcome: Outcome,
    /// Time from which on lines count \[s\].
    start: f64,
    /// Mean of each column and its standard error by blocks.
    means: Vec<[f64; 2]>,
}

/// All rows so far.
pub struct Table<'a> {
    sweep: &'a Sweep,
    folder: PathBuf,
    rows: Vec<Option<Row>>,
}

impl Row {
    /// Reads the series of a member that is done.
    ///
    /// # Errors
    /// Columns that the series does not have.
    pub fn of(sweep: &Sweep, outcome: Outcome, folder: &Path) -> Result<Self, ProgramError> {
        let results = &sweep.results;
        let mut row = Self {
            outcome,
            start: f64::NAN,
            means: vec![[f64::NAN; 2]; results.columns.len()],
        };
        if row.outcome != Outcome::Done {
            return Ok(row);
        }
        row.start = results.from;
        let end = results.to.unwrap_or(f64::INFINITY);
        if let Some(column) = &results.steady {
            let span = row.start..=end;
            let (times, values) = read(folder, "results.steady", column, &span)?;
            if let Some(time) = times.get(steady::start(&values)) {
                row.start = *time;
            }
        }
        for (k, column) in results.columns.iter().enumerate() {
            let key = format!("results.columns[{k}]");
            let (_, values) = read(folder, &key, column, &(row.start..=end))?;
            row.means[k] = steady::block_mean(&values);
        }
        Ok(row)
    }
}

impl<'a> Table<'a> {
    /// Without rows.
    pub fn new(sweep: &'a Sweep, folder: &Path) -> Self {
        Self {
            sweep,
            folder: folder.to_owned(),
            rows: vec![None; sweep.members.len()],
        }
    }

    /// Puts the row of a member in.
    pub fn put(&mut self, member: usize, row: Row) {
        self.rows[member] = Some(row);
    }

    /// Members that failed, and that are not at their end.
    pub fn counts(&self) -> [usize; 2] {
        let count = |wanted: &dyn Fn(&Outcome) -> bool| {
            let rows = self.rows.iter().flatten();
            rows.filter(|row| wanted(&row.outcome)).count()
        };
        [
            count(&|o| matches!(o, Outcome::Failed(_))),
            count(&|o| *o == Outcome::Unfinished),
        ]
    }

    /// Writes both files with the rows so far.
    ///
    /// # Errors
    /// Files that cannot be written.
    pub fn write(&self) -> Result<(), ProgramError> {
        for (name, text) in [
            ("members.csv", self.members()),
            ("results.csv", self.results()),
        ] {
            let path = self.folder.join(name);
            replace_file(&path, text.as_bytes()).map_err(|e| ProgramError::output(&path, &e))?;
        }
        Ok(())
    }

    fn header(&self, own: &[&str], last: &[&str]) -> String {
        let names = self.sweep.names.iter().map(|n| quoted(n));
        let columns = self.sweep.results.columns.iter();
        let columns = columns.flat_map(|c| [c.clone(), format!("{c}_error")]);
        let own = own.iter().map(|s| (*s).to_owned());
        let last = last.iter().map(|s| (*s).to_owned());
        let all: Vec<String> = names.chain(own).chain(columns).chain(last).collect();
        all.join(",") + "\n"
    }

    fn labels(&self, point: usize) -> String {
        let labels = self.sweep.points[point].iter();
        labels.map(|label| quoted(label) + ",").collect()
    }

    fn members(&self) -> String {
        let mut text = self.header(&["seed", "state", "from"], &["error"]);
        for (member, row) in self.sweep.members.iter().zip(&self.rows) {
            let Some(row) = row else { continue };
            let (state, why) = match &row.outcome {
                Outcome::Done => ("done", ""),
                Outcome::Failed(why) => ("failed", why.as_str()),
                Outcome::Unfinished => ("unfinished", ""),
            };
            let seed = member.seed.map_or(String::new(), |seed| seed.to_string());
            text += &self.labels(member.point);
            // A string takes all that is written.
            let _ = write!(text, "{seed},{state},{}", number(row.start));
            for value in row.means.as_flattened() {
                let _ = write!(text, ",{}", number(*value));
            }
            let line = why.lines().next().unwrap_or("");
            let _ = writeln!(text, ",{}", quoted(line));
        }
        text
    }

    /// Means over replicates and their standard errors; of a single run that of its blocks.
    fn results(&self) -> String {
        let mut text = self.header(&["runs"], &[]);
        for point in 0..self.sweep.points.len() {
            let members = self.sweep.members.iter().zip(&self.rows);
            let rows: Vec<&Row> = members
                .filter(|(member, _)| member.point == point)
                .filter_map(|(_, row)| row.as_ref())
                .filter(|row| row.outcome == Outcome::Done)
                .collect();
            text += &self.labels(point);
            let _ = write!(text, "{}", rows.len());
            for k in 0..self.sweep.results.columns.len() {
                let values: Vec<f64> = rows.iter().map(|row| row.means[k][0]).collect();
                let error = match &rows[..] {
                    [one] => one.means[k][1],
                    _ => steady::standard_error(&values),
                };
                let mean = number(steady::mean(&values));
                let _ = write!(text, ",{mean},{}", number(error));
            }
            text.push('\n');
        }
        text
    }
}

/// Times and values of a column FILE.COLUMN within a span of time.
fn read(
    folder: &Path,
    key: &str,
    column: &str,
    span: &RangeInclusive<f64>,
) -> Result<(Vec<f64>, Vec<f64>), ProgramError> {
    let (file, name) = column.split_once('.').unwrap_or((column, ""));
    let path = folder.join("series").join(format!("{file}.csv"));
    let bad = |what: String| ProgramError::input(format!("`{key} = {column:?}`: {what}"));
    let text = std::fs::read_to_string(&path)
        .map_err(|e| bad(format!("{} cannot be read: {e}", path.display())))?;
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().unwrap_or("").split(',').collect();
    let Some(at) = names.iter().position(|n| *n == name) else {
        let all = names.get(2..).unwrap_or(&[]).join(", ");
        return Err(bad(format!(
            "{} has no such column; it has {all}",
            path.display()
        )));
    };
    let entry = |line: &str, k: usize| line.split(',').nth(k).and_then(|x| x.parse::<f64>().ok());
    let pairs = lines.filter_map(|line| Some((entry(line, 1)?, entry(line, at)?)));
    Ok(pairs.filter(|(time, _)| span.contains(time)).unzip())
}

/// Empty for what is not a number.
fn number(x: f64) -> String {
    if x.is_nan() {
        String::new()
    } else {
        format!("{x:?}")
    }
}

/// A field of a CSV file.
fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}
