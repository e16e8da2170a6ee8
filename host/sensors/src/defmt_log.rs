//! Log of a sensor: defmt's frames, which hold the index of a message only, decoded with the image.

use std::fs::{File, OpenOptions};
use std::io::{self, Write};
use std::path::Path;

use defmt_decoder::{DecodeError, Frame, StreamDecoder, Table};
use echoloop_files::printable;
use thiserror::Error;

/// Reason that a log cannot be read.
#[derive(Debug, Error)]
pub enum LogError {
    /// Image that is no ELF file, or of another version of defmt.
    #[error("the image's log table cannot be read: {0}")]
    Image(String),
    /// Image without a log table.
    #[error("the image has no log table: it was built without defmt")]
    Silent,
}

/// Messages of an image.
pub struct Messages(Table);

impl Messages {
    /// Messages of an ELF file.
    ///
    /// # Errors
    ///
    /// [`LogError`] when the image has no log table.
    pub fn from_elf(elf: &[u8]) -> Result<Self, LogError> {
        let table = Table::parse(elf).map_err(|error| LogError::Image(error.to_string()))?;
        table.map(Self).ok_or(LogError::Silent)
    }

    /// Reader of a log, which may begin anywhere in it.
    pub fn reader(&self) -> LogReader<'_> {
        let (table, stream) = (&self.0, self.0.new_stream_decoder());
        LogReader { table, stream, unfinished: 0, broken: 0 }
    }
}

/// Most bytes of a frame, a hundred times the longest: a line without an end is no log.
const LONGEST: usize = 16 << 10;

/// Decoder of a log into lines, as bytes arrive.
pub struct LogReader<'a> {
    table: &'a Table,
    stream: Box<dyn StreamDecoder + Send + Sync + 'a>,
    unfinished: usize,
    broken: usize,
}

impl LogReader<'_> {
    /// Lines that these bytes complete: number, level, text. Broken frames are left out.
    pub fn read(&mut self, bytes: &[u8]) -> Vec<String> {
        self.bound(bytes);
        self.stream.received(bytes);
        let mut lines = Vec::new();
        loop {
            match self.stream.decode() {
                Ok(frame) => lines.push(line(&frame)),
                Err(DecodeError::Malformed) if self.table.encoding().can_recover() => {
                    self.broken += 1;
                }
                Err(_) => return lines,
            }
        }
    }

    /// Number of broken frames. The first is one when the log was joined in the middle.
    pub fn broken(&self) -> usize {
        self.broken
    }

    /// Drops an unfinished frame beyond [`LONGEST`], so that it does not fill the memory.
    fn bound(&mut self, bytes: &[u8]) {
        self.unfinished = match bytes.iter().rev().position(|&byte| byte == 0) {
            Some(after) => after,
            None => self.unfinished + bytes.len(),
        };
        if self.unfinished > LONGEST {
            self.stream = self.table.new_stream_decoder();
            (self.unfinished, self.broken) = (0, self.broken + 1);
        }
    }
}

fn line(frame: &Frame<'_>) -> String {
    let number = frame.display_timestamp().map(|t| t.to_string()).unwrap_or_default();
    let level = frame.level().map_or("println", |level| level.as_str());
    format!("{number:>6} {level:<5} {}", frame.display_message())
}

/// Lines of a whole log.
///
/// # Errors
///
/// [`LogError`] when the image has no log table.
pub fn decode(elf: &[u8], frames: &[u8]) -> Result<Vec<String>, LogError> {
    Ok(Messages::from_elf(elf)?.reader().read(frames))
}

/// Creates an empty file for the lines of a log.
///
/// # Errors
///
/// Message that it cannot be created, with the reason.
pub fn begin_file(to: &Path) -> Result<(), String> {
    if to == Path::new("-") {
        return Ok(());
    }
    let made = File::create(to).map(drop);
    made.map_err(|error| format!("--sensor-log {}: {error}", to.display()))
}

/// Appends lines of a sensor's log to a file in one write, so that sensors do not mix theirs. `-`
/// is standard error.
///
/// # Errors
///
/// When it cannot be written.
pub(crate) fn write_lines(to: &Path, sensor: usize, lines: &[String]) -> io::Result<()> {
    let one = |line: &String| format!("sensor {sensor} {}\n", printable(line).replace('\n', " "));
    let text: String = lines.iter().map(one).collect();
    match to.to_str() {
        _ if text.is_empty() => Ok(()),
        Some("-") => io::stderr().write_all(text.as_bytes()),
        _ => OpenOptions::new().create(true).append(true).open(to)?.write_all(text.as_bytes()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_is_no_image_is_refused() {
        assert!(matches!(decode(b"not an ELF file", &[]), Err(LogError::Image(_))));
    }
}
