//! Two registered clouds from above.

use std::collections::BTreeSet;

use plotters::element::Rectangle;

use super::plot::{Caption, Key, Px, RIGHT, Sample, at, dots_path, drawing};
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

    /// All points within the frame.
    fn dots(&self, class: &str, cloud: &[[f64; 2]], scale: f64) -> String {
        let place = |[x, y]: &[f64; 2]| {
            [
                0.5 * SIDE + scale * (x - self.centre_m[0]),
                0.5 * SIDE - scale * (y - self.centre_m[1]),
            ]
        };
        let is_inside = |place: &Px| place.iter().all(|side| (2.0..SIDE - 2.0).contains(side));
        let places = cloud.iter().map(place).filter(is_inside);
        dots_path(class, places, GRAIN, &mut BTreeSet::new())
    }
}
