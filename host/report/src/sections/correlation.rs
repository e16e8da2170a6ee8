//! Correlations of the search distribution, with the caution that they need.

use echoloop_closed_loop::run_folder::run::Background;

use plotters::element::{PathElement, Rectangle};
use plotters::style::Color;
use plotters::style::FontTransform;
use plotters::style::text_anchor::{HPos, VPos};

use super::length;
use crate::ReportError;
use crate::format::{escape, fixed};
use crate::plot::{Canvas, Caption, Drawn, Key, Px, Sample, at, drawing, hint, text};
use crate::theme::ink;

const CELL: f64 = 34.0;

/// Least correlation that is drawn with its number.
const WORTH_A_NUMBER: f64 = 0.15;

/// Least strength of colour of a significant correlation.
const FAINTEST: f64 = 0.2;

/// Correlations of the search distribution, `D^-1/2 C D^-1/2`.
#[derive(Clone, Debug, Default)]
pub struct Correlation {
    /// One name for each row and column.
    pub names: Vec<String>,
    /// Square and symmetric; only the lower triangle is drawn.
    pub matrix: Vec<Vec<f64>>,
    /// Greatest share of the covariance that the run can have replaced,
    /// `1 − (1 − c_1 − c_µ)^generations`, if known.
    pub covariance_learned: Option<f64>,
}

impl Correlation {
    /// The last search of a finished run; `None` where it has no correlations.
    pub fn of_run(background: &Background) -> Option<Self> {
        let short = |name: &String| name.rsplit('.').next().unwrap_or(name).to_owned();
        (!background.correlations.is_empty()).then(|| Self {
            names: background.correlated.iter().map(short).collect(),
            matrix: background.correlations.clone(),
            covariance_learned: Some(background.covariance_learned),
        })
    }

    pub(super) fn check(&self) -> Result<(), ReportError> {
        let names = self.names.len();
        length("correlation matrix", self.matrix.len(), names, "names")?;
        self.matrix
            .iter()
            .try_for_each(|row| length("row of the correlation matrix", row.len(), names, "names"))
    }
}

/// The heat map and its caution; empty without one pair of parameters.
pub(super) fn section(correlation: Option<&Correlation>, generations: usize) -> String {
    let Some(c) = correlation.filter(|c| c.names.len() > 1) else {
        return String::new();
    };
    format!(
        "<section id=\"correlation\"><h2>What moved together</h2><div class=\"heat\">\
         <div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"Heat map\">{}</div>\
         <div><p class=\"caution\"><strong>Read with caution.</strong> \
         {}</p><p>{}</p>{}</div></div></section>\n",
        heat_map(c),
        caution(c, generations),
        strongest(c),
        scale()
    )
}

fn caution(c: &Correlation, generations: usize) -> String {
    let share = match c.covariance_learned.filter(|share| share.is_finite()) {
        Some(share) => {
            format!("this run can have replaced at most {}\u{a0}% of it", fixed(share * 100.0, 0))
        }
        None => "a short run replaces only part of it".to_owned(),
    };
    format!(
        "These are correlations of the distribution the search samples from. It starts as a \
         sphere, and in {generations} generations it has barely learned: {share}. A cell tells \
         where good candidates lay in this one run, not how the parameters influence the error."
    )
}

/// The pair with the largest correlation, in words.
fn strongest(c: &Correlation) -> String {
    let best =
        pairs(c).filter(|(_, _, r)| r.is_finite()).max_by(|a, b| a.2.abs().total_cmp(&b.2.abs()));
    let Some((row, column, r)) = best else {
        return "No correlation is known.".to_owned();
    };
    format!(
        "The strongest is <b>{}</b> with <b>{}</b>, {}.",
        escape(&c.names[column]),
        escape(&c.names[row]),
        fixed(r, 2)
    )
}

/// The lower triangle: row, column, value.
fn pairs(c: &Correlation) -> impl Iterator<Item = (usize, usize, f64)> {
    (1..c.names.len())
        .flat_map(move |row| (0..row).map(move |column| (row, column, c.matrix[row][column])))
}

/// Corner of the triangle and size of the drawing, pixels, with room for every slanted name.
struct Layout {
    left: f64,
    top: f64,
    size: Px,
}

impl Layout {
    fn new(names: &[String]) -> Self {
        let wide = |name: &String| 7.2 * name.chars().count() as f64;
        let count = (names.len() - 1) as f64;
        let left = 12.0 + names.iter().skip(1).map(wide).fold(0.0, f64::max);
        let (mut top, mut right): (f64, f64) = (8.0, left + count * CELL);
        for (column, name) in names.iter().take(names.len() - 1).enumerate() {
            let (rise, along) = (0.71 * wide(name) + 12.0, column as f64 * CELL);
            top = top.max(rise - along);
            right = right.max(left + along + CELL / 2.0 + rise);
        }
        let size = [right, top + count * CELL + 4.0];
        Self { left, top, size }
    }
}

fn heat_map(c: &Correlation) -> String {
    let title = "What moved together in the search: correlations";
    triangle(c, &Caption { name: "correlations", title, keys: &[] }, None)
}

/// Heat map of correlations in which those within chance are greyed.
#[derive(Clone, Debug)]
pub struct Moved {
    /// The correlations.
    pub correlation: Correlation,
    /// Number of sensor parameters, which come first.
    pub of_sensor: usize,
    /// Greatest strength that is greyed.
    pub chance: f64,
}

