//! Cumulative distributions of the error, with a curve for each tuned part.

use plotters::series::LineSeries;

use super::axis::Axis;
use super::format::fixed;
use super::plot::{Caption, Frame, Key, Px, Sample, chart};
use super::sections::pairs::steps;
use super::series::{CURVES, Series};
use super::theme::ink;

const SIZE: Px = [330.0, 230.0];

pub(super) const KEYS: [Key<'static>; 5] =
    [CURVES[0], CURVES[1], CURVES[2], CURVES[3], ("limit", Sample::Line, "bound of success")];

/// Panel of cumulative distributions.
#[derive(Clone, Debug)]
pub struct Shares {
    /// Name and unit of the error.
    pub axis: String,
    /// Ends of the logarithmic axis.
    pub span: [f64; 2],
    /// Greatest error of a success.
    pub bound: f64,
    /// Curves of the cells that are done.
    pub curves: Vec<ShareCurve>,
}

/// A curve.
#[derive(Clone, Debug)]
pub struct ShareCurve {
    /// Tuned part.
    pub series: Series,
    /// Error of every pair.
    pub errors: Vec<f64>,
}

impl ShareCurve {
    /// Share of pairs with errors up to `bound`, percent.
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
            // The one solid line first, so that dashed curves on top of it still show.
            let (full, dashed): (Vec<&ShareCurve>, Vec<&ShareCurve>) =
                self.curves.iter().partition(|curve| curve.series == Series::Joint);
            full.into_iter().chain(dashed).try_for_each(|curve| {
                let outline = steps(curve.errors.clone());
                chart.draw(LineSeries::new(outline, ink(curve.series.curve())))
            })
        })
    }

    fn label(&self, title: &str) -> String {
        let texts = self.curves.iter().map(|curve| {
            let within = fixed(curve.within(self.bound), 1);
            format!("{}: {within} % within the bound", curve.series.title())
        });
        format!("{title}: {}.", texts.collect::<Vec<_>>().join(", "))
    }
}
