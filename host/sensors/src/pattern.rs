//! Scan pattern of a sensor: the largest that is accepted, and its form in messages and documents.

use echoloop_dsp::ScanPattern;
use serde_json::Value;

/// Most columns and rows of a scan, so that its echoes fit into memory.
pub const MOST_BEAMS: [u16; 2] = [4096, 1024];

/// Most beams of a scan that has no columns and rows.
pub const MOST_IN_ALL: u32 = 131_072;

/// True when a scan has beams, and no more than fit into memory.
pub fn is_possible(pattern: &ScanPattern) -> bool {
    match pattern.columns_and_rows() {
        Some(size) => size.iter().zip(MOST_BEAMS).all(|(count, most)| (1..=most).contains(count)),
        None => (1..=MOST_IN_ALL).contains(&pattern.beams()),
    }
}

/// Number of beams in a message: `192 × 64`, or `10000` without columns and rows.
pub fn size(pattern: &ScanPattern) -> String {
    match pattern.columns_and_rows() {
        Some([columns, rows]) => format!("{columns} × {rows}"),
        None => pattern.beams().to_string(),
    }
}

/// Fields of a pattern as JSON, and its `kind`: `grid`, `raster` and so on.
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
