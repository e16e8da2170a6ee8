//! Pictures of the proof for `docs/results.md`, drawn from the lines alone.

use anyhow::{Result, anyhow};
use echoloop_campaign::{Choice, Line};
use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::PROOF;
use super::record::Run;
use super::table::{LEAST_RUNS, mean_of, of, of_place, title, to};
use crate::record::three_digits;

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Drawn = Result<(), DrawingAreaErrorKind<std::io::Error>>;
/// Words of a legend, in the colour of their marks.
type Key = (String, RGBColor);

/// Width of a picture, pixels.
const WIDTH: i32 = 720;
/// Height of title and legend, and of the numbers below an axis, pixels.
const HEAD: i32 = 60;
const FOOT: i32 = 24;
/// Room for the names of the rows, pixels.
const NAMES: i32 = 190;

const GREY: RGBColor = RGBColor(140, 140, 140);
const PALE: RGBColor = RGBColor(225, 225, 225);
const BLUE: RGBColor = RGBColor(31, 111, 178);
const ORANGE: RGBColor = RGBColor(217, 130, 43);
const GREEN: RGBColor = RGBColor(46, 139, 87);
const PURPLE: RGBColor = RGBColor(123, 79, 163);

/// Rows of the plan that both together are compared with.
const CONTROLS: [(&str, RGBColor); 5] = [
    ("sequence", PURPLE),
    ("combined-half", BLUE),
    ("hand", ORANGE),
    ("lidar", GREEN),
    ("registration", GREY),
];
/// Rows of the plan whose pairs found are shown.
const FOUND: [(&str, RGBColor); 5] = [
    ("nothing", GREY),
    ("registration", PURPLE),
    ("hand", ORANGE),
    ("lidar", GREEN),
    ("joint", BLUE),
];
/// Colours of the methods, in the plan's order.
const METHODS: [RGBColor; 4] = [BLUE, PURPLE, ORANGE, GREEN];

