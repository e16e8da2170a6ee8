//! Importance of the parameters with its uncertainty, and slices of the fitness along them.

use echoloop_closed_loop::evaluation::gain::Estimate;
use echoloop_closed_loop::run_folder::journal::Generation;
use echoloop_closed_loop::run_folder::run::{Background, RunResult};

use plotters::element::{PathElement, Rectangle};
use plotters::style::Color;
use plotters::style::text_anchor::{HPos, VPos};

use super::length;
use crate::ReportError;
use crate::axis::Axis;
use crate::finished_runs::chosen::explained;
use crate::finished_runs::importance::{Measured, measured};
use crate::format::{escape, file_name, fixed, with_unit};
use crate::plot::{Caption, Frame, Key, Px, Sample, at, chart, drawing, hint, legend, text};
use crate::theme::ink;

const SLICE: Px = [330.0, 230.0];

/// Width of the longest bar and height of a bar's line, pixels.
const BARS: f64 = 420.0;
const LINE: f64 = 24.0;

const BAR_KEYS: [Key<'static>; 2] =
    [("bar", Sample::Area, "share of the variation"), ("whisker", Sample::Line, "95 % interval")];
const SLICE_KEYS: [Key<'static>; 4] = [
    ("mean", Sample::Line, "response surface"),
    ("spread", Sample::Area, "its 95 % band"),
    ("candidate", Sample::Dot, "candidates"),
    ("limit", Sample::Line, "chosen"),
];

/// Importance of the parameters, as the candidates of the search show it.
#[derive(Clone, Debug, Default)]
pub struct Importance {
    /// The finding, or the reason why there is none.
    pub verdict: String,
    /// The parameters, most important first.
    pub bars: Vec<Bar>,
    /// Fitness along the most important ones.
    pub slices: Vec<Slice>,
    /// Reasons why the chosen point lies outside the last band of the search: a summary, then a
    /// sentence for each parameter.
    pub chosen: Vec<String>,
}

/// Importance of one parameter.
#[derive(Clone, Debug)]
pub struct Bar {
    /// Name of the parameter.
    pub name: String,
    /// Share of the variation, 0 to 1, with its 95 % interval.
    pub share: Estimate,
}

impl Bar {
    /// True when the importance is significant.
    pub(crate) fn is_shown(&self) -> bool {
        self.share.interval[0] > 0.0
    }
}

/// Fitness along a parameter, all others as chosen.
#[derive(Clone, Debug, Default)]
pub struct Slice {
    /// Name of the parameter.
    pub name: String,
    /// Unit; empty when it has none.
    pub unit: String,
    /// True when its axis is logarithmic.
    pub log: bool,
    /// Names of its values, from 0, when it is a choice; else empty.
    pub choices: &'static [&'static str],
    /// Places of the curve, in the unit.
    pub at: Vec<f64>,
    /// Fitness over that of the chosen point, at each place.
    pub ratio: Vec<f64>,
    /// Lower and upper end of the ratio's 95 % band.
    pub band: [Vec<f64>; 2],
    /// Candidates: value and ratio, each carried along the surface to the chosen point's other
    /// values: component plus residual (Larsen and McCleary, Technometrics 14, 1972).
    pub dots: Vec<[f64; 2]>,
    /// The chosen value.
    pub chosen: f64,
}

impl Importance {
    /// The candidates and the choice of a finished run.
    pub(super) fn of_run(
        background: &Background,
        result: &RunResult,
        generations: &[Generation],
    ) -> Self {
        let axes = &background.axes;
        if axes.is_empty() {
            return Self::default();
        }
        let chosen = explained(result, axes, generations);
        match measured(generations, axes, &result.tuned) {
            Err(verdict) => Self { verdict, chosen, ..Self::default() },
            Ok(measured) => Self {
                verdict: verdict(&measured, axes.len() - measured.bars.len()),
                bars: measured.bars,
                slices: measured.slices,
                chosen,
            },
        }
    }
}

