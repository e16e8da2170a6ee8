//! Several panels as one drawing that stands alone.

use super::figure::{Figure, RULES, attribute, png};
use super::format::escape;
use super::plot::{FINE, Key, own_legend, own_text};

/// Panels to compose, with the texts around them.
pub(super) struct Sheet<'a> {
    pub(super) name: &'a str,
    pub(super) title: &'a str,
    /// Text for a screen reader.
    pub(super) label: &'a str,
    pub(super) columns: usize,
    pub(super) keys: &'a [Key<'a>],
    /// The panels: named charts as SVG.
    pub(super) panels: &'a [String],
}

/// Room beside the panels, and above them, pixels.
const EDGE: f64 = 10.0;
const HEAD: f64 = 30.0;

/// Greatest mean width of a title's letters, pixels.
const TITLE_LETTER: f64 = 7.8;

/// Composes the panels in rows. Each column is as wide as its widest panel, each row as high as its
/// highest.
pub(super) fn composed(sheet: &Sheet<'_>) -> Result<Figure, String> {
    let Sheet { name, title, label, keys, .. } = *sheet;
    let columns = sheet.columns.max(1);
    let boxes = sheet.panels.iter().map(|panel| box_of(panel)).collect::<Option<Vec<_>>>();
    let boxes = boxes.ok_or_else(|| format!("a panel of {name} has no box"))?;
    let widths = most(boxes.iter().enumerate().map(|(k, sides)| (k % columns, sides[2])));
    let heights = most(boxes.iter().enumerate().map(|(k, sides)| (k / columns, sides[3])));
    let before = |sides: &[f64], k: usize| sides[..k].iter().sum::<f64>();
    let mut drawn = String::new();
    for (k, (panel, [left, top, wide, high])) in sheet.panels.iter().zip(&boxes).enumerate() {
        let x = FINE * EDGE + before(&widths, k % columns);
        let y = FINE * HEAD + before(&heights, k / columns);
        let content = panel.split_once('>').map_or("", |(_, content)| content);
        drawn += &format!(
            "<svg x=\"{x}\" y=\"{y}\" width=\"{wide}\" height=\"{high}\" \
             viewBox=\"{left} {top} {wide} {high}\">{content}"
        );
    }
    let titled = TITLE_LETTER * title.chars().count() as f64;
    let width = (widths.iter().sum::<f64>() / FINE).max(titled) + 2.0 * EDGE;
    let below = HEAD + heights.iter().sum::<f64>() / FINE + 14.0;
    let (legend, high) = own_legend(keys, width - 2.0 * EDGE, below);
    let legend = format!("<g transform=\"translate({} 0)\">{legend}</g>", FINE * EDGE);
    let [wide, high] = [width, below + high].map(|side| FINE * side);
    let svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{}\" height=\"{}\" \
         viewBox=\"0 0 {wide} {high}\" role=\"img\"><title>{}</title><style>{}</style>\
         <rect class=\"paper\" x=\"0\" y=\"0\" width=\"{wide}\" height=\"{high}\"/>\
         {}{drawn}{legend}</svg>\n",
        wide / FINE,
        high / FINE,
        escape(label),
        *RULES,
        own_text([EDGE + 4.0, 20.0], "own-title", title)
    );
    let png = png(&svg).map_err(|error| format!("the figure {name}: {error}"))?;
    Ok(Figure { name: name.to_owned(), svg, png })
}

/// Left, top, width and height of a chart that stands alone.
fn box_of(chart: &str) -> Option<[f64; 4]> {
    let sides =
        attribute(chart, "data-box")?.split(' ').map(str::parse).collect::<Result<Vec<_>, _>>();
    sides.ok()?.try_into().ok()
}

/// Greatest side of each index.
fn most(sides: impl Iterator<Item = (usize, f64)>) -> Vec<f64> {
    let mut most = Vec::new();
    for (k, side) in sides {
        if most.len() <= k {
            most.resize(k + 1, 0.0);
        }
        most[k] = f64::max(most[k], side);
    }
    most
}
