//! A sensor's scan pattern as it is told: what is too large, and what a message says of it.

use echoloop_dsp::ScanPattern;
use serde_json::Value;

/// Most beams along azimuth and along elevation, of a sensor and of a configuration: scans of more
/// are not what memory is made for.
pub const MOST_BEAMS: [u16; 2] = [4096, 1024];

/// Most beams of a scan that has no columns and rows.
pub const MOST_IN_ALL: u32 = 131_072;

/// Whether there is memory for a scan.
pub fn is_possible(pattern: &ScanPattern) -> bool {
    match pattern.columns_and_rows() {
        Some(counts) => {
            counts.into_iter().zip(MOST_BEAMS).all(|(count, most)| (1..=most).contains(&count))
        }
        None => (1..=MOST_IN_ALL).contains(&pattern.beams()),
    }
}

/// How many beams, as a message says it.
pub fn size(pattern: &ScanPattern) -> String {
    match pattern.columns_and_rows() {
        Some([columns, rows]) => format!("{columns} × {rows}"),
        None => pattern.beams().to_string(),
    }
}

/// A pattern as a document has it: its fields, and which kind it is.
pub fn document(pattern: &ScanPattern) -> Value {
    // serde has the variant's name as the only key, and its fields as the value.
    let tagged = serde_json::to_value(pattern).unwrap_or_default();
    let Some((kind, fields)) = tagged.as_object().and_then(|tagged| tagged.iter().next()) else {
        return tagged;
    };
    let mut fields = fields.as_object().cloned().unwrap_or_default();
    fields.insert("kind".into(), kind.to_lowercase().into());
    Value::Object(fields)
}

/// A pattern in a few words.
pub fn described(pattern: &ScanPattern) -> String {
    pattern.to_string()
}
