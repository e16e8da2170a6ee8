//! Parameters by generation, from default to tuned, each in its unit and within its bounds.

use echoloop_closed_loop::parameters::{Scale, Values, choices, effective};
use echoloop_closed_loop::run_folder::journal::Generation;
use echoloop_closed_loop::run_folder::run::{Background, RunResult};

use super::convergence::{generation_axis, generations};
use super::{Report, optional_length};
use crate::ReportError;
use crate::axis::Axis;
use crate::format::{escape, file_name, significant, with_unit};
use crate::plot::{Caption, Frame, Key, Px, Sample, chart, legend};

const SIZE: Px = [240.0, 132.0];

const KEYS: [Key<'static>; 4] = [
    ("mean", Sample::Line, "mean of the search"),
    ("spread", Sample::Area, "± one standard deviation"),
    ("default", Sample::Line, "default"),
    ("tuned", Sample::Dot, "tuned"),
];

/// One parameter over the generations, in real units.
#[derive(Clone, Debug, Default)]
pub struct ParameterTrace {
    /// Name, such as `voxel`.
    pub name: String,
    /// Unit, such as `m`; empty when it has none.
    pub unit: String,
    /// Lower bound.
    pub min: f64,
    /// Upper bound.
    pub max: f64,
    /// True when its axis, of search and plot, is logarithmic.
    pub log: bool,
    /// Names of its values, from 0, when it is a choice; else empty.
    pub choices: &'static [&'static str],
    /// Value before tuning.
    pub default: f64,
    /// Value after tuning.
    pub tuned: f64,
    /// The distribution's mean, one for each of [`Convergence::generation`].
    ///
    /// [`Convergence::generation`]: super::Convergence::generation
    pub mean: Vec<f64>,
    /// Mean minus one standard deviation, mapped to real units after the subtraction (the search
    /// may be logarithmic).
    pub low: Vec<f64>,
    /// Mean plus one standard deviation, likewise.
    pub high: Vec<f64>,
}

impl ParameterTrace {
    /// A trace for each axis of a finished run.
    pub(super) fn of_run(
        background: &Background,
        result: &RunResult,
        generations: &[Generation],
    ) -> Vec<Self> {
        let value = |values: &Values, name: &str| effective(values, name).unwrap_or(f64::NAN);
        let axes = background.axes.iter().enumerate();
        axes.map(|(i, record)| {
            let axis = record.axis();
            let at = |offset: f64| -> Vec<f64> {
                let point = |g: &Generation| Some(g.mean.get(i)? + offset * g.deviations.get(i)?);
                let values = generations.iter().map(|g| point(g).map(|u| axis.from_cube(u)));
                values.map(|value| value.unwrap_or(f64::NAN)).collect()
            };
            Self {
                name: record.name.clone(),
                unit: record.unit.clone(),
                min: axis.min,
                max: axis.max,
                log: axis.scale == Scale::Log,
                choices: choices(&record.name),
                default: value(&result.default, &record.name),
                tuned: value(&result.tuned, &record.name),
                mean: at(0.0),
                low: at(-1.0),
                high: at(1.0),
            }
        })
        .collect()
    }

    pub(super) fn check(&self, generations: usize) -> Result<(), ReportError> {
        [("mean", &self.mean), ("low", &self.low), ("high", &self.high)].iter().try_for_each(
            |(name, values)| {
                let series = format!("{name} of {}", self.name);
                optional_length(&series, values.len(), generations, "generations")
            },
        )
    }
}

/// The small multiples and their values as a table; empty without parameters.
pub(super) fn section(report: &Report) -> String {
    if report.parameters.is_empty() {
        return String::new();
    }
    let xs = generations(&report.convergence);
    let plots: String = report.parameters.iter().map(|p| plot(p, &xs)).collect();
    format!(
        "<section id=\"parameters\"><h2>Parameters</h2>\
         <p class=\"lead\">Each plot spans the parameter’s bounds, bottom to top. A band that \
         stays wide means the parameter hardly matters to the fitness, or that the search was too \
         short to tell; a value at a bound asks for a wider range.</p>\
         {}<div class=\"multiples\">{plots}</div>{}</section>\n",
        legend(&KEYS),
        table(&report.parameters)
    )
}

fn plot(p: &ParameterTrace, xs: &[f64]) -> String {
    let is_outside = p.default < p.min || p.default > p.max;
    let tags: String = [(p.log, "log"), (is_outside, "default out of bounds")]
        .iter()
        .filter(|(shown, _)| *shown)
        .map(|(_, text)| format!(" <small class=\"tag\">{text}</small>"))
        .collect();
    format!(
        "<figure \
         class=\"trace\"><figcaption><b>{}</b>{tags}<span>{}</span></figcaption>{}</figure>",
        escape(&p.name),
        escape(&change(p)),
        drawing(p, xs)
    )
}

fn change(p: &ParameterTrace) -> String {
    let tuned = with_unit(&value(p, p.tuned), &p.unit);
    format!("{} → {tuned}", value(p, p.default))
}

/// A value as text; a choice by its name.
fn value(p: &ParameterTrace, value: f64) -> String {
    let choice = p.choices.get(value as usize).filter(|_| value.is_finite());
    choice.map_or_else(|| significant(value), |&choice| choice.to_owned())
}

fn drawing(p: &ParameterTrace, xs: &[f64]) -> String {
    let label = format!("{} by generation, {}, bounds {}", p.name, change(p), bounds(p));
    let name = format!("parameter-{}", file_name(&p.name));
    let title = match p.unit.as_str() {
        "" => p.name.clone(),
        unit => format!("{}, {unit}", p.name),
    };
    let caption = Caption { name: &name, title: &title, keys: &KEYS };
    let frame = Frame { caption, size: SIZE, label: &label, y_title: "", x_title: "" };
    let y = Axis::between(p.min, p.max, p.log).with_ticks(&[p.min, p.max]);
    let ends: Vec<f64> = xs.first().into_iter().chain(xs.last()).copied().collect();
    chart(&frame, generation_axis(xs).with_ticks(&ends), y, |chart| {
        chart.band("spread", xs, &p.low, &p.high)?;
        chart.level("default", p.default)?;
        chart.line("mean", xs, &p.mean)?;
        chart.dots("tuned", &[f64::INFINITY], &[p.tuned], 4.0)
    })
}

fn bounds(p: &ParameterTrace) -> String {
    with_unit(&format!("{} to {}", value(p, p.min), value(p, p.max)), &p.unit)
}

fn table(parameters: &[ParameterTrace]) -> String {
    let rows: String = parameters
        .iter()
        .map(|p| {
            format!(
                "<tr><th \
                 scope=\"row\">{}</th><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>",
                escape(&p.name),
                escape(&value(p, p.default)),
                escape(&value(p, p.tuned)),
                escape(&value(p, p.min)),
                escape(&value(p, p.max)),
                escape(&p.unit),
            )
        })
        .collect();
    format!(
        "<details><summary>The same as a table</summary><div class=\"scroll\" tabindex=\"0\" \
         role=\"region\" \
         aria-label=\"Parameter values\"><table class=\"plain\"><thead><tr><th \
         scope=\"col\">parameter</th>\
         <th scope=\"col\">default</th><th scope=\"col\">tuned</th><th scope=\"col\">lowest</th>\
         <th scope=\"col\">highest</th><th \
         scope=\"col\">unit</th></tr></thead><tbody>{rows}</tbody></table></div>\
         </details>"
    )
}