impl Slice {
    pub(super) fn check(&self) -> Result<(), ReportError> {
        let series = [("curve", &self.ratio), ("band", &self.band[0]), ("band", &self.band[1])];
        series.iter().try_for_each(|(name, values)| {
            length(&format!("{name} of {}", self.name), values.len(), self.at.len(), "places")
        })
    }
}

/// `left_out` is the number of parameters without a bar.
fn verdict(measured: &Measured, left_out: usize) -> String {
    let Measured { candidates, generations, predicted, .. } = measured;
    let [low, high] = predicted.interval.map(|end| 100.0 * end);
    let left_out = match left_out {
        0 => String::new(),
        1 => " One parameter moved in too few generations to be told.".to_owned(),
        count => format!(" {count} parameters moved in too few generations to be told."),
    };
    format!(
        "A response surface of second order, fitted to all {candidates} candidates within their \
         {generations} generations, predicts {:.0}\u{a0}% (95\u{a0}% interval {low:.0} to \
         {high:.0}) of how ln fitness varies among candidates that it has not seen. Importance is \
         the parameter’s share of that variation: half of what the squared error of those \
         predictions grows by when its values are dealt anew among the candidates of a generation \
         (Breiman 2001; Wei, Lu and Song 2015), with a bootstrap over generations. Blue: more than \
         chance. It holds where the search looked, not for the whole range.{left_out}",
        100.0 * predicted.value
    )
}

/// Importance or the reason why there is none, and the reasons of the choice.
pub(super) fn section(importance: &Importance) -> String {
    if importance.verdict.is_empty() && importance.chosen.is_empty() {
        return String::new();
    }
    let bars = match importance.bars.is_empty() {
        true => String::new(),
        false => format!("<figure>{}{}</figure>", bars(&importance.bars), legend(&BAR_KEYS)),
    };
    format!(
        "<section id=\"importance\"><h2>What mattered</h2><p class=\"lead\">{}</p>{bars}{}{}\
         </section>\n",
        escape(&importance.verdict),
        slices(&importance.slices),
        chosen(&importance.chosen)
    )
}

/// Bars with whiskers, one a parameter, most important first.
fn bars(bars: &[Bar]) -> String {
    let letters = bars.iter().map(|bar| bar.name.chars().count()).max().unwrap_or(0);
    let left = 14.0 + 7.2 * letters as f64;
    let size = [left + BARS + 60.0, LINE * bars.len() as f64 + 6.0];
    let ends = bars.iter().flat_map(|bar| [bar.share.value, bar.share.interval[1]]);
    let most = ends.filter(|end| end.is_finite()).fold(1e-9, f64::max);
    let across = |value: f64| left + BARS * value.clamp(0.0, most) / most;
    let label = format!("Importance of {} parameters, the most important first.", bars.len());
    let title = "Importance of the parameters, % of the variation";
    let caption = Caption { name: "importance", title, keys: &BAR_KEYS };
    drawing(&caption, size, &label, |canvas, hints| {
        for (line, bar) in bars.iter().enumerate() {
            let y = LINE * line as f64 + 4.0;
            let middle = y + 7.0;
            let Estimate { value: share, interval } = bar.share;
            let [low, high] = interval.map(across);
            let class = if bar.is_shown() { "bar strong-bar" } else { "bar" };
            let corners = [at([left, y]), at([across(share), y + 14.0])];
            canvas.draw(&Rectangle::new(corners, ink(class).filled()))?;
            for ends in [
                [[low, middle], [high, middle]],
                [[low, middle - 3.0], [low, middle + 3.0]],
                [[high, middle - 3.0], [high, middle + 3.0]],
            ] {
                canvas.draw(&PathElement::new(ends.map(at), ink("whisker")))?;
            }
            let name = text("name", HPos::Right, VPos::Center);
            canvas.draw_text(&bar.name, &name, at([left - 8.0, middle]))?;
            let value = text("tick", HPos::Left, VPos::Center);
            let end = high.max(across(share)) + 8.0;
            canvas.draw_text(&percent(share), &value, at([end, middle]))?;
            let words = format!("{}: {}", bar.name, share_text(bar));
            *hints += &hint(at([0.0, y - 4.0]), at([size[0], y + LINE - 4.0]), &words);
        }
        Ok(())
    })
}

