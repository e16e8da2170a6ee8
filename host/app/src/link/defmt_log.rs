//! The sensor's log: defmt's frames, which say only which message of the image, made readable with
//! the image.

use defmt_decoder::{DecodeError, Table};
use thiserror::Error;

/// Why a log cannot be read.
#[derive(Debug, Error)]
pub enum LogError {
    /// The image is no ELF file, or of another version of defmt.
    #[error("the image's log table cannot be read: {0}")]
    Image(String),
    /// It says nothing.
    #[error("the image has no log table: it was built without defmt")]
    Silent,
}

/// The lines of a log: number, level, text. Frames that are broken, or cut off at the end, are left
/// out.
///
/// # Errors
///
/// [`LogError`] when the image is not one that logs.
pub fn decode(elf: &[u8], frames: &[u8]) -> Result<Vec<String>, LogError> {
    let table = Table::parse(elf)
        .map_err(|error| LogError::Image(error.to_string()))?
        .ok_or(LogError::Silent)?;
    let mut decoder = table.new_stream_decoder();
    decoder.received(frames);
    let mut lines = Vec::new();
    loop {
        match decoder.decode() {
            Ok(frame) => {
                let number = frame.display_timestamp().map(|t| t.to_string()).unwrap_or_default();
                let level = frame.level().map_or("println", |level| level.as_str());
                lines.push(format!("{number:>6} {level:<5} {}", frame.display_message()));
            }
            Err(DecodeError::Malformed) if table.encoding().can_recover() => {}
            Err(_) => return Ok(lines),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_image_is_refused() {
        assert!(matches!(decode(b"not an ELF file", &[]), Err(LogError::Image(_))));
    }
}