/// Name of a file, and its SVG.
pub(super) type Picture = (&'static str, String);

/// The pictures of a condition's lines.
///
/// # Errors
///
/// When one cannot be drawn.
pub(super) fn pictures(lines: &[&Line<Run>]) -> Result<[Picture; 3]> {
    Ok([
        ("proof-controls.svg", controls(lines)?),
        ("proof-found.svg", found(lines)?),
        ("proof-settings.svg", settings(lines)?),
    ])
}

/// Ratio of both together to each control, with its interval.
fn controls(lines: &[&Line<Run>]) -> Result<String> {
    let marks = |lines: &[&Line<Run>]| {
        let mark = |(k, &(control, colour)): (usize, &(&str, RGBColor))| {
            let estimate =
                to(lines, control).filter(|_| of(lines, control).count() >= LEAST_RUNS)?;
            Some(Mark {
                at: estimate.value.exp(),
                interval: Some(estimate.interval.map(f64::exp)),
                is_full: !estimate.holds(0.0),
                off: 0.17 * (k as f64 - 2.0),
                colour,
            })
        };
        CONTROLS.iter().enumerate().filter_map(mark).collect()
    };
    let strip = Strip {
        axis: Axis { ends: [0.04, 2.0], is_log: true, ticks: vec![0.05, 0.1, 0.2, 0.5, 1.0, 2.0] },
        uprights: vec![(1.0, BLACK)],
        rows: rows(lines, |_| true, marks),
    };
    let title = "Error of both together over that of each control (a disc differs from 1)";
    alone(title, &CONTROLS.map(titled), 36, &strip)
}

/// Share of pairs that the global methods find.
fn found(lines: &[&Line<Run>]) -> Result<String> {
    let marks = |lines: &[&Line<Run>]| {
        let mark = |(k, &(row, colour)): (usize, &(&str, RGBColor))| {
            let at = mean_of(lines, row, &|run| run.tuned.recall_pct);
            let off = 0.14 * (k as f64 - 2.0);
            at.is_finite().then_some(Mark { at, interval: None, is_full: true, off, colour })
        };
        FOUND.iter().enumerate().filter_map(mark).collect()
    };
    let ticks = vec![0.0, 20.0, 40.0, 60.0, 80.0, 100.0];
    let strip = Strip {
        axis: Axis { ends: [0.0, 100.0], is_log: false, ticks },
        uprights: Vec::new(),
        rows: rows(lines, |method| ["fgr", "mac"].contains(&method), marks),
    };
    alone("Pairs found, %, mean of the seeds", &FOUND.map(titled), 32, &strip)
}

/// The sensor that both together choose, by kind of scene.
fn settings(lines: &[&Line<Run>]) -> Result<String> {
    let methods = PROOF.values("method").iter().map(Choice::title).map(str::to_owned);
    let mut keys: Vec<Key> = methods.zip(METHODS).collect();
    keys.extend([("line: the start".to_owned(), GREY), ("line: set by hand".to_owned(), ORANGE)]);
    drawn(HEAD + 3 * 150, |area| {
        head(area, "The sensor that both together choose, a dot a seed", &keys)?;
        let panels = area.split_vertically(HEAD).1.split_evenly((3, 3));
        panels.iter().zip(SETTINGS).try_for_each(|(panel, setting)| {
            panel.draw_text(setting.title, &style(12, HPos::Left), (12, 8))?;
            let strip = chosen(lines, &setting);
            strip.draw(&panel.margin(18, 6, 6, 14), 90)
        })
    })
}

/// A setting of the sensor.
struct Setting {
    name: &'static str,
    title: &'static str,
    is_log: bool,
}

const fn setting(name: &'static str, title: &'static str, is_log: bool) -> Setting {
    Setting { name, title, is_log }
}

const SETTINGS: [Setting; 9] = [
    setting("lidar.rows", "Rows", true),
    setting("lidar.elevation_span", "Elevation span, °", false),
    setting("lidar.tilt", "Tilt, °", false),
    setting("lidar.azimuth_span", "Azimuth span, °", false),
    setting("lidar.power", "Power, W", true),
    setting("lidar.pulse_width", "Pulse width, ns", true),
    setting("lidar.waveform_resolution", "Samples a waveform", true),
    setting("lidar.snr_threshold", "Threshold, σ", false),
    setting("lidar.gain_slope", "Slope of the gain, dB/m", false),
];

fn chosen(lines: &[&Line<Run>], setting: &Setting) -> Strip {
    let value = |line: &&Line<Run>| line.result.parameters.get(setting.name).copied();
    let lane = |scene: &str| {
        let of_method = PROOF.names("method").zip(METHODS).enumerate();
        let marks = of_method.flat_map(|(k, (method, colour))| {
            let own = of_place(lines, method, scene);
            let values: Vec<f64> = of(&own, "joint").filter_map(|line| value(&line)).collect();
            let off = 0.2 * (k as f64 - 1.5);
            values.into_iter().map(move |at| Mark {
                at,
                interval: None,
                is_full: true,
                off,
                colour,
            })
        });
        (scene.to_owned(), marks.collect())
    };
    let rows: Vec<(String, Vec<Mark>)> = PROOF.names("scene").map(lane).collect();
    let of_row = |row| of(lines, row).find_map(|line| value(&line));
    let uprights: Vec<(f64, RGBColor)> = [(of_row("nothing"), GREY), (of_row("hand"), ORANGE)]
        .into_iter()
        .filter_map(|(at, colour)| Some((at?, colour)))
        .collect();
    let all = rows.iter().flat_map(|(_, marks)| marks.iter().map(|mark| mark.at));
    let [low, high] = all
        .chain(uprights.iter().map(|upright| upright.0))
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], at| [low.min(at), high.max(at)]);
    let axis = Axis { ends: [low, high], is_log: setting.is_log, ticks: vec![low, high] };
    Strip { axis, uprights, rows }
}

