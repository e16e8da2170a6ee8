//! Importance of the parameters with its uncertainty, and slices of the fitness along them.

use echoloop_closed_loop::evaluation::gain::Estimate;
use echoloop_closed_loop::parameters::{Scale, choices};
use echoloop_closed_loop::run_folder::journal::Generation;
use echoloop_closed_loop::run_folder::run::{AxisRecord, Background, RunResult};

use crate::axis::Axis;
use crate::finished_runs::chosen::explained;
use crate::finished_runs::importance::measured;
use crate::format::{escape, file_name, fixed, with_unit};
use crate::page::notes;
use crate::plot::{Caption, Frame, Key, LEFT, Px, RIGHT, Sample, chart, drawing, legend};

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
#[derive(Clone, Debug)]
pub struct Slice {
    /// The parameter.
    pub axis: AxisRecord,
    /// Its curve.
    pub points: Vec<SlicePoint>,
    /// Candidates: value and ratio, each carried along the surface to the chosen point's other
    /// values: component plus residual (Larsen and McCleary, Technometrics 14, 1972).
    pub dots: Vec<[f64; 2]>,
    /// The chosen value.
    pub chosen: f64,
}

/// A point of a slice.
#[derive(Clone, Debug)]
pub struct SlicePoint {
    /// Value of the parameter.
    pub at: f64,
    /// Fitness over that of the chosen point.
    pub ratio: f64,
    /// Lower and upper end of the ratio's 95 % band.
    pub band: [f64; 2],
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
            Ok(measured) => Self { chosen, ..measured },
        }
    }
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
    let max = ends.filter(|end| end.is_finite()).fold(1e-9, f64::max);
    let across = |value: f64| left + BARS * value.clamp(0.0, max) / max;
    let label = format!("Importance of {} parameters, the most important first.", bars.len());
    let title = "Importance of the parameters, % of the variation";
    let caption = Caption { name: "importance", title, keys: &BAR_KEYS };
    drawing(&caption, size, &label, |canvas| {
        for (line, bar) in bars.iter().enumerate() {
            let y = LINE * line as f64 + 4.0;
            let middle = y + 7.0;
            let Estimate { value: share, interval } = bar.share;
            let ends = interval.map(across);
            let class = if bar.is_shown() { "bar strong-bar" } else { "bar" };
            canvas.block(class, [[left, y], [across(share), y + 14.0]])?;
            canvas.whisker("whisker", ends, middle, 3.0)?;
            canvas.text(&bar.name, "name", LEFT, [left - 8.0, middle])?;
            let right = ends[1].max(across(share)) + 8.0;
            canvas.text(&percent(share), "tick", RIGHT, [right, middle])?;
            let [low, high] = interval.map(|end| fixed(100.0 * end, 1));
            let share = percent(share);
            let words = format!("{}: {share}, 95 % interval {low} to {high}", bar.name);
            canvas.hint([[0.0, y - 4.0], [size[0], y + LINE - 4.0]], &words);
        }
        Ok(())
    })
}

fn percent(value: f64) -> String {
    with_unit(&fixed(100.0 * value, 1), "%")
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
    let AxisRecord { name, scale, .. } = &slice.axis;
    let of = |read: fn(&SlicePoint) -> f64| slice.points.iter().map(read).collect::<Vec<f64>>();
    let (at, ratio) = (of(|point| point.at), of(|point| point.ratio));
    let (dots, heights): (Vec<f64>, Vec<f64>) = slice.dots.iter().map(|&[x, y]| (x, y)).unzip();
    let (low, high) = at
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(*x), high.max(*x)));
    let x = match choices(name) {
        [] => Axis::between(low, high, *scale == Scale::Log),
        _ => Axis::between(low - 0.5, high + 0.5, false).with_ticks(&at),
    };
    let y = Axis::around(ratio.iter().chain(&heights).copied().chain([1.0]));
    let file = format!("slice-{}", file_name(name));
    let title = format!("Slice along {name}");
    let label = &format!("Fitness along {name}, through the chosen point.");
    let y_title = &format!("fitness, chosen = 1{}", if y.is_log() { ", log axis" } else { "" });
    let x_title = &x_title(&slice.axis);
    let caption = Caption { name: &file, title: &title, keys: &SLICE_KEYS };
    let plot = chart(&Frame { caption, size: SLICE, label, y_title, x_title }, x, y, |chart| {
        chart.band("spread", &at, &of(|point| point.band[0]), &of(|point| point.band[1]))?;
        chart.dots("candidate", &dots, &heights, 2.0)?;
        chart.line("mean", &at, &ratio)?;
        chart.upright("limit", slice.chosen)
    });
    let name = escape(name);
    format!("<figure class=\"trace\"><figcaption><b>{name}</b></figcaption>{plot}</figure>")
}

/// Name and unit; for a choice, its values and their names.
fn x_title(AxisRecord { name, unit, scale, .. }: &AxisRecord) -> String {
    let names = choices(name);
    if names.is_empty() {
        let short = name.rsplit('.').next().unwrap_or(name);
        let comma = if unit.is_empty() { "" } else { ", " };
        let log = if *scale == Scale::Log { ", log axis" } else { "" };
        return format!("{short}{comma}{unit}{log}");
    }
    let names = names.iter().enumerate().map(|(i, name)| format!("{i} {name}"));
    names.collect::<Vec<_>>().join(", ")
}

/// Reasons of the choice, the first as a paragraph.
fn chosen(sentences: &[String]) -> String {
    let Some((first, rest)) = sentences.split_first() else { return String::new() };
    let rest = notes(rest.iter().map(|reason| escape(reason)));
    format!("<p class=\"chosen\">{}</p>{rest}", escape(first))
}
