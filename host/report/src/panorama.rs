//! Directions of a scan's beams and the range of what they met, as the sensor sees them.

use std::collections::BTreeSet;

use echoloop_closed_loop::beams::Beams;
use echoloop_clouds::Cloud;
use nalgebra::Vector3;
use plotters::element::{PathElement, Rectangle};

use crate::format::escape;
use crate::plot::{ABOVE, BELOW, Caption, Key, LEFT, Px, Sample, at, dots_path, drawing, legend};
use crate::theme::ink;

const WIDTH: f64 = 720.0;
/// Room for the angles, left of the panorama and below it, pixels.
const ROOM: Px = [34.0, 20.0];
/// Side of the grid, pixels, in a cell of which only one beam is drawn.
const GRAIN: f64 = 1.0;
/// Greatest number of beams of a panel that are drawn.
const MOST: usize = 30_000;

/// Classes of echoes by range, and of beams without one, with the ends of the ranges, m.
const RANGES: [(&str, f64); 4] =
    [("beam-near", 5.0), ("beam-middle", 15.0), ("beam-far", 40.0), ("beam-farthest", f64::MAX)];

const KEYS: [Key<'static>; 5] = [
    ("beam-none", Sample::Dot, "nothing met"),
    ("beam-near", Sample::Dot, "up to 5 m"),
    ("beam-middle", Sample::Dot, "up to 15 m"),
    ("beam-far", Sample::Dot, "up to 40 m"),
    ("beam-farthest", Sample::Dot, "farther"),
];

/// Beams of one scan and what they met.
pub(crate) struct Panorama {
    title: &'static str,
    /// Pattern with its aim, in words.
    aim: String,
    /// Azimuth and elevation of each beam, degrees.
    beams: Vec<[f64; 2]>,
    /// Azimuth and elevation of each point, degrees, and its range, m.
    points: Vec<[f64; 3]>,
}

impl Panorama {
    /// Panorama of beams with their aim and of the cloud that they made, in the sensor's frame.
    pub(crate) fn new(title: &'static str, beams: &Beams, cloud: &Cloud) -> Self {
        let points = cloud.points.iter().map(|point| point.coords.cast());
        Self::of_points(title, beams, points)
    }

    /// The same of points in the sensor's frame, m. A point at the sensor is none.
    pub(crate) fn of_points(
        title: &'static str,
        beams: &Beams,
        points: impl Iterator<Item = Vector3<f64>>,
    ) -> Self {
        let point = |point: Vector3<f64>| {
            let range_m = point.norm();
            let [azimuth, elevation] = angles_deg((point / range_m).into());
            (range_m.is_finite() && range_m > 0.0).then_some([azimuth, elevation, range_m])
        };
        let directions = beams.directions(1);
        Self {
            title,
            aim: beams.pattern().to_string(),
            beams: directions.iter().map(|d| angles_deg(d.cast().into())).collect(),
            points: points.filter_map(point).collect(),
        }
    }

    /// Lowest and highest elevation of these beams, in tens of degrees.
    fn elevations(panels: &[Self]) -> [f64; 2] {
        let all = || panels.iter().flat_map(|panel| &panel.beams).map(|[_, elevation]| *elevation);
        let low = all().fold(0.0, f64::min);
        let high = all().fold(0.0, f64::max);
        [10.0 * (low / 10.0).floor(), 10.0 * (high / 10.0).ceil().max(1.0)]
    }
}

/// Panels one below the other, all with the same elevations, under one legend; `unit` is what a
/// point is called.
pub(crate) fn panels(panels: &[Panorama], unit: &str) -> String {
    let ends = Panorama::elevations(panels);
    let figure = |panorama: &Panorama| {
        let Panorama { title, aim, points, .. } = panorama;
        format!(
            "<figure><figcaption><b>{title}</b> <span>{}, {} {unit}</span></figcaption>{}</figure>",
            escape(aim),
            points.len(),
            svg(panorama, ends, unit)
        )
    };
    legend(&KEYS) + &panels.iter().map(figure).collect::<String>()
}

/// Every so many, for as many as are drawn.
fn drawn<T>(all: &[T]) -> impl Iterator<Item = &T> {
    all.iter().step_by(all.len().div_ceil(MOST).max(1))
}

/// Azimuth, to the left of ahead, and elevation of a unit vector, degrees.
fn angles_deg([x, y, z]: [f64; 3]) -> [f64; 2] {
    [libm::atan2(y, x).to_degrees(), libm::asin(z.clamp(-1.0, 1.0)).to_degrees()]
}

