//! Directions of the beams, with the default and tuned, and the range of what they met: the shown
//! pair's target scan as a panorama.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use echoloop_closed_loop::beams::Beams;
use echoloop_closed_loop::config::ScannerConfig;
use echoloop_closed_loop::parameters::{Values, settings_of};
use echoloop_clouds::Cloud;
use plotters::element::{PathElement, Rectangle};

use super::Report;
use crate::format::escape;
use crate::plot::{ABOVE, BELOW, Caption, Key, LEFT, Px, Sample, at, drawing, legend};
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
    ("beam-none", Sample::Dot, "beam without an echo"),
    ("beam-near", Sample::Dot, "up to 5 m"),
    ("beam-middle", Sample::Dot, "up to 15 m"),
    ("beam-far", Sample::Dot, "up to 40 m"),
    ("beam-farthest", Sample::Dot, "farther"),
];

/// Directions of a scan's beams and of its echoes.
struct Panorama {
    title: &'static str,
    /// Pattern with its aim, in words.
    aim: String,
    /// Azimuth and elevation of each beam, degrees.
    beams: Vec<[f64; 2]>,
    /// Azimuth and elevation of each point, degrees, and its range, m.
    points: Vec<[f64; 3]>,
}

impl Panorama {
    /// `None` of an aim that the pattern refuses, and without beams.
    fn of(title: &'static str, own: &Beams, values: &Values, target: &Cloud) -> Option<Self> {
        let beams = own.aimed(&settings_of(values)).ok()?;
        let aim = beams.pattern().to_string();
        let directions = beams.directions(1);
        let step = directions.len().div_ceil(MOST).max(1);
        let angles = directions.iter().step_by(step).map(|d| angles_deg(d.cast().into()));
        let step = target.points.len().div_ceil(MOST).max(1);
        let points = target.points.iter().step_by(step).filter_map(|p| {
            let [x, y, z]: [f64; 3] = p.coords.cast().into();
            let range_m = (x * x + y * y + z * z).sqrt();
            let [azimuth, elevation] = angles_deg([x, y, z].map(|c| c / range_m));
            (range_m.is_finite() && range_m > 0.0).then_some([azimuth, elevation, range_m])
        });
        let (beams, points): (Vec<_>, _) = (angles.collect(), points.collect());
        // A table is gone with its file.
        (!beams.is_empty()).then_some(Self { title, aim, beams, points })
    }
}

/// Azimuth, to the left of ahead, and elevation of a unit vector, degrees.
fn angles_deg([x, y, z]: [f64; 3]) -> [f64; 2] {
    [libm::atan2(y, x).to_degrees(), libm::asin(z.clamp(-1.0, 1.0)).to_degrees()]
}

/// The two panoramas, one below the other; nothing for an aim that the pattern refuses.
pub(super) fn section(report: &Report) -> String {
    let scanner = report.run.config.scanner.clone().try_into::<ScannerConfig>();
    let Ok(own) = scanner.map(|scanner| scanner.beams()) else { return String::new() };
    let result = &report.run.result;
    let [[before, _], [after, _]] = &report.clouds;
    let panels = [
        Panorama::of("Default", &own, &result.default, before),
        Panorama::of("Tuned", &own, &result.tuned, after),
    ];
    let panels: Vec<Panorama> = panels.into_iter().flatten().collect();
    if panels.len() < 2 {
        return String::new();
    }
    let ends = elevations(&panels);
    let panel = |panorama: &Panorama| {
        let Panorama { title, aim, points, .. } = panorama;
        let echoes = points.len();
        format!(
            "<figure><figcaption><b>{title}</b> <span>{}, {echoes} echoes</span></figcaption>{}\
             </figure>",
            escape(aim),
            svg(panorama, ends)
        )
    };
    format!(
        "<section id=\"beams\"><h2>Where the beams go</h2><p class=\"lead\">The target scan of the \
         pair below, as the sensor sees it: ahead in the middle, behind at both ends.</p>{}{}\
         </section>\n",
        legend(&KEYS),
        panels.iter().map(panel).collect::<String>()
    )
}

