//! The line that shows how far a run is.

use crate::clock::Clock;
use crate::figures::Figures;
use crate::output::log::Log;

/// Seconds of wall time between lines.
const PAUSE: f64 = 2.0;

/// Shows a line every few seconds.
pub struct Progress {
    first: f64,
    start: f64,
    shown: f64,
    shown_step: u64,
    implicit: Option<(bool, Option<usize>)>,
}

impl Progress {
    /// From where the run starts.
    pub fn new(clock: &Clock) -> Self {
        Self {
            first: clock.progress(),
            start: 0.0,
            shown: f64::NEG_INFINITY,
            shown_step: u64::MAX,
            implicit: None,
        }
    }

    /// The heading.
    pub fn start(&mut self, log: &mut Log) {
        self.start = log.elapsed();
        log.line(&format!(
            "{:>8} {:>11} {:>10} {:>6} {:>10} {:>8} {:>7} {:>8} {:>9}",
            "step", "time [s]", "Δt [s]", "CFL", "divergence", "Poisson", "rounds", "fibres", "ETA"
        ));
    }

    /// A line, if the last one is some time ago; true when it was shown.
    pub fn show(&mut self, clock: &Clock, figures: &Figures, log: &mut Log) -> bool {
        let due = log.elapsed() - self.shown >= PAUSE;
        if due {
            self.line(clock, figures, log);
        }
        due
    }

    /// A note in the log when diffusion is advanced in another way than in the steps before.
    pub fn note_diffusion(&mut self, clock: &Clock, figures: &Figures, log: &mut Log) {
        let implicit = figures.diffusion.map(|c| (c.implicit, c.along));
        if let Some(choice) = figures.diffusion
            && implicit != self.implicit
        {
            log.note(&format!("step {}: {choice}", clock.step));
        }
        self.implicit = implicit;
    }

    /// The line of the last step.
    pub fn last(&mut self, clock: &Clock, figures: &Figures, log: &mut Log) {
        if self.shown_step != clock.step && clock.step > 0 {
            self.line(clock, figures, log);
        }
    }

    fn line(&mut self, clock: &Clock, figures: &Figures, log: &mut Log) {
        let now = log.elapsed();
        (self.shown, self.shown_step) = (now, clock.step);
        let done = clock.progress() - self.first;
        let rest = (now - self.start) * (1.0 - clock.progress()) / done;
        let eta = if rest.is_finite() {
            duration(rest.max(0.0))
        } else {
            "-".to_owned()
        };
        let fluid = |text: String| {
            if figures.has_fluid {
                text
            } else {
                "-".to_owned()
            }
        };
        log.line(&format!(
            "{:>8} {:>11.5e} {:>10.3e} {:>6} {:>10} {:>8} {:>7} {:>8} {:>9}",
            clock.step,
            clock.time,
            clock.dt,
            fluid(format!("{:.3}", figures.cfl)),
            fluid(format!("{:.2e}", figures.divergence)),
            fluid(figures.poisson_iterations.to_string()),
            (figures.rounds).map_or_else(|| "-".to_owned(), |r| r.rounds.to_string()),
            figures.fibres,
            eta,
        ));
    }
}

fn duration(seconds: f64) -> String {
    let whole = seconds.round() as u64;
    let (hours, minutes, rest) = (whole / 3600, whole / 60 % 60, whole % 60);
    if hours > 0 {
        format!("{hours}h{minutes:02}m")
    } else if minutes > 0 {
        format!("{minutes}m{rest:02}s")
    } else {
        format!("{rest}s")
    }
}
