//! Numbers that change in time: tables, formulas.

use crate::FluidError;
use std::fmt;
use std::sync::Arc;

/// Values at given times, piecewise linear between them.
#[derive(Clone, Debug, PartialEq)]
pub struct TimeTable<const N: usize> {
    times: Vec<f64>,
    values: Vec<[f64; N]>,
    periodic: bool,
}

impl<const N: usize> TimeTable<N> {
    /// From ascending times \[s\] and a value for each. Before the first and after the last time the value stays;
    /// a periodic table repeats, its last entry being the first again.
    ///
    /// # Errors
    /// [`FluidError::Table`] with the entry that does not fit.
    pub fn new(times: Vec<f64>, values: Vec<[f64; N]>, periodic: bool) -> Result<Self, FluidError> {
        let wrong = |entry: usize, problem: &str| FluidError::Table {
            entry,
            problem: problem.into(),
        };
        if times.is_empty() || times.len() != values.len() {
            return Err(wrong(0, "a table needs a value for each of its times"));
        }
        let rows = times.iter().zip(&values);
        for (k, (time, value)) in rows.enumerate() {
            if !(time.is_finite() && value.iter().all(|v| v.is_finite())) {
                return Err(wrong(k, "is not finite"));
            }
            if k > 0 && *time <= times[k - 1] {
                return Err(wrong(k, "is not later than the one before"));
            }
        }
        let last = times.len() - 1;
        if periodic && (last == 0 || values[0] != values[last]) {
            return Err(wrong(
                last,
                "of a periodic table must repeat the first value",
            ));
        }
        Ok(Self {
            times,
            values,
            periodic,
        })
    }

    /// Value at a time \[s\].
    pub fn at(&self, time: f64) -> [f64; N] {
        let (first, last) = (self.times[0], self.times[self.times.len() - 1]);
        let time = if self.periodic {
            first + (time - first).rem_euclid(last - first)
        } else {
            time.clamp(first, last)
        };
        let k = self.times.partition_point(|&t| t <= time);
        if k == 0 {
            return self.values[0];
        }
        if k == self.times.len() {
            return self.values[k - 1];
        }
        let share = (time - self.times[k - 1]) / (self.times[k] - self.times[k - 1]);
        let (low, high) = (self.values[k - 1], self.values[k]);
        std::array::from_fn(|c| low[c] + share * (high[c] - low[c]))
    }
}

/// A number as a function of time.
#[derive(Clone)]
pub enum Signal {
    /// Always the same.
    Constant(f64),
    /// From a table.
    Table(Arc<TimeTable<1>>),
    /// Any function of time \[s\].
    Function(Arc<dyn Fn(f64) -> f64 + Send + Sync>),
}

impl Signal {
    /// Value at a time \[s\].
    pub fn at(&self, time: f64) -> f64 {
        match self {
            Self::Constant(value) => *value,
            Self::Table(table) => table.at(time)[0],
            Self::Function(function) => function(time),
        }
    }

    /// True when it never changes.
    pub fn is_constant(&self) -> bool {
        matches!(self, Self::Constant(_))
    }
}

impl From<f64> for Signal {
    fn from(value: f64) -> Self {
        Self::Constant(value)
    }
}

impl fmt::Debug for Signal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Constant(value) => write!(f, "Constant({value})"),
            Self::Table(table) => table.fmt(f),
            Self::Function(_) => f.write_str("Function"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(times: &[f64], values: &[f64], periodic: bool) -> Result<TimeTable<1>, FluidError> {
        TimeTable::new(
            times.to_vec(),
            values.iter().map(|v| [*v]).collect(),
            periodic,
        )
    }

    #[test]
    fn a_table_is_linear_between_its_times_and_stays_beyond() {
        let ramp = table(&[1.0, 2.0, 4.0], &[0.0, 3.0, 1.0], false).expect("table");
        for (time, value) in [(0.0, 0.0), (1.5, 1.5), (2.0, 3.0), (3.0, 2.0), (9.0, 1.0)] {
            assert_eq!(ramp.at(time), [value], "at {time}");
        }
    }

    #[test]
    fn a_periodic_table_repeats() {
        let saw = table(&[0.0, 1.0, 2.0], &[0.0, 1.0, 0.0], true).expect("table");
        for time in [0.25, 2.25, -1.75, 1.75, 101.75] {
            assert!((saw.at(time)[0] - 0.25).abs() < 1e-12, "at {time}");
        }
    }

    #[test]
    fn tables_that_make_no_sense_are_refused_by_entry() {
        let entry = |result: Result<TimeTable<1>, FluidError>| match result {
            Err(FluidError::Table { entry, .. }) => entry,
            other => panic!("{other:?}"),
        };
        assert_eq!(entry(table(&[], &[], false)), 0);
        assert_eq!(entry(table(&[0.0, 1.0, 1.0], &[0.0; 3], false)), 2);
        assert_eq!(entry(table(&[0.0, f64::NAN], &[0.0; 2], false)), 1);
        assert_eq!(entry(table(&[0.0, 1.0], &[0.0, 1.0], true)), 1);
    }
}
