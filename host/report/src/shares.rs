//! Shares of pairs by error: a curve for each way of tuning.

use plotters::series::LineSeries;

use super::axis::Axis;
use super::format::fixed;
use super::sections::pairs::steps;
use super::plot::{Caption, Frame, Key, Px, Sample, chart};
use super::series::{CURVES, Series};
use super::theme::ink;

const SIZE: Px = [330.0, 230.0];

pub(super) const KEYS: [Key<'static>; 5] =
    [CURVES[0], CURVES[1], CURVES[2], CURVES[3], ("limit", Sample::Line, "bound of success")];

/// A panel of curves.
#[derive(Clone, Debug)]
pub struct Shares {
    /// What the error is, with its unit.
    pub axis: String,
    /// Ends of the axis, which is logarithmic.
    pub span: [f64; 2],
    /// A pair beyond it has failed.
    pub bound: f64,
    /// The curves there are.
    pub curves: Vec<ShareCurve>,
}

/// A curve.
#[derive(Clone, Debug)]
pub struct ShareCurve {
    /// Whose.
    pub series: Series,
    /// The error of every pair.
    pub errors: Vec<f64>,
}

impl ShareCurve {
    /// Percent of the pairs that err by no more.
    fn within(&self, bound: f64) -> f64 {
        let found = self.errors.iter().filter(|error| **error <= bound).count();
        100.0 * found as f64 / self.errors.len() as f64
    }
}

impl Shares {
    pub(super) fn svg(&self, caption: &Caption<'_>) -> String {
        let x_title = format!("{}, log axis", self.axis);
        let frame = Frame {
            caption: *caption,
            size: SIZE,
            label: &self.label(caption.title),
            y_title: "% of all pairs",
            x_title: &x_title,
        };
        let [low, high] = self.span;
        chart(&frame, Axis::between(low, high, true), Axis::between(0.0, 100.0, false), |chart| {
            if self.curves.is_empty() {
                return chart.note("no cell of it is done");
            }
            chart.upright("limit", self.bound)?;
            // The one full line first: dashes on it still show where two curves are one.
            let (full, dashed): (Vec<&ShareCurve>, Vec<&ShareCurve>) =
                self.curves.iter().partition(|curve| curve.series == Series::Joint);
            full.into_iter().chain(dashed).try_for_each(|curve| {
                let outline = steps(curve.errors.clone());
                chart.draw(LineSeries::new(outline, ink(curve.series.curve())))
            })
        })
    }

    fn label(&self, title: &str) -> String {
        let told = self.curves.iter().map(|curve| {
            let within = fixed(curve.within(self.bound), 1);
            format!("{}: {within} % within the bound", curve.series.title())
        });
        format!("{title}: {}.", told.collect::<Vec<_>>().join(", "))
    }
}
