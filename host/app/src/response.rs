//! Flags of the instrument's response, and its output.

use std::path::{Path, PathBuf};

use clap::Args;
use echoloop_parameters::{Bounds, Kind};

use super::exit::Failure;
use super::number::{flag, number_as};
use echoloop_closed_loop::run_folder::files::Output;
use echoloop_files::say;
use echoloop_instruments::response::{LEAST_ECHOES, Later, NoResponse, Response};
use echoloop_instruments::{Noise, POSSIBLE_REPEAT, Rows, read_table};
use echoloop_report::ResponsePage;

/// Flags that read, estimate or write the response.
#[derive(Clone, Debug, Args)]
pub(super) struct ResponseArgs {
    /// The instrument's response, a point a row: time_ns,level or time_ns,level,spread. Without it
    /// the waveforms' own strong echoes tell it.
    #[arg(long, value_name = "FILE", conflicts_with = "no_response")]
    response: Option<PathBuf>,
    /// Strong echoes that must stand alone in the waveforms for them to tell the response; 16 at
    /// least. What fewer have in common may be their targets'.
    #[arg(long, default_value_t = LEAST_ECHOES, value_name = "N",
          value_parser = number_as::<usize>(flag(Kind::Whole, Bounds::at_least(FEWEST as f64))),
          conflicts_with_all = ["no_response", "response"])]
    least_echoes: usize,
    /// Take every top for an echo, whatever the instrument adds after a strong one.
    #[arg(long)]
    no_response: bool,
    /// File of the response, in the format that --response reads (CSV).
    #[arg(long, value_name = "FILE", conflicts_with = "no_response")]
    write_response: Option<PathBuf>,
    /// Page of the response (HTML).
    #[arg(long, value_name = "FILE", conflicts_with = "no_response")]
    plot_response: Option<PathBuf>,
}

/// Fewest echoes of a response: of fewer it lost more than it gained (benches/record/waveforms.md).
const FEWEST: usize = 16;

/// Files to write, checked to be writable.
pub(super) struct Outputs {
    csv: Option<Output>,
    page: Option<Output>,
}

impl ResponseArgs {
    /// Checks that the files can be written, before any work.
    pub(super) fn outputs(&self) -> Result<Outputs, Failure> {
        let at = |path: &Option<PathBuf>| path.as_deref().map(Output::at).transpose();
        Ok(Outputs { csv: at(&self.write_response)?, page: at(&self.plot_response)? })
    }

    /// The given response, or the one estimated from the rows.
    pub(super) fn find(
        &self,
        rows: &Rows,
        outgoing: Option<&Rows>,
        noise: Option<Noise>,
        sample_ns: f64,
        quiet: bool,
    ) -> Result<Option<Response>, Failure> {
        let found = match (&self.response, self.no_response) {
            (_, true) => return Ok(None),
            (Some(path), _) => {
                let points = read_table(path).map_err(Failure::usage)?;
                let given = Response::of_points(path, &points, sample_ns);
                Ok(given.map_err(Failure::usage)?.with_noise(noise))
            }
            (None, _) => Response::of_rows(rows, self.least_echoes, outgoing, noise),
        };
        match found {
            Ok(response) => Ok(Some(response)),
            Err(problem) if self.write_response.is_some() || self.plot_response.is_some() => {
                Err(Failure::usage(problem))
            }
            Err(problem) => {
                if !quiet {
                    say(format_args!("remark: {problem}{}", advice(&problem)));
                }
                Ok(None)
            }
        }
    }
}

/// Advice to a response that is not found.
fn advice(problem: &NoResponse) -> String {
    let fewer = match problem {
        NoResponse::TooFew { found: found @ FEWEST.., .. } => {
            format!(" (--least-echoes {found} makes do with them)")
        }
        _ => String::new(),
    };
    format!("; what it rings may count as echoes{fewer}")
}

impl Outputs {
    /// Writes and draws a response.
    pub(super) fn write(
        &self,
        response: &Response,
        waves: &Path,
        sample_ns: f64,
    ) -> Result<(), Failure> {
        if let Some(output) = &self.csv {
            output.write(response.to_csv(sample_ns).as_bytes())?;
        }
        if let Some(output) = &self.page {
            output.write(page(response, waves, sample_ns).to_html().as_bytes())?;
        }
        Ok(())
    }
}

/// Least level of a later top that is told.
const LEAST_TOLD: f64 = 0.01;

/// What the targets may have made of a response; `None` where nothing.
pub(super) fn doubt_line(response: &Response, sample_ns: f64) -> Option<String> {
    let top = |at: &Later| format!("{:.1} % at {:.1} ns", 100.0 * at.level, at.lag * sample_ns);
    // What is lower is noise as often as not.
    let tops = response.doubtful.iter().filter(|top| top.level >= LEAST_TOLD);
    let tops: Vec<String> = tops.map(top).collect();
    (!tops.is_empty()).then(|| {
        format!(
            "remark: after the strong echoes come {}: the instrument's, or second targets at a \
             steady distance, which nothing here tells. They are echoes, flagged \
             {POSSIBLE_REPEAT}; --outgoing or --response says what the instrument's are",
            tops.join(", ")
        )
    })
}

/// A response as a line of text.
pub(super) fn response_line(response: &Response, sample_ns: f64) -> String {
    let facts = facts(response, sample_ns);
    let texts: Vec<String> = facts.iter().map(|(name, value)| format!("{name} {value}")).collect();
    format!("response: {}", texts.join("; "))
}

fn facts(response: &Response, sample_ns: f64) -> Vec<(String, String)> {
    let later = |at: &Later| format!("{:+.1} % at {:.1} ns", 100.0 * at.level, at.lag * sample_ns);
    let later: Vec<String> = response.later().iter().map(later).collect();
    let from = match response.echoes {
        Some(echoes) => format!("{echoes} echoes"),
        None => "a file".into(),
    };
    let rest = match &response.noise {
        None => "unknown, for too little of the records is at rest".into(),
        Some(noise) => format!("{:.3}", noise.sigma),
    };
    let afterwards = if later.is_empty() { "nothing of 1 %".into() } else { later.join(", ") };
    [
        ("from", from),
        ("width", format!("{:.3} ns", response.width() * sample_ns)),
        ("tail", format!("{:.1} % of its light", 100.0 * response.tail())),
        ("turns after the lobe", afterwards),
        ("noise at rest", rest),
    ]
    .map(|(name, value)| (name.to_owned(), value))
    .into()
}

fn page(response: &Response, waves: &Path, sample_ns: f64) -> ResponsePage {
    let mut page = ResponsePage {
        title: format!("Response of {}", waves.display()),
        facts: facts(response, sample_ns),
        ..ResponsePage::default()
    };
    for (lag, level, spread) in response.points() {
        page.lag_ns.push(lag * sample_ns);
        page.level.push(level);
        page.spread.push(spread);
    }
    page
}
