//! Correlations of the search distribution, with the caution that they need.

use echoloop_closed_loop::run_folder::run::Background;
use plotters::element::Rectangle;
use plotters::style::{Color, FontTransform};

use super::Report;
use crate::format::{escape, fixed};
use crate::plot::{
    Canvas, Caption, Drawn, Key, LEFT, MIDDLE, Px, RIGHT, Sample, at, drawing, style,
};
use crate::theme::ink;

const CELL: f64 = 34.0;

/// Least correlation that is drawn with its number.
const MIN_NUMBERED: f64 = 0.15;

/// Least strength of colour of a significant correlation.
const MIN_STRENGTH: f64 = 0.2;

/// Refuses correlations that are not square, one row and column for each name.
pub(super) fn check(background: &Background) -> Result<(), String> {
    let (names, rows) = (background.correlated.len(), &background.correlations);
    let check = |what: &str, found: usize| match found == names {
        true => Ok(()),
        false => Err(format!("{what} holds {found} values, not one for each of {names} names")),
    };
    if rows.is_empty() {
        return Ok(());
    }
    check("correlation matrix", rows.len())?;
    rows.iter().try_for_each(|row| check("row of the correlation matrix", row.len()))
}

/// The heat map and its caution; empty without one pair of parameters.
pub(super) fn section(report: &Report) -> String {
    let Background { correlated, correlations, covariance_learned, .. } = &report.background;
    if correlated.len() < 2 || correlations.is_empty() {
        return String::new();
    }
    let names = short_names(correlated);
    let title = "What moved together in the search: correlations";
    let caption = Caption { name: "correlations", title, keys: &[] };
    format!(
        "<section id=\"correlation\"><h2>What moved together</h2><div class=\"heat\">\
         <div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"Heat map\">{}</div>\
         <div><p class=\"caution\"><strong>Read with caution.</strong> \
         {}</p><p>{}</p>{SCALE}</div></div></section>\n",
        triangle(&names, correlations, &caption, None),
        caution(*covariance_learned, report.generations.len()),
        strongest(&names, correlations)
    )
}

/// The colour scale from −1 to 1.
const SCALE: &str = "<div class=\"scale\" role=\"img\" aria-label=\"Colour scale from minus one to \
     one\"><i></i><span>−1</span>\
     <span>0</span><span>+1</span></div>";

/// Keys without their sections.
fn short_names(names: &[String]) -> Vec<&str> {
    names.iter().map(|name| name.rsplit('.').next().unwrap_or(name)).collect()
}

/// `learned`: greatest share of the covariance that the run can have replaced,
/// `1 − (1 − c_1 − c_µ)^generations`.
fn caution(learned: f64, generations: usize) -> String {
    let share = match learned.is_finite() {
        true => {
            format!("this run can have replaced at most {}\u{a0}% of it", fixed(learned * 100.0, 0))
        }
        false => "a short run replaces only part of it".to_owned(),
    };
    format!(
        "These are correlations of the distribution the search samples from. It starts as a \
         sphere, and in {generations} generations it has barely learned: {share}. A cell tells \
         where good candidates lay in this one run, not how the parameters influence the error."
    )
}

/// The pair with the largest correlation, in words.
fn strongest(names: &[&str], matrix: &[Vec<f64>]) -> String {
    let known = pairs(matrix).filter(|(_, _, r)| r.is_finite());
    let Some((row, column, r)) = known.max_by(|a, b| a.2.abs().total_cmp(&b.2.abs())) else {
        return "No correlation is known.".to_owned();
    };
    format!(
        "The strongest is <b>{}</b> with <b>{}</b>, {}.",
        escape(names[column]),
        escape(names[row]),
        fixed(r, 2)
    )
}

/// The lower triangle: row, column, value.
fn pairs(matrix: &[Vec<f64>]) -> impl Iterator<Item = (usize, usize, f64)> {
    (1..matrix.len())
        .flat_map(move |row| (0..row).map(move |column| (row, column, matrix[row][column])))
}

/// Corner of the triangle and size of the drawing, pixels, with room for every slanted name.
struct Layout {
    left: f64,
    top: f64,
    size: Px,
}

