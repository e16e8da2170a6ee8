//! Parameters by generation, from default to tuned, each in its unit and within its bounds.

use echoloop_closed_loop::parameters::{Scale, Values, effective};
use echoloop_closed_loop::run_folder::journal::Generation;
use echoloop_closed_loop::run_folder::run::AxisRecord;

use super::Report;
use super::convergence::{generation_axis, numbers};
use crate::axis::Axis;
use crate::format::{choice, escape, file_name, significant, with_unit};
use crate::page;
use crate::plot::{Caption, Frame, Key, Px, Sample, chart, legend};

const SIZE: Px = [240.0, 132.0];

const KEYS: [Key<'static>; 4] = [
    ("mean", Sample::Line, "mean of the search"),
    ("spread", Sample::Area, "± one standard deviation"),
    ("default", Sample::Line, "default"),
    ("tuned", Sample::Dot, "tuned"),
];

/// One parameter over the generations, in its unit.
struct Trace<'a> {
    axis: &'a AxisRecord,
    default: f64,
    tuned: f64,
    mean: Vec<f64>,
    /// Mean minus and plus one standard deviation, mapped to the unit after that: the search may be
    /// logarithmic.
    low: Vec<f64>,
    high: Vec<f64>,
}

impl<'a> Trace<'a> {
    fn of(report: &'a Report, number: usize) -> Self {
        let record = &report.background.axes[number];
        let axis = record.axis();
        let at = |offset: f64| -> Vec<f64> {
            let point = |g: &Generation| {
                Some(axis.from_cube(g.mean.get(number)? + offset * g.deviations.get(number)?))
            };
            report.generations.iter().map(|g| point(g).unwrap_or(f64::NAN)).collect()
        };
        let value = |values: &Values| effective(values, &record.name).unwrap_or(f64::NAN);
        Self {
            axis: record,
            default: value(&report.run.result.default),
            tuned: value(&report.run.result.tuned),
            mean: at(0.0),
            low: at(-1.0),
            high: at(1.0),
        }
    }

    /// A value as text; a choice by its name.
    fn text(&self, value: f64) -> String {
        choice(&self.axis.name, value).map_or_else(|| significant(value), str::to_owned)
    }

    fn change(&self) -> String {
        let tuned = with_unit(&self.text(self.tuned), &self.axis.unit);
        format!("{} → {tuned}", self.text(self.default))
    }
}

/// The small multiples and their values as a table; empty without parameters.
pub(super) fn section(report: &Report) -> String {
    let axes = report.background.axes.len();
    if axes == 0 {
        return String::new();
    }
    let xs = numbers(&report.generations);
    let traces: Vec<Trace<'_>> = (0..axes).map(|number| Trace::of(report, number)).collect();
    let plots: String = traces.iter().map(|trace| plot(trace, &xs)).collect();
    format!(
        "<section id=\"parameters\"><h2>Parameters</h2>\
         <p class=\"lead\">Each plot spans the parameter’s bounds, bottom to top. A band that \
         stays wide means the parameter hardly matters to the fitness, or that the search was too \
         short to tell; a value at a bound asks for a wider range.</p>\
         {}<div class=\"multiples\">{plots}</div><details><summary>The same as a table</summary>{}\
         </details></section>\n",
        legend(&KEYS),
        table(&traces)
    )
}

fn plot(trace: &Trace<'_>, xs: &[f64]) -> String {
    let AxisRecord { name, min, max, .. } = trace.axis;
    let is_outside = trace.default < *min || trace.default > *max;
    let is_log = trace.axis.scale == Scale::Log;
    let tags: String = [(is_log, "log"), (is_outside, "default out of bounds")]
        .iter()
        .filter(|(shown, _)| *shown)
        .map(|(_, text)| format!(" <small class=\"tag\">{text}</small>"))
        .collect();
    format!(
        "<figure \
         class=\"trace\"><figcaption><b>{}</b>{tags}<span>{}</span></figcaption>{}</figure>",
        escape(name),
        escape(&trace.change()),
        drawing(trace, xs)
    )
}

fn drawing(trace: &Trace<'_>, xs: &[f64]) -> String {
    let AxisRecord { name, unit, scale, min, max } = trace.axis;
    let bounds = with_unit(&format!("{} to {}", trace.text(*min), trace.text(*max)), unit);
    let label = &format!("{name} by generation, {}, bounds {bounds}", trace.change());
    let comma = if unit.is_empty() { "" } else { ", " };
    let (file, title) = (format!("parameter-{}", file_name(name)), format!("{name}{comma}{unit}"));
    let caption = Caption { name: &file, title: &title, keys: &KEYS };
    let frame = Frame { caption, size: SIZE, label, y_title: "", x_title: "" };
    let y = Axis::between(*min, *max, *scale == Scale::Log).with_ticks(&[*min, *max]);
    let ends: Vec<f64> = xs.first().into_iter().chain(xs.last()).copied().collect();
    chart(&frame, generation_axis(xs).with_ticks(&ends), y, |chart| {
        chart.band("spread", xs, &trace.low, &trace.high)?;
        chart.level("default", trace.default)?;
        chart.line("mean", xs, &trace.mean)?;
        chart.dots("tuned", &[f64::INFINITY], &[trace.tuned], 4.0)
    })
}

fn table(traces: &[Trace<'_>]) -> String {
    let row = |trace: &Trace<'_>| {
        let AxisRecord { name, unit, min, max, .. } = trace.axis;
        let values = [trace.default, trace.tuned, *min, *max].map(|value| trace.text(value));
        let cells = values.iter().chain([unit]);
        page::row(name, cells.map(|cell| format!("<td>{}</td>", escape(cell))))
    };
    let rows: String = traces.iter().map(row).collect();
    let heads = ["parameter", "default", "tuned", "lowest", "highest", "unit"].map(str::to_owned);
    page::table("plain", "Parameter values", heads, &rows)
}