fn percent(value: f64) -> String {
    with_unit(&fixed(100.0 * value, 1), "%")
}

fn share_text(bar: &Bar) -> String {
    let [low, high] = bar.share.interval.map(|end| fixed(100.0 * end, 1));
    format!("{}, 95 % interval {low} to {high}", percent(bar.share.value))
}

fn slices(slices: &[Slice]) -> String {
    if slices.is_empty() {
        return String::new();
    }
    let plots: String = slices.iter().map(slice).collect();
    format!(
        "<p class=\"lead\">Slices through the chosen point: fitness as a multiple of what it is \
         there, lower is better, along each parameter whose importance is more than chance. \
         Candidates are carried along the surface to the chosen values of all other parameters. \
         Where there are few, the surface is a guess.</p>{}<div class=\"multiples\">{plots}</div>",
        legend(&SLICE_KEYS)
    )
}

fn slice(slice: &Slice) -> String {
    let dots = |i: usize| slice.dots.iter().map(move |dot| dot[i]);
    let xs = slice.at.iter().copied();
    let (low, high) =
        xs.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
    let x = match slice.choices.is_empty() {
        true => Axis::between(low, high, slice.log),
        false => Axis::between(low - 0.5, high + 0.5, false).with_ticks(&slice.at),
    };
    let y = Axis::around(slice.ratio.iter().copied().chain(dots(1)).chain([1.0]));
    let name = format!("slice-{}", file_name(&slice.name));
    let title = format!("Slice along {}", slice.name);
    let label = format!("Fitness along {}, through the chosen point.", slice.name);
    let y_title = format!("fitness, chosen = 1{}", if y.is_log() { ", log axis" } else { "" });
    let x_title = x_title(slice);
    let caption = Caption { name: &name, title: &title, keys: &SLICE_KEYS };
    let frame = Frame { caption, size: SLICE, label: &label, y_title: &y_title, x_title: &x_title };
    let plot = chart(&frame, x, y, |chart| {
        let [low, high] = &slice.band;
        chart.band("spread", &slice.at, low, high)?;
        let (xs, ys): (Vec<f64>, Vec<f64>) = (dots(0).collect(), dots(1).collect());
        chart.dots("candidate", &xs, &ys, 2.0)?;
        chart.line("mean", &slice.at, &slice.ratio)?;
        chart.upright("limit", slice.chosen)
    });
    format!(
        "<figure class=\"trace\"><figcaption><b>{}</b></figcaption>{plot}</figure>",
        escape(&slice.name)
    )
}

/// Name and unit; of a choice its values and their names.
fn x_title(slice: &Slice) -> String {
    let short = slice.name.rsplit('.').next().unwrap_or(&slice.name);
    if slice.choices.is_empty() {
        let unit = if slice.unit.is_empty() { String::new() } else { format!(", {}", slice.unit) };
        return format!("{short}{unit}{}", if slice.log { ", log axis" } else { "" });
    }
    let names = slice.choices.iter().enumerate().map(|(i, name)| format!("{i} {name}"));
    names.collect::<Vec<_>>().join(", ")
}

/// Reasons of the choice, the first as a paragraph.
fn chosen(sentences: &[String]) -> String {
    let Some((first, rest)) = sentences.split_first() else { return String::new() };
    let items: String = rest.iter().map(|text| format!("<li>{}</li>", escape(text))).collect();
    format!("<p class=\"chosen\">{}</p><ul class=\"notes\">{items}</ul>", escape(first))
}
