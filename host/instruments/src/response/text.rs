//! A response as a file, a point a row.

use std::fmt::Write;
use std::path::Path;

use echoloop_files::FileError;

use super::curve::{Curve, PER_WIDTH};
use super::model::Response;
use crate::rows::Rows;

/// Least and greatest number of points of a file.
const POINTS: std::ops::RangeInclusive<usize> = 5..=100_000;

/// Greatest length of a response before and after its top, widths.
const MOST_WIDTHS: f64 = 40.0;

/// Greatest deviation of a time step, over the mean step: times are rounded to a few digits.
const UNEVEN: f64 = 0.02;

/// Spread of a response given without: as estimated from a good recording.
const SPREAD: f64 = 0.01;

impl Response {
    /// A response from rows of `time_ns, level` or `time_ns, level, spread`. Times are in even
    /// steps; levels are above rest, in any unit, highest inside; spread is in the same unit.
    /// `path` is for messages.
    ///
    /// # Errors
    ///
    /// [`FileError::Content`] with the row at fault and the expected content.
    pub fn of_points(path: &Path, rows: &Rows, sample_ns: f64) -> Result<Self, FileError> {
        points(rows, sample_ns).map_err(FileError::content(path))
    }

    /// The response as CSV that [`Response::of_points`] reads.
    pub fn to_csv(&self, sample_ns: f64) -> String {
        let mut text = String::new();
        for (lag, level, spread) in self.points() {
            // Writing to a String cannot fail.
            let _ = writeln!(text, "{:.6},{level:.6},{spread:.6}", lag * sample_ns);
        }
        text
    }
}

fn points(rows: &Rows, sample_ns: f64) -> Result<Response, String> {
    let count = rows.len();
    if !POINTS.contains(&count) {
        let (least, most) = (POINTS.start(), POINTS.end());
        return Err(format!("expected {least} to {most} rows of a response, found {count}"));
    }
    let columns = rows.row(0).len();
    let (mut times, mut levels, mut spreads) = (Vec::new(), Vec::new(), Vec::new());
    for row in 0..count {
        let values = rows.row(row);
        match (&values[..], columns) {
            (&[time, level], 2) => levels.push((times.push(time), level).1),
            (&[time, level, spread], 3) if spread >= 0.0 => {
                levels.push((times.push(time), level).1);
                spreads.push(spread);
            }
            _ => return Err(shape(row, values.len(), columns)),
        }
    }
    let step = even_step(&times)? / sample_ns;
    let given = Curve::normal(levels.clone(), step).filter(is_pulse).ok_or_else(no_pulse)?;
    let top = levels[given.zero];
    spreads.iter_mut().for_each(|spread| *spread /= top);
    Ok(resampled(&given, &spreads))
}

fn shape(row: usize, found: usize, columns: usize) -> String {
    let wanted = match columns {
        2 => "time_ns, level as in row 1",
        3 => "time_ns, level, spread of 0 or more as in row 1",
        _ => "time_ns, level and, if known, spread",
    };
    format!("row {}: expected {wanted}, found {found} numbers", row + 1)
}

fn no_pulse() -> String {
    "expected levels of a pulse: a highest above 0 that falls to half on both sides, and is at \
     least a sample wide"
        .into()
}

/// Step of evenly rising times, ns.
fn even_step(times: &[f64]) -> Result<f64, String> {
    let step = (times[times.len() - 1] - times[0]) / (times.len() - 1) as f64;
    let even = |pair: &[f64]| (pair[1] - pair[0] - step).abs() <= UNEVEN * step;
    match times.windows(2).position(|pair| !even(pair)) {
        None if step > 0.0 && step.is_finite() => Ok(step),
        place => {
            let row = place.unwrap_or_default() + 2;
            Err(format!("row {row}: expected times that rise in even steps"))
        }
    }
}

fn is_pulse(curve: &Curve) -> bool {
    let low = |side: &[f64]| side.iter().any(|&v| v < 0.5);
    let (before, after) = curve.values.split_at(curve.zero);
    low(before) && low(after) && curve.width >= 1.0 && curve.values.iter().all(|v| v.is_finite())
}