pub(crate) const MOVED_KEYS: [Key<'static>; 3] = [
    ("plus", Sample::Area, "positive"),
    ("minus", Sample::Area, "negative"),
    ("unlearned", Sample::Area, "not told from chance"),
];

impl Moved {
    pub(crate) fn svg(&self, caption: &Caption<'_>) -> String {
        triangle(&self.correlation, caption, Some(self))
    }

    /// Number of correlations that are not greyed, and of all.
    pub fn learned(&self) -> [usize; 2] {
        let all = pairs(&self.correlation);
        let (mut learned, mut count) = (0, 0);
        for (_, _, r) in all {
            learned += usize::from(self.is_learned(r));
            count += 1;
        }
        [learned, count]
    }

    fn is_learned(&self, r: f64) -> bool {
        r.abs() > self.chance
    }

    /// Lines between the sensor's parameters and registration's.
    fn divide(&self, canvas: &Canvas<'_>, corner: &dyn Fn(usize, usize) -> Px) -> Drawn {
        let (sensor, all) = (self.of_sensor, self.correlation.names.len());
        if sensor == 0 || sensor >= all {
            return Ok(());
        }
        let shifted = |[x, y]: Px| at([x - 1.0, y - 1.0]);
        let across = [corner(0, sensor - 1), corner(sensor, sensor - 1)].map(shifted);
        let down = [corner(sensor, sensor - 1), corner(sensor, all - 1)].map(shifted);
        canvas.draw(&PathElement::new(across, ink("limit")))?;
        canvas.draw(&PathElement::new(down, ink("limit")))
    }
}

/// Heat map of the lower triangle, with names beside and above.
fn triangle(c: &Correlation, caption: &Caption<'_>, moved: Option<&Moved>) -> String {
    let Layout { left, top, size } = Layout::new(&c.names);
    let label = format!("Heat map of the correlations between {} parameters.", c.names.len());
    let corner = |column: usize, row: usize| [left + column as f64 * CELL, top + row as f64 * CELL];
    let svg = drawing(caption, size, &label, |canvas, hints| {
        for (row, column, r) in pairs(c) {
            let [x, y] = corner(column, row - 1);
            let is_learned = moved.is_none_or(|moved| moved.is_learned(r));
            match (is_learned, moved) {
                (true, None) => cell(canvas, [x, y], r, 0.0)?,
                (true, Some(_)) => cell(canvas, [x, y], r, FAINTEST)?,
                (false, _) => grey(canvas, [x, y])?,
            }
            let chance = if is_learned { "" } else { ", not told from chance" };
            let words = format!("{} · {}: {}{chance}", c.names[row], c.names[column], fixed(r, 2));
            *hints += &hint(at([x, y]), at([x + CELL, y + CELL]), &words);
        }
        moved.map_or(Ok(()), |moved| moved.divide(canvas, &corner))?;
        let beside = text("name", HPos::Right, VPos::Center);
        let above = text("name", HPos::Left, VPos::Center).transform(FontTransform::Rotate270);
        for (k, name) in c.names.iter().enumerate() {
            let [x, y] = corner(k, k);
            if k > 0 {
                canvas.draw_text(name, &beside, at([left - 8.0, y - CELL / 2.0]))?;
            }
            if k + 1 < c.names.len() {
                canvas.draw_text(name, &above, at([x + CELL / 2.0, y - 5.0]))?;
            }
        }
        Ok(())
    });
    // plotters turns text by right angles only; at 45° the names are easier to read.
    let style = format!("<svg style=\"width:{}px\" ", size[0].round());
    svg.replacen("<svg ", &style, 1).replace("rotate(270,", "rotate(-45,")
}

fn square([x, y]: Px) -> [(i32, i32); 2] {
    [at([x, y]), at([x + CELL - 2.0, y + CELL - 2.0])]
}

fn grey(canvas: &Canvas<'_>, place: Px) -> Drawn {
    canvas.draw(&Rectangle::new(square(place), ink("unlearned").filled()))
}

/// A cell no fainter than `least`, which keeps it apart from a grey one.
fn cell(canvas: &Canvas<'_>, [x, y]: Px, r: f64, least: f64) -> Drawn {
    let strength = if r.is_finite() { r.abs().clamp(least, 1.0) } else { 0.0 };
    let inner = CELL - 2.0;
    let square = square([x, y]);
    canvas.draw(&Rectangle::new(square, ink("cell").filled()))?;
    let colour =
        ink(if r > 0.0 { "plus" } else { "minus" }).mix((strength * 100.0).round() / 100.0);
    canvas.draw(&Rectangle::new(square, colour.filled()))?;
    if strength < WORTH_A_NUMBER {
        return Ok(());
    }
    let class = if strength > 0.6 { "value strong" } else { "value" };
    canvas.draw_text(
        &short(r),
        &text(class, HPos::Center, VPos::Center),
        at([x + inner / 2.0, y + inner / 2.0]),
    )
}

/// Two decimals without the leading zero, short enough for a cell.
fn short(r: f64) -> String {
    fixed(r, 2).replacen("0.", ".", 1)
}

/// The colour scale from −1 to 1.
fn scale() -> &'static str {
    "<div class=\"scale\" role=\"img\" aria-label=\"Colour scale from minus one to \
     one\"><i></i><span>−1</span>\
     <span>0</span><span>+1</span></div>"
}