/// A row for each method and scene that has marks.
fn rows(
    lines: &[&Line<Run>],
    is_method: impl Fn(&str) -> bool,
    marks: impl Fn(&[&Line<Run>]) -> Vec<Mark>,
) -> Vec<(String, Vec<Mark>)> {
    let methods = PROOF.values("method").iter().filter(|method| is_method(&method.name));
    let places = methods.flat_map(|method| PROOF.names("scene").map(move |scene| (method, scene)));
    let row = |(method, scene): (&Choice, &str)| {
        let marks = marks(&of_place(lines, &method.name, scene));
        (!marks.is_empty()).then(|| (format!("{}, {scene}", method.title()), marks))
    };
    places.filter_map(row).collect()
}

fn titled((row, colour): (&str, RGBColor)) -> Key {
    (title(row).to_owned(), colour)
}

/// Rows of marks above one axis.
struct Strip {
    axis: Axis,
    /// Lines through all rows.
    uprights: Vec<(f64, RGBColor)>,
    rows: Vec<(String, Vec<Mark>)>,
}

/// A horizontal axis.
struct Axis {
    ends: [f64; 2],
    is_log: bool,
    ticks: Vec<f64>,
}

struct Mark {
    at: f64,
    interval: Option<[f64; 2]>,
    /// True for a disc, false for a ring.
    is_full: bool,
    /// Offset from the middle of the row, in heights of a row.
    off: f64,
    colour: RGBColor,
}

impl Axis {
    /// Place between the ends, 0 to 1; what lies beyond an end is at it.
    fn share(&self, value: f64) -> f64 {
        let scaled = |value: f64| if self.is_log { value.ln() } else { value };
        let [low, high] = self.ends.map(scaled);
        ((scaled(value) - low) / (high - low).max(f64::MIN_POSITIVE)).clamp(0.0, 1.0)
    }
}

impl Strip {
    /// Draws rows of equal height, and the axis in the last pixels.
    fn draw(&self, area: &Area<'_>, names: i32) -> Drawn {
        let (width, height) = area.dim_in_pixel();
        let bottom = height as i32 - FOOT;
        let across = |value| {
            let track = f64::from(width as i32 - names - 14);
            names + (self.axis.share(value) * track).round() as i32
        };
        let upright = |value, colour: RGBColor| {
            area.draw(&PathElement::new([(across(value), 0), (across(value), bottom)], colour))
        };
        for &tick in &self.axis.ticks {
            upright(tick, PALE)?;
            let words = format!("{}", three_digits(tick));
            area.draw_text(&words, &style(11, HPos::Center), (across(tick), bottom + 11))?;
        }
        self.uprights.iter().try_for_each(|&(value, colour)| upright(value, colour))?;
        let row_px = f64::from(bottom) / self.rows.len().max(1) as f64;
        for (k, (name, marks)) in self.rows.iter().enumerate() {
            let middle = |off: f64| ((k as f64 + 0.5 + off) * row_px).round() as i32;
            area.draw_text(name, &style(12, HPos::Right), (names - 10, middle(0.0)))?;
            for &Mark { at, interval, is_full, off, colour } in marks {
                let y = middle(off);
                if let Some([low, high]) = interval {
                    area.draw(&PathElement::new([(across(low), y), (across(high), y)], colour))?;
                }
                area.draw(&Circle::new((across(at), y), 3, WHITE.filled()))?;
                let fill = if is_full { colour.filled() } else { colour.stroke_width(1) };
                area.draw(&Circle::new((across(at), y), 3, fill))?;
            }
        }
        Ok(())
    }
}

/// A picture of one strip.
fn alone(title: &str, keys: &[Key], row_px: i32, strip: &Strip) -> Result<String> {
    drawn(HEAD + row_px * strip.rows.len() as i32 + FOOT, |area| {
        head(area, title, keys)?;
        strip.draw(&area.split_vertically(HEAD).1, NAMES)
    })
}

