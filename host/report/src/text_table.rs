//! Tables as text: errors of pairs as CSV, rows in aligned columns.

use serde::Serialize;

use echoloop_closed_loop::evaluation::objective::PairError;
use echoloop_closed_loop::evaluation::summary::Summary;

#[derive(Serialize)]
struct Row<'a> {
    set: &'a str,
    pair: usize,
    translation_m: f64,
    rotation_deg: f64,
    frobenius: f64,
    target_points: usize,
    source_points: usize,
    iterations: usize,
    stop: &'a str,
}

impl<'a> Row<'a> {
    fn new(set: &'a str, error: &'a PairError) -> Self {
        let PairError { pair, translation_m, rotation_deg, frobenius, points, stop, iterations } =
            error;
        Self {
            set,
            pair: *pair,
            translation_m: *translation_m,
            rotation_deg: *rotation_deg,
            frobenius: *frobenius,
            target_points: points[0],
            source_points: points[1],
            iterations: *iterations,
            stop,
        }
    }
}

/// CSV of named sets, a row for each pair; numbers read back as they are.
///
/// # Errors
///
/// [`csv::Error`].
pub fn pair_errors_csv<'a>(
    sets: impl IntoIterator<Item = (&'a str, &'a Summary)>,
) -> Result<String, csv::Error> {
    let mut table = csv::Writer::from_writer(Vec::new());
    for (set, summary) in sets {
        for error in &summary.errors {
            table.serialize(Row::new(set, error))?;
        }
    }
    finished(table)
}

/// Text of a table that is written.
pub(super) fn finished(table: csv::Writer<Vec<u8>>) -> Result<String, csv::Error> {
    let bytes = table.into_inner().map_err(|error| error.into_error())?;
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

/// Rows in columns, the first aligned to the left, the others to the right.
pub fn aligned(rows: &[Vec<String>]) -> String {
    let columns = rows.first().map_or(0, Vec::len);
    let width = |i: usize| rows.iter().map(|row| row[i].chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..columns).map(width).collect();
    let line = |row: &Vec<String>| {
        let cells = row.iter().zip(&widths).enumerate().map(|(i, (cell, &width))| match i {
            0 => format!("{cell:<width$}"),
            _ => format!("  {cell:>width$}"),
        });
        cells.collect::<String>().trim_end().to_owned() + "\n"
    };
    rows.iter().map(line).collect()
}
