//! Two registered clouds from above.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use plotters::element::Rectangle;

use super::plot::{Caption, Key, RIGHT, Sample, at, drawing};
use super::theme::ink;

const SIDE: f64 = 330.0;

/// Side of the grid, pixels, in a cell of which only one point of a cloud is drawn.
const GRAIN: f64 = 0.8;

pub(super) const KEYS: [Key<'static>; 2] =
    [("key-target", Sample::Dot, "target"), ("key-source", Sample::Dot, "source, laid on it")];

/// A panel of two clouds.
#[derive(Clone, Debug)]
pub struct Overlay {
    /// Half the side of the visible square, m.
    pub half_m: f64,
    /// Centre of the visible square, m.
    pub centre_m: [f64; 2],
    /// Target and source, x and y in the target's frame, m.
    pub clouds: [Vec<[f64; 2]>; 2],
    /// Length of the scale bar, m.
    pub bar_m: f64,
}

impl Overlay {
    pub(super) fn svg(&self, caption: &Caption<'_>) -> String {
        let label = format!(
            "{}: {} points of the target and {} of the source from above.",
            caption.title,
            self.clouds[0].len(),
            self.clouds[1].len()
        );
        let scale = SIDE / (2.0 * self.half_m);
        drawing(caption, [SIDE, SIDE + 4.0], &label, |canvas| {
            let edges = [at([0.5, 0.5]), at([SIDE - 0.5, SIDE - 0.5])];
            canvas.area.draw(&Rectangle::new(edges, ink("frame")))?;
            let (from, y) = (14.0, SIDE - 14.0);
            let to = from + scale * self.bar_m;
            canvas.whisker("middle", [from, to], y, 4.0)?;
            canvas.text(&format!("{} m", self.bar_m), "tick", RIGHT, [to + 7.0, y])?;
            for (class, cloud) in ["cloud-target", "cloud-source"].iter().zip(&self.clouds) {
                canvas.top += &self.dots(class, cloud, scale);
            }
            Ok(())
        })
    }

    /// All points as one path: each a stroke of a tenth of a pixel, whose round ends make it a dot.
    fn dots(&self, class: &str, cloud: &[[f64; 2]], scale: f64) -> String {
        let mut seen = BTreeSet::new();
        let mut path = String::new();
        for [x, y] in cloud {
            let place = [
                0.5 * SIDE + scale * (x - self.centre_m[0]),
                0.5 * SIDE - scale * (y - self.centre_m[1]),
            ];
            let is_inside = place.iter().all(|side| (2.0..SIDE - 2.0).contains(side));
            let grain = place.map(|side| (side / GRAIN).floor() as i32);
            if is_inside && seen.insert(grain) {
                let (x, y) = at(place);
                let _ = write!(path, "M{x} {y}h1");
            }
        }
        format!("<path class=\"{class}\" d=\"{path}\"/>")
    }
}