impl Layout {
    fn new(names: &[&str]) -> Self {
        let wide = |name: &&str| 7.2 * name.chars().count() as f64;
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

/// Heat map of correlations of a search, `D^-1/2 C D^-1/2`; those within chance are greyed.
#[derive(Clone, Debug)]
pub struct Moved {
    /// A name for each row and column.
    pub names: Vec<String>,
    /// Square and symmetric; only the lower triangle is drawn.
    pub matrix: Vec<Vec<f64>>,
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
        triangle(&short_names(&self.names), &self.matrix, caption, Some(self))
    }

    /// Number of significant correlations, and of all.
    pub fn learned(&self) -> [usize; 2] {
        let learned = pairs(&self.matrix).filter(|(_, _, r)| self.is_learned(*r));
        [learned.count(), pairs(&self.matrix).count()]
    }

    fn is_learned(&self, r: f64) -> bool {
        r.abs() > self.chance
    }

    /// Draws lines between the sensor's parameters and registration's.
    fn divide(&self, canvas: &Canvas<'_>, corner: &dyn Fn(usize, usize) -> Px) -> Drawn {
        let (sensor, all) = (self.of_sensor, self.names.len());
        if sensor == 0 || sensor >= all {
            return Ok(());
        }
        let shifted = |[x, y]: Px| [x - 1.0, y - 1.0];
        let middle = corner(sensor, sensor - 1);
        canvas.line("limit", [corner(0, sensor - 1), middle].map(shifted))?;
        canvas.line("limit", [middle, corner(sensor, all - 1)].map(shifted))
    }
}

/// Heat map of the lower triangle, with names beside and above.
fn triangle(
    names: &[&str],
    matrix: &[Vec<f64>],
    caption: &Caption<'_>,
    moved: Option<&Moved>,
) -> String {
    let Layout { left, top, size } = Layout::new(names);
    let label = format!("Heat map of the correlations between {} parameters.", names.len());
    let corner = |column: usize, row: usize| [left + column as f64 * CELL, top + row as f64 * CELL];
    let least = if moved.is_some() { MIN_STRENGTH } else { 0.0 };
    let svg = drawing(caption, size, &label, |canvas| {
        for (row, column, r) in pairs(matrix) {
            let [x, y] = corner(column, row - 1);
            let is_learned = moved.is_none_or(|moved| moved.is_learned(r));
            match is_learned {
                true => cell(canvas, [x, y], r, least)?,
                false => canvas.block("unlearned", square([x, y]))?,
            }
            let chance = if is_learned { "" } else { ", not told from chance" };
            let words = format!("{} · {}: {}{chance}", names[row], names[column], fixed(r, 2));
            canvas.hint([[x, y], [x + CELL, y + CELL]], &words);
        }
        moved.map_or(Ok(()), |moved| moved.divide(canvas, &corner))?;
        let above = style("name", RIGHT).transform(FontTransform::Rotate270);
        for (k, name) in names.iter().enumerate() {
            let [x, y] = corner(k, k);
            if k > 0 {
                canvas.text(name, "name", LEFT, [left - 8.0, y - CELL / 2.0])?;
            }
            if k + 1 < names.len() {
                canvas.area.draw_text(name, &above, at([x + CELL / 2.0, y - 5.0]))?;
            }
        }
        Ok(())
    });
    // plotters turns text by right angles only; at 45° the names are easier to read.
    let style = format!("<svg style=\"width:{}px\" ", size[0].round());
    svg.replacen("<svg ", &style, 1).replace("rotate(270,", "rotate(-45,")
}

fn square([x, y]: Px) -> [Px; 2] {
    [[x, y], [x + CELL - 2.0, y + CELL - 2.0]]
}

/// Draws a cell no fainter than `least`, so that it differs from a grey one.
fn cell(canvas: &Canvas<'_>, [x, y]: Px, r: f64, least: f64) -> Drawn {
    let strength = if r.is_finite() { r.abs().clamp(least, 1.0) } else { 0.0 };
    canvas.block("cell", square([x, y]))?;
    let colour =
        ink(if r > 0.0 { "plus" } else { "minus" }).mix((strength * 100.0).round() / 100.0);
    canvas.area.draw(&Rectangle::new(square([x, y]).map(at), colour.filled()))?;
    if strength < MIN_NUMBERED {
        return Ok(());
    }
    let class = if strength > 0.6 { "value strong" } else { "value" };
    // Without the leading zero it is short enough for a cell.
    let number = fixed(r, 2).replacen("0.", ".", 1);
    canvas.text(&number, class, MIDDLE, [x, y].map(|side| side + (CELL - 2.0) / 2.0))
}
