//! Steps, time, and landing exactly on output times.

use crate::case::{Schedule, Time};

/// Where a run is in time.
#[derive(Clone, Debug)]
pub struct Clock {
    /// Steps done.
    pub step: u64,
    /// Simulated time \[s\].
    pub time: f64,
    /// Length of the last step \[s\].
    pub dt: f64,
    end: f64,
    last_step: Option<u64>,
    /// Intervals of simulated time on whose multiples steps land \[s\].
    intervals: Vec<f64>,
}

/// Two times closer than this fraction of a step are one.
const CLOSE: f64 = 1e-6;

impl Clock {
    /// At the start; `steps` limits the number of steps.
    pub fn new(time: &Time, schedules: &[Schedule], steps: Option<u64>) -> Self {
        Self {
            step: 0,
            time: 0.0,
            dt: 0.0,
            end: time.end,
            last_step: steps,
            intervals: schedules.iter().filter_map(|s| s.interval).collect(),
        }
    }

    /// Starts the next step, at most `suggested` \[s\] long, and returns its length; None at the end.
    ///
    /// The step is cut to land on the next output time, or halved when that would leave a sliver.
    pub fn advance(&mut self, suggested: f64) -> Option<f64> {
        if self.at_end() {
            return None;
        }
        let target = self.next_mark(suggested);
        let rest = target - self.time;
        let lands = rest <= suggested * (1.0 + CLOSE);
        self.dt = if lands {
            rest
        } else if rest < 2.0 * suggested * (1.0 - CLOSE) && !self.intervals.is_empty() {
            0.5 * rest
        } else {
            suggested
        };
        self.time = if lands { target } else { self.time + self.dt };
        self.step += 1;
        Some(self.dt)
    }

    /// True when there is nothing left to do.
    pub fn at_end(&self) -> bool {
        self.time >= self.end || self.last_step.is_some_and(|last| self.step >= last)
    }

    /// Simulated time at the end \[s\].
    pub fn end(&self) -> f64 {
        self.end
    }

    /// Fraction of the run that is done, by time or by steps.
    pub fn progress(&self) -> f64 {
        let by_time = self.time / self.end;
        let by_steps = |last: u64| self.step as f64 / last.max(1) as f64;
        self.last_step
            .map_or(by_time, |last| by_steps(last).max(by_time))
    }

    /// Whether something with this schedule is due after the step just done.
    pub fn is_due(&self, schedule: &Schedule) -> bool {
        let by_steps = schedule.every.is_some_and(|n| self.step.is_multiple_of(n));
        let by_time = schedule.interval.is_some_and(|interval| {
            let k = (self.time / interval).round();
            (self.time - k * interval).abs() <= CLOSE * self.dt
        });
        by_steps || by_time
    }

    /// The next time on which a step must land, later than now by more than rounding.
    fn next_mark(&self, suggested: f64) -> f64 {
        let slack = CLOSE * suggested;
        let after = |interval: &f64| (((self.time + slack) / interval).floor() + 1.0) * interval;
        let marks = self.intervals.iter().map(after);
        marks.fold(self.end, f64::min)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn clock(end: f64, interval: Option<f64>, steps: Option<u64>) -> Clock {
        let time = Time {
            end,
            step: Some(0.1),
            cfl: None,
            max_step: None,
        };
        let schedule = Schedule {
            every: None,
            interval,
        };
        Clock::new(&time, &[schedule], steps)
    }

    #[test]
    fn a_constant_step_is_kept_and_ends_on_time() {
        let mut c = clock(1.0, None, None);
        let mut lengths = Vec::new();
        while let Some(dt) = c.advance(0.1) {
            lengths.push(dt);
        }
        assert_eq!((c.step, c.time), (10, 1.0));
        assert!(lengths.iter().all(|dt| (dt - 0.1).abs() < 1e-12));
    }

    #[test]
    fn steps_land_on_every_multiple_without_slivers() {
        let schedule = Schedule {
            every: None,
            interval: Some(0.25),
        };
        let mut c = clock(1.0, Some(0.25), None);
        let mut landed = 0;
        while let Some(dt) = c.advance(0.0613) {
            assert!(dt > 0.03, "sliver of {dt}");
            landed += usize::from(c.is_due(&schedule));
        }
        assert_eq!((landed, c.time), (4, 1.0));
    }

    #[test]
    fn a_limit_of_steps_holds() {
        let mut c = clock(1.0, None, Some(3));
        while c.advance(0.1).is_some() {}
        assert_eq!(c.step, 3);
        assert!((c.progress() - 1.0).abs() < 1e-15);
    }
}