fn drawn(height: i32, draw: impl FnOnce(&Area<'_>) -> Drawn) -> Result<String> {
    let mut svg = String::new();
    {
        let backend = SVGBackend::with_string(&mut svg, (WIDTH as u32, height as u32));
        let area = backend.into_drawing_area();
        let drawn = area.fill(&WHITE).and_then(|()| draw(&area)).and_then(|()| area.present());
        drawn.map_err(|error| anyhow!("cannot draw a picture: {error}"))?;
    }
    Ok(svg)
}

/// Title, and below it a dot and words for each key.
fn head(area: &Area<'_>, title: &str, keys: &[Key]) -> Drawn {
    area.draw_text(title, &style(15, HPos::Left), (12, 16))?;
    let mut left = 16;
    for (words, colour) in keys {
        area.draw(&Circle::new((left, 40), 4, colour.filled()))?;
        area.draw_text(words, &style(11, HPos::Left), (left + 8, 40))?;
        left += 22 + (5.6 * words.chars().count() as f64) as i32;
    }
    Ok(())
}

fn style(px: i32, side: HPos) -> TextStyle<'static> {
    ("sans-serif", px).into_text_style(&(1, 1)).pos(Pos::new(side, VPos::Center))
}

#[cfg(test)]
mod tests {
    use super::super::record::fixture;
    use super::*;

    #[test]
    fn a_value_lies_on_its_axis_and_at_its_end_when_beyond() {
        let axis = Axis { ends: [0.1, 10.0], is_log: true, ticks: Vec::new() };
        let shares = [0.1, 1.0, 10.0, 1e-9, 1e9].map(|value| axis.share(value));
        let expected = [0.0, 0.5, 1.0, 0.0, 1.0];
        assert!(shares.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{shares:?}");
        let one = Axis { ends: [3.0; 2], is_log: false, ticks: Vec::new() };
        assert_eq!(one.share(3.0), 0.0);
    }

    #[test]
    fn a_row_is_a_disc_where_it_differs_and_a_ring_where_it_does_not() {
        let line = |tuned: &str, seed: &str, error: u32| {
            let cell = PROOF.cells(&[("seed", &[seed.to_owned()])]).swap_remove(0);
            let parameters = [("lidar.rows".to_owned(), f64::from(error))].into();
            let result = Run { parameters, ..fixture(error, 1) };
            Line { cell: cell.with("tuned", tuned), made: "today".into(), result }
        };
        let of_seed = |seed| {
            [("joint", 400), ("lidar", 400), ("hand", 900)].map(|(row, e)| line(row, seed, e))
        };
        let lines: Vec<Line<Run>> = ["1", "2", "3"].into_iter().flat_map(of_seed).collect();
        let pictures = pictures(&lines.iter().collect::<Vec<_>>()).unwrap();
        let counted = |picture: &str, mark: &str| picture.matches(mark).count();
        let of_colour = |picture: &str, colour: RGBColor| {
            let RGBColor(r, g, b) = colour;
            let hex = format!("#{r:02X}{g:02X}{b:02X}");
            let discs = picture.lines().filter(|line| line.contains("<circle"));
            [format!("fill=\"{hex}\""), format!("stroke=\"{hex}\"")]
                .map(|style| discs.clone().filter(|line| line.contains(&style)).count())
        };
        // Of each control the legend has a disc as well.
        let [(_, controls), (_, found), (_, settings)] = &pictures;
        assert_eq!(of_colour(controls, ORANGE), [2, 0], "by hand: a disc\n{controls}");
        assert_eq!(of_colour(controls, GREEN), [1, 1], "the sensor alone: a ring\n{controls}");
        assert_eq!(counted(found, "FGR"), 0, "no line of a global method");
        // Three choices of ICP, three colours of the other methods and two lines in the legend.
        assert_eq!(of_colour(settings, BLUE), [1 + 3, 0], "{settings}");
    }
}