/// The response on the grid of an estimate.
fn resampled(given: &Curve, spreads: &[f64]) -> Response {
    let step = given.width / PER_WIDTH;
    let (first, last) = given.reach();
    let most = MOST_WIDTHS * given.width;
    let (first, last) = (first.max(-most) / step, last.min(most) / step);
    let lags = (first.ceil() as i64..=last.floor() as i64).map(|point| point as f64 * step);
    let spread = |lag: f64| {
        let point = (lag / given.step + given.zero as f64).round().max(0.0) as usize;
        spreads.get(point).copied().unwrap_or(SPREAD)
    };
    let (levels, spreads) = lags.map(|lag| (given.at(lag).0, spread(lag))).unzip();
    // Time 0 is a point of both grids, with level 1: there is a top.
    let curve = Curve::normal(levels, step).unwrap_or_else(|| given.clone());
    Response::new(curve, spreads)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::parse_table;

    fn read(text: &str) -> Result<Response, String> {
        let path = Path::new("response.csv");
        let rows = parse_table(path, text.into()).expect("rows");
        Response::of_points(path, &rows, 0.5).map_err(|error| error.to_string())
    }

    /// 6 ns wide with a bump of 8 % after 20 ns, every half nanosecond.
    fn pulse(row: impl Fn(f64, f64) -> String) -> String {
        let at = |t: f64| libm::exp(-4.0 * 2f64.ln() * (t / 6.0).powi(2));
        let point = |k: i32| (f64::from(k) / 2.0, at(f64::from(k) / 2.0));
        let level = |(t, v): (f64, f64)| row(t + 7.0, 300.0 * (v + 0.08 * at(t - 20.0)));
        (-30..80).map(point).map(level).collect()
    }

    #[test]
    fn a_response_of_a_file_has_its_width_and_bumps_in_samples() {
        let response = read(&pulse(|t, v| format!("{t},{v}\n"))).expect("a response");
        assert!((response.width() - 12.0).abs() < 0.05, "{}", response.width());
        let bump = response.later()[0];
        assert!((bump.lag - 40.0).abs() < 0.6 && (bump.level - 0.08).abs() < 0.002, "{bump:?}");
        assert_eq!((response.echoes, response.spread_at(0.0)), (None, SPREAD));
    }

    #[test]
    fn a_written_response_reads_back_the_same() {
        let text = pulse(|t, v| format!("{t},{v},{}\n", 0.02 * v + 3.0));
        let first = read(&text).expect("a response");
        let again = read(&first.to_csv(0.5)).expect("its own file");
        let apart = first
            .points()
            .zip(again.points())
            .map(|(a, b)| (a.0 - b.0).abs().max((a.1 - b.1).abs()).max((a.2 - b.2).abs()));
        assert!(apart.fold(0.0, f64::max) < 2e-3);
        assert!((first.spread_at(0.0) - 0.03).abs() < 1e-3);
    }

    #[test]
    fn rows_that_are_no_response_are_refused_by_row() {
        let table = [
            ("1,2\n2,3\n".to_owned(), "expected 5 to 100000 rows of a response, found 2"),
            (pulse(|t, v| format!("{t},{v},1,1\n")), "row 1: expected time_ns, level and, if"),
            (pulse(|t, v| format!("{t},{v},-1\n")), "row 1: expected time_ns, level, spread of 0"),
            (pulse(|t, v| if t < 9.9 { format!("{t},{v}\n") } else { format!("{t}\n") }), "row 37"),
            (pulse(|t, v| format!("{},{v}\n", -t)), "row 2: expected times that rise"),
            (pulse(|t, v| format!("{},{v}\n", t * t * t)), "expected times that rise in even"),
            (pulse(|t, _| format!("{t},0\n")), "expected levels of a pulse"),
            (pulse(|t, _| format!("{t},{t}\n")), "expected levels of a pulse"),
            (pulse(|t, v| format!("{},{v}\n", t / 100.0)), "at least a sample wide"),
        ];
        for (text, part) in table {
            let said = read(&text).expect_err(part);
            assert!(said.starts_with("response.csv: ") && said.contains(part), "{said}");
        }
    }
}
