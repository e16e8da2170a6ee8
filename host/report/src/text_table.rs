//! Tables as text: errors of pairs as CSV, rows in aligned columns.

use echoloop_closed_loop::evaluation::objective::PairError;
use echoloop_closed_loop::evaluation::summary::Summary;

/// CSV of named sets, a row for each pair; numbers read back as they are.
///
/// # Errors
///
/// [`csv::Error`].
pub fn pair_errors_csv<'a>(
    sets: impl IntoIterator<Item = (&'a str, &'a Summary)>,
) -> Result<String, csv::Error> {
    let rows = sets.into_iter().flat_map(|(set, summary)| {
        summary.errors.iter().map(move |error| (set, error.pair.to_string(), error))
    });
    pair_rows(rows)
}

/// [`pair_errors_csv`] of pairs that have names, one for each error.
///
/// # Errors
///
/// [`csv::Error`].
pub fn named_pair_errors_csv(
    set: &str,
    names: &[String],
    summary: &Summary,
) -> Result<String, csv::Error> {
    let named = names.iter().zip(&summary.errors);
    pair_rows(named.map(|(name, error)| (set, name.clone(), error)))
}

fn pair_rows<'a>(
    rows: impl Iterator<Item = (&'a str, String, &'a PairError)>,
) -> Result<String, csv::Error> {
    let mut table = csv::Writer::from_writer(Vec::new());
    table.write_record([
        "set",
        "pair",
        "translation_m",
        "rotation_deg",
        "frobenius",
        "target_points",
        "source_points",
        "iterations",
        "stop",
    ])?;
    for (set, pair, e) in rows {
        let numbers = (pair, e.translation_m, e.rotation_deg, e.frobenius);
        table.serialize((set, numbers, e.points, e.iterations, &e.stop))?;
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