fn svg(panorama: &Panorama, [low, high]: [f64; 2], unit: &str) -> String {
    let [left, below] = ROOM;
    let scale = (WIDTH - left) / 360.0;
    let height = scale * (high - low);
    let place = |azimuth: f64, elevation: f64| {
        [left + scale * (180.0 - azimuth), scale * (high - elevation)]
    };
    let title = format!("Beams: {}", panorama.title.to_lowercase());
    let name = format!("beams-{}", panorama.title.to_lowercase());
    let caption = Caption { name: &name, title: &title, keys: &KEYS };
    let label = format!(
        "{}: {}, by azimuth and elevation; {} beams, {} {unit}.",
        panorama.title,
        panorama.aim,
        panorama.beams.len(),
        panorama.points.len()
    );
    drawing(&caption, [WIDTH, height + below], &label, |canvas| {
        let frame = [at([left, 0.5]), at([WIDTH - 0.5, height])];
        canvas.area.draw(&Rectangle::new(frame, ink("frame")))?;
        for azimuth in [180.0, 90.0, 0.0, -90.0, -180.0] {
            let [x, _] = place(azimuth, 0.0);
            canvas.area.draw(&PathElement::new([[x, 0.0], [x, height]].map(at), ink("grid")))?;
            let anchor = if azimuth == -180.0 { LEFT } else { BELOW };
            let y = if azimuth == -180.0 { height + 9.0 } else { height + 3.0 };
            canvas.text(&format!("{azimuth}°"), "tick", anchor, [x, y])?;
        }
        for elevation in [low, 0.0, high] {
            let [_, y] = place(0.0, elevation);
            canvas.area.draw(&PathElement::new([[left, y], [WIDTH, y]].map(at), ink("grid")))?;
            let anchor = if elevation == low { (LEFT.0, ABOVE.1) } else { LEFT };
            let anchor = if elevation == high { (LEFT.0, BELOW.1) } else { anchor };
            canvas.text(&format!("{elevation}°"), "tick", anchor, [left - 4.0, y])?;
        }
        let echoes = |from: f64, to: f64| {
            let within = move |point: &&[f64; 3]| (from..to).contains(&point[2]);
            drawn(&panorama.points)
                .filter(within)
                .map(|[azimuth, elevation, _]| place(*azimuth, *elevation))
        };
        let (mut seen, mut from) = (BTreeSet::new(), 0.0);
        for (class, to) in RANGES {
            canvas.top += &dots_path(class, echoes(from, to), GRAIN, &mut seen);
            from = to;
        }
        // Beams that met something are drawn already.
        let beams = drawn(&panorama.beams).map(|[azimuth, elevation]| place(*azimuth, *elevation));
        canvas.top += &dots_path("beam-none", beams, GRAIN, &mut seen);
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use echoloop_closed_loop::config::ScannerConfig;
    use echoloop_closed_loop::parameters::settings_of;
    use nalgebra::Point3;

    use super::*;

    fn of(set: &[(&str, f64)], cloud: &Cloud) -> Panorama {
        let values = set.iter().map(|(name, value)| ((*name).to_owned(), *value)).collect();
        let beams = ScannerConfig::of("steered").beams();
        Panorama::new("Tuned", &beams.aimed(&settings_of(&values)).unwrap(), cloud)
    }

    #[test]
    fn a_panorama_has_the_beams_of_its_own_aim_and_the_echoes_where_they_are() {
        let origin = Point3::origin(); // no echo
        let cloud =
            Cloud::new(vec![Point3::new(3.0, 3.0, 0.0), origin, Point3::new(0.0, -2.0, 0.0)]);
        let narrow = of(&[("lidar.azimuth_span", 90.0), ("lidar.tilt", -5.0)], &cloud);
        assert!(narrow.aim.contains("over 90° × 40° about -5°"), "{}", narrow.aim);
        let reach = |axis: usize| {
            let angles = || narrow.beams.iter().map(|angles| angles[axis]);
            [angles().fold(f64::MAX, f64::min), angles().fold(f64::MIN, f64::max)]
        };
        let close = |found: [f64; 2], expected: [f64; 2]| {
            found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1.0)
        };
        assert!(close(reach(0), [-45.0, 45.0]) && close(reach(1), [-25.0, 15.0]));
        let expected = [[45.0, 0.0, 18.0_f64.sqrt()], [-90.0, 0.0, 2.0]];
        assert_eq!(narrow.points.len(), expected.len());
        for (found, expected) in narrow.points.iter().zip(expected) {
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9), "{found:?}");
        }
    }

    #[test]
    fn both_panels_span_the_elevations_of_both() {
        let cloud = Cloud::new(Vec::new());
        let wide = [("lidar.elevation_span", 80.0), ("lidar.tilt", 0.0)];
        let both = [of(&[], &cloud), of(&wide, &cloud)];
        assert_eq!(Panorama::elevations(&both), [-40.0, 40.0]);
        assert_eq!(Panorama::elevations(&both[..1]), [-30.0, 10.0]);
    }

    #[test]
    fn of_dots_in_one_grain_the_first_is_drawn() {
        let places = [[1.2, 3.4], [1.4, 3.4], [2.2, 3.4]];
        let mut seen = BTreeSet::new();
        let mut path = |class| dots_path(class, places.into_iter(), 1.0, &mut seen);
        assert_eq!(path("near"), "<path class=\"near\" d=\"M12 34h1M22 34h1\"/>");
        assert_eq!(path("far"), "<path class=\"far\" d=\"\"/>");
    }

    #[test]
    fn the_caption_counts_all_points_and_the_drawing_has_30_000_at_most() {
        let point = |i: u16| Point3::new(1.0, 0.001 * f32::from(i), 0.0);
        let cloud = Cloud::new((0..40_000).map(point).collect());
        let text = panels(&[of(&[], &cloud)], "echoes");
        assert!(text.contains(", 40000 echoes</span>"), "the caption");
        assert_eq!(drawn(&cloud.points).count(), 20_000);
    }
}
