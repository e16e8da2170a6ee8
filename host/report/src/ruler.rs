//! A horizontal axis below rows that share it.

use plotters::coord::ranged1d::{BoldPoints, Ranged, ValueFormatter};

use super::axis::Axis;
use super::plot::{BELOW, Canvas, Drawn};

/// Steps along the axis: plotters maps to whole numbers.
const STEPS: i32 = 100_000;

/// Half the width of a letter of a label, pixels, and the gap on either side of a label.
const HALF_LETTER: f64 = 3.4;
const GAP: f64 = 4.0;

/// An axis with its left end and width, pixels.
pub(super) struct Ruler {
    pub(super) axis: Axis,
    pub(super) left: f64,
    pub(super) width: f64,
}

impl Ruler {
    /// Place of a value, pixels; a value beyond the ends lies at the nearer one.
    pub(super) fn across(&self, value: f64) -> f64 {
        let share = f64::from(self.axis.map(&value, (0, STEPS))) / f64::from(STEPS);
        self.left + self.width * share
    }

    /// Values of the marks.
    pub(super) fn ticks(&self) -> Vec<f64> {
        self.axis.key_points(BoldPoints(8))
    }

    /// Text of a mark.
    pub(super) fn number(&self, tick: f64) -> String {
        self.axis.format_ext(&tick)
    }

    /// Draws labels below `y` in their order; one that would touch an earlier one is left out.
    pub(super) fn labels(&self, canvas: &Canvas<'_>, y: f64, all: &[(f64, String)]) -> Drawn {
        let mut taken: Vec<[f64; 2]> = Vec::new();
        for (tick, label) in all {
            let x = self.across(*tick);
            let half = HALF_LETTER * label.chars().count() as f64 + GAP;
            if taken.iter().any(|[from, to]| x + half > *from && x - half < *to) {
                continue;
            }
            taken.push([x - half, x + half]);
            canvas.line("frame", [[x, y], [x, y + 4.0]])?;
            canvas.text(label, "tick", BELOW, [x, y + 6.0])?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ruler_is_logarithmic_where_its_axis_is_and_ends_at_its_ends() {
        let ruler = Ruler { axis: Axis::between(0.01, 1.0, true), left: 10.0, width: 200.0 };
        for (value, x) in [(0.01, 10.0), (0.1, 110.0), (1.0, 210.0), (5.0, 210.0), (0.0, 10.0)] {
            assert!((ruler.across(value) - x).abs() < 0.01, "{value}");
        }
    }
}