/// Lowest and highest elevation that any of the beams has, in tens of degrees.
fn elevations(panels: &[Panorama]) -> [f64; 2] {
    let all = || panels.iter().flat_map(|panel| &panel.beams).map(|[_, elevation]| *elevation);
    let low = all().fold(0.0, f64::min);
    let high = all().fold(0.0, f64::max);
    [10.0 * (low / 10.0).floor(), 10.0 * (high / 10.0).ceil().max(1.0)]
}

fn svg(panorama: &Panorama, [low, high]: [f64; 2]) -> String {
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
        "{}: {}, by azimuth and elevation; {} of the points have an echo.",
        panorama.title,
        panorama.aim,
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
            panorama
                .points
                .iter()
                .filter(within)
                .map(|[azimuth, elevation, _]| place(*azimuth, *elevation))
        };
        let beams = panorama.beams.iter().map(|[azimuth, elevation]| place(*azimuth, *elevation));
        canvas.top += &dots("beam-none", beams);
        let mut from = 0.0;
        for (class, to) in RANGES {
            canvas.top += &dots(class, echoes(from, to));
            from = to;
        }
        Ok(())
    })
}

/// Places as one path: each a stroke of a tenth of a pixel, whose round ends make it a dot.
fn dots(class: &str, places: impl Iterator<Item = Px>) -> String {
    let mut seen = BTreeSet::new();
    let mut path = String::new();
    for place in places {
        if seen.insert(place.map(|side| (side / GRAIN).floor() as i32)) {
            let (x, y) = at(place);
            let _ = write!(path, "M{x} {y}h1");
        }
    }
    format!("<path class=\"{class}\" d=\"{path}\"/>")
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::*;

    fn own() -> Beams {
        ScannerConfig::of("steered").beams()
    }

    fn values(values: &[(&str, f64)]) -> Values {
        values.iter().map(|(name, value)| ((*name).to_owned(), *value)).collect()
    }

    #[test]
    fn a_panorama_has_the_beams_of_its_own_aim_and_the_echoes_where_they_are() {
        let target = Cloud::new(vec![Point3::new(3.0, 3.0, 0.0), Point3::new(0.0, -2.0, 0.0)]);
        let of = |set: &[(&str, f64)]| Panorama::of("Tuned", &own(), &values(set), &target);
        let narrow = of(&[("lidar.azimuth_span", 90.0), ("lidar.tilt", -10.0)]).unwrap();
        assert!(narrow.aim.contains("over 90° × 60° about -10°"), "{}", narrow.aim);
        let reach = |axis: usize| {
            let angles = || narrow.beams.iter().map(|angles| angles[axis]);
            [angles().fold(f64::MAX, f64::min), angles().fold(f64::MIN, f64::max)]
        };
        let close = |found: [f64; 2], expected: [f64; 2]| {
            found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1.0)
        };
        assert!(close(reach(0), [-45.0, 45.0]) && close(reach(1), [-40.0, 20.0]));
        let expected = [[45.0, 0.0, 18.0_f64.sqrt()], [-90.0, 0.0, 2.0]];
        for (found, expected) in narrow.points.iter().zip(expected) {
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9), "{found:?}");
        }
        assert!(of(&[("lidar.tilt", 40.0)]).is_none(), "beyond the mount");
    }

    #[test]
    fn both_panels_span_the_elevations_of_both_and_a_dot_is_drawn_once() {
        let target = Cloud::new(Vec::new());
        let of = |set: &[(&str, f64)]| Panorama::of("", &own(), &values(set), &target).unwrap();
        let panels = [of(&[]), of(&[("lidar.elevation_span", 80.0)])];
        assert_eq!(elevations(&panels), [-40.0, 40.0]);
        assert_eq!(elevations(&panels[..1]), [-30.0, 30.0]);
        let path = dots("beam-near", [[1.2, 3.4], [1.4, 3.4], [2.2, 3.4]].into_iter());
        assert_eq!(path, "<path class=\"beam-near\" d=\"M12 34h1M22 34h1\"/>");
    }
}
