//! Errors of every pair as dots, in a row for each set of parameters.

use super::axis::Axis;
use super::plot::{ABOVE, Canvas, Caption, Drawn, Key, LEFT, Sample, drawing};
use super::ruler::Ruler;

const TRACK: f64 = 205.0;
const ROW: f64 = 27.0;
/// Room left of the tracks, and right of them, pixels.
const NAMES: f64 = 78.0;
const END: f64 = 52.0;

pub(super) const KEYS: [Key<'static>; 5] = [
    ("dot-default", Sample::Dot, "a pair"),
    ("dot-tuned", Sample::Dot, "a pair, both tuned"),
    ("dot-default hollow", Sample::Dot, "a pair that failed"),
    ("middle", Sample::Line, "median of all"),
    ("limit", Sample::Line, "bound of success"),
];

/// Panel of rows.
#[derive(Clone, Debug)]
pub struct Strips {
    /// Name and unit of the error.
    pub axis: String,
    /// Ends of the logarithmic axis.
    pub span: [f64; 2],
    /// Greatest error of a success.
    pub bound: f64,
    /// Head of the texts at the ends of the rows.
    pub said: String,
    /// The rows, from the top.
    pub rows: Vec<StripRow>,
}

/// A row.
#[derive(Clone, Debug)]
pub struct StripRow {
    /// Name.
    pub name: String,
    /// True when the row is emphasised.
    pub strong: bool,
    /// Error of each pair, and true when it was registered.
    pub pairs: Vec<(f64, bool)>,
    /// Median; not finite without pairs.
    pub median: f64,
    /// Text at the end of the row.
    pub said: String,
}

impl Strips {
    pub(super) fn svg(&self, caption: &Caption<'_>) -> String {
        let height = 20.0 + ROW * self.rows.len() as f64;
        let size = [NAMES + TRACK + END, height + 46.0];
        let texts = self.rows.iter().map(|row| format!("{}: {}", row.name, row.said));
        let label = format!("{}. {}.", caption.title, texts.collect::<Vec<_>>().join(", "));
        let [low, high] = self.span;
        let ruler = Ruler { axis: Axis::between(low, high, true), left: NAMES, width: TRACK };
        drawing(caption, size, &label, |canvas| {
            canvas.text(&self.said, "tick", LEFT, [size[0] - 2.0, 9.0])?;
            self.foot(canvas, &ruler, height)?;
            (0..self.rows.len()).try_for_each(|row| self.row(canvas, &ruler, row))
        })
    }

    fn row(&self, canvas: &Canvas<'_>, ruler: &Ruler, number: usize) -> Drawn {
        let row = &self.rows[number];
        let middle = 20.0 + ROW * (number as f64 + 0.5);
        canvas.text(&row.name, "name", LEFT, [NAMES - 8.0, middle])?;
        canvas.text(&row.said, "tick", LEFT, [NAMES + TRACK + END - 2.0, middle])?;
        for (k, &(error, is_found)) in row.pairs.iter().enumerate() {
            let class = match (row.strong, is_found) {
                (true, true) => "dot-tuned",
                (true, false) => "dot-tuned hollow",
                (false, true) => "dot-default",
                (false, false) => "dot-default hollow",
            };
            // Offsets by the golden ratio keep neighbours in the list apart without random numbers.
            let off = (0.618_034 * k as f64).fract() - 0.5;
            canvas.dot(class, [ruler.across(error), middle + 0.62 * ROW * off], 1.7)?;
        }
        if !row.median.is_finite() {
            return Ok(());
        }
        let x = ruler.across(row.median);
        canvas.line("middle", [[x, middle - 0.42 * ROW], [x, middle + 0.42 * ROW]])
    }

    /// The axis under the rows, and the bound through them.
    fn foot(&self, canvas: &Canvas<'_>, ruler: &Ruler, height: f64) -> Drawn {
        let upright = |class: &str, value: f64| {
            let x = ruler.across(value);
            canvas.line(class, [[x, 20.0], [x, height]])
        };
        let ticks = ruler.ticks();
        ticks.iter().try_for_each(|&tick| upright("grid", tick))?;
        let labels: Vec<_> = ticks.iter().map(|&tick| (tick, ruler.number(tick))).collect();
        ruler.labels(canvas, height, &labels)?;
        canvas.line("frame", [[NAMES, height], [NAMES + TRACK, height]])?;
        upright("limit", self.bound)?;
        let place = [NAMES + 0.5 * TRACK, height + 42.0];
        canvas.text(&format!("{}, log axis", self.axis), "axis", ABOVE, place)
    }
}
