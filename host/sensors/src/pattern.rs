//! A sensor's scan pattern as it is told: what is too large, and what a message says of it.

use echoloop_dsp::{BeamTable, Grid, Rosette, ScanPattern};
use serde_json::Value;

/// Most beams along azimuth and along elevation, of a sensor and of a configuration: scans of more
/// are not what memory is made for.
pub const MOST_BEAMS: [u16; 2] = [4096, 1024];

/// Most beams of a scan that has no columns and rows.
pub const MOST_IN_ALL: u32 = 131_072;

/// Whether there is memory for a scan.
pub fn is_possible(pattern: &ScanPattern) -> bool {
    let [columns, rows] = MOST_BEAMS.map(|most| 1..=most);
    match pattern {
        ScanPattern::Grid(grid) | ScanPattern::Raster(grid) => {
            columns.contains(&grid.columns) && rows.contains(&grid.rows)
        }
        ScanPattern::Spinning(head) => columns.contains(&head.columns),
        ScanPattern::Rosette(_) | ScanPattern::Table(_) => {
            (1..=MOST_IN_ALL).contains(&pattern.beams())
        }
    }
}

/// How many beams, as a message says it.
pub fn size(pattern: &ScanPattern) -> String {
    match pattern {
        ScanPattern::Grid(grid) | ScanPattern::Raster(grid) => {
            format!("{} × {}", grid.columns, grid.rows)
        }
        ScanPattern::Spinning(head) => format!("{} × {}", head.columns, head.lasers()),
        ScanPattern::Rosette(_) | ScanPattern::Table(_) => pattern.beams().to_string(),
    }
}

/// A pattern as a document has it: its fields, and which kind it is.
pub fn document(pattern: &ScanPattern) -> Value {
    let kind = match pattern {
        ScanPattern::Grid(_) => "grid",
        ScanPattern::Raster(_) => "raster",
        ScanPattern::Spinning(_) => "spinning",
        ScanPattern::Rosette(_) => "rosette",
        ScanPattern::Table(_) => "table",
    };
    let tagged = serde_json::to_value(pattern).unwrap_or_default();
    let fields = tagged.as_object().and_then(|tagged| tagged.values().next());
    let mut fields = fields.and_then(Value::as_object).cloned().unwrap_or_default();
    fields.insert("kind".into(), kind.into());
    Value::Object(fields)
}

/// A pattern in a few words.
pub fn described(pattern: &ScanPattern) -> String {
    let grid = |grid: &Grid, how: &str| {
        let [azimuth, elevation] =
            [grid.azimuth_cdeg, grid.elevation_cdeg].map(|c| f64::from(c) / 100.0);
        format!("{} × {} over {azimuth}° × {elevation}°{how}", grid.columns, grid.rows)
    };
    match pattern {
        ScanPattern::Grid(g) => grid(g, ""),
        ScanPattern::Raster(g) => grid(g, ", line by line"),
        ScanPattern::Spinning(head) => {
            format!("{} × {} of a {:?}", head.columns, head.lasers(), head.model)
        }
        ScanPattern::Rosette(Rosette {
            beams,
            rate_hz,
            rotors_rpm: [a, b],
            bends_cdeg: [c, d],
        }) => {
            format!("{beams} of a rosette ({rate_hz} Hz, {a} and {b} rpm, {c} and {d} × 0.01°)")
        }
        ScanPattern::Table(BeamTable { beams, channels, hash }) => {
            format!("{beams} of a table ({channels} channels, hash {hash:#010x})")
        }
    }
}
