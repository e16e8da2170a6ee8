//! Progress on standard error: a bar on a terminal, a line a generation elsewhere, none when
//! quiet.

use std::io::IsTerminal;
use std::time::Duration;

use echoloop_files::one_line;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use echoloop_closed_loop::run_folder::journal::Generation;
use echoloop_closed_loop::search::Observer;
use echoloop_files::say;
use echoloop_statistics::median;

/// Progress of a command.
pub(super) struct Progress {
    bar: ProgressBar,
    /// True when lines are printed instead of a bar.
    lines: bool,
}

impl Progress {
    pub(super) fn new(quiet: bool) -> Self {
        let terminal = std::io::stderr().is_terminal();
        let target = if terminal && !quiet {
            ProgressDrawTarget::stderr()
        } else {
            ProgressDrawTarget::hidden()
        };
        Self { bar: ProgressBar::with_draw_target(None, target), lines: !terminal && !quiet }
    }

    /// Begins a part of the work.
    pub(super) fn begin(&self, name: &str, steps: u64) {
        self.bar.reset();
        self.bar.set_length(steps);
        let template = "{msg:14} {wide_bar} {percent:>3} %  {elapsed} gone, {eta} to go";
        if let Ok(style) = ProgressStyle::with_template(template) {
            self.bar.set_style(style);
        }
        self.bar.set_message(name.to_owned());
        self.bar.enable_steady_tick(Duration::from_millis(250));
        if self.lines {
            say(format_args!("{name} …"));
        }
    }

    /// Begins tracing; the function it gives takes a fraction of 1 and the present step.
    pub(super) fn scanning(&self) -> impl Fn(f64, &str) + '_ {
        self.begin("scanning", 1000);
        |fraction, step| {
            self.at((fraction * 1000.0) as u64);
            self.bar.set_message(one_line(step));
        }
    }

    /// Steps of the part that are done.
    pub(super) fn at(&self, step: u64) {
        self.bar.set_position(step);
    }

    /// A remark.
    pub(super) fn say(&self, text: &str) {
        if self.lines {
            say(text);
        } else {
            self.bar.println(text);
        }
    }

    /// Ends the part.
    pub(super) fn end(&self) {
        self.bar.finish_and_clear();
    }
}

impl Observer for Progress {
    fn evaluated(&self) {
        self.bar.inc(1);
    }

    fn generation(&self, generation: &Generation, of: u32) {
        self.say(&line(generation, of));
    }

    fn stage(&self, name: &str, registrations: usize) {
        self.begin(name, registrations as u64);
    }
}

fn line(generation: &Generation, of: u32) -> String {
    let fitness = || generation.candidates.iter().map(|c| c.fitness);
    let best = fitness().fold(f64::INFINITY, f64::min);
    // A front has neither a mean nor a step size.
    let sigma = match generation.mean.is_empty() {
        true => String::new(),
        false => format!("  sigma {:.3}", generation.sigma),
    };
    format!(
        "generation {:>2}/{of}  best {best:.4}  median {:.4}{sigma}",
        generation.generation + 1,
        median(fitness()),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_size_is_printed_of_a_generation_that_has_one() {
        let search = Generation {
            generation: 8,
            stage: "joint".into(),
            pairs: vec![0],
            mean: vec![0.5],
            deviations: vec![0.1],
            sigma: 0.1234,
            candidates: Vec::new(),
        };
        let front = Generation { stage: "front".into(), mean: Vec::new(), ..search.clone() };
        assert!(line(&search, 20).starts_with("generation  9/20  best"), "{}", line(&search, 20));
        assert!(line(&search, 20).ends_with("  sigma 0.123"), "{}", line(&search, 20));
        assert!(!line(&front, 20).contains("sigma"), "{}", line(&front, 20));
    }
}
