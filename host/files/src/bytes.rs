//! Reading a whole file within a bound.

use std::fs::File;
use std::io::{Error, ErrorKind, Read, Result};
use std::path::Path;

/// Most bytes of a file written by hand: a configuration, a pose, a candidate. Its TOML table takes
/// up to 100 times as much memory.
pub const MOST_TEXT: u64 = 512 << 10;

/// Most bytes read from a pipe, whose size is unknown.
const MOST_PIPED: u64 = 4 << 30;

/// Most bytes of a line, for readers that list the words of a line before they read them.
const MOST_LINE: usize = 4 << 20;

/// Refuses text with a line of more than 4 MB.
///
/// # Errors
///
/// A message, when there is such a line.
pub fn check_lines(text: &[u8]) -> std::result::Result<(), String> {
    match text.split(|&byte| byte == b'\n').any(|line| line.len() > MOST_LINE) {
        true => Err(format!("a line is longer than {} MB", MOST_LINE >> 20)),
        false => Ok(()),
    }
}

/// Reads a file of data: a regular file whole, a pipe up to 4 GB, a device up to [`MOST_TEXT`],
/// because some devices never end.
///
/// # Errors
///
/// The system's error; [`ErrorKind::FileTooLarge`] when there is more.
pub fn read_data(path: &Path) -> Result<Vec<u8>> {
    let mut file = File::open(path)?;
    let most = match file.metadata()?.file_type() {
        kind if kind.is_file() => {
            let mut bytes = Vec::new();
            file.read_to_end(&mut bytes)?;
            return Ok(bytes);
        }
        kind if is_pipe(kind) => MOST_PIPED,
        _ => MOST_TEXT,
    };
    read_most(file, most)
}

/// Reads UTF-8 text of at most `most` bytes, usually [`MOST_TEXT`].
///
/// # Errors
///
/// The system's error; [`ErrorKind::FileTooLarge`] when there is more;
/// [`ErrorKind::InvalidData`] when it is not UTF-8.
pub fn read_text(path: &Path, most: u64) -> Result<String> {
    text_from(File::open(path)?, most)
}

/// [`read_text`] from an open reader, such as standard input.
pub fn text_from(from: impl Read, most: u64) -> Result<String> {
    let bytes = read_most(from, most)?;
    let not_text = |error: std::string::FromUtf8Error| {
        let at = error.utf8_error().valid_up_to();
        Error::new(ErrorKind::InvalidData, format!("expected text in UTF-8, byte {at} is not"))
    };
    String::from_utf8(bytes).map_err(not_text)
}

fn read_most(from: impl Read, most: u64) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    from.take(most + 1).read_to_end(&mut bytes)?;
    match bytes.len() as u64 > most {
        true => Err(Error::new(
            ErrorKind::FileTooLarge,
            format!("it has more than {} kB, the most that is read of it", most >> 10),
        )),
        false => Ok(bytes),
    }
}

/// The folder of a file; of a bare file name, the current folder.
#[must_use]
pub fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

#[cfg(unix)]
fn is_pipe(kind: std::fs::FileType) -> bool {
    use std::os::unix::fs::FileTypeExt;
    kind.is_fifo() || kind.is_socket()
}

#[cfg(not(unix))]
fn is_pipe(_: std::fs::FileType) -> bool {
    true
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn a_file_comes_whole_and_a_folder_not_at_all() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        std::fs::write(&path, "ä text").unwrap();
        assert_eq!(read_data(&path).unwrap(), "ä text".as_bytes());
        assert_eq!(read_text(&path, MOST_TEXT).unwrap(), "ä text");
        assert!(read_data(folder.path()).is_err() && read_text(folder.path(), MOST_TEXT).is_err());
    }

    #[test]
    fn text_that_is_too_long_or_no_text_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        std::fs::write(&path, vec![b' '; MOST_TEXT as usize + 1]).unwrap();
        assert_eq!(read_text(&path, MOST_TEXT).unwrap_err().kind(), ErrorKind::FileTooLarge);
        assert_eq!(read_data(&path).unwrap().len() as u64, MOST_TEXT + 1);
        std::fs::write(&path, b"ab\xff").unwrap();
        assert!(read_text(&path, MOST_TEXT).unwrap_err().to_string().contains("byte 2"));
    }

    #[test]
    fn a_bare_name_lies_in_the_current_folder() {
        for (path, folder) in [("a", "."), ("b/a", "b"), ("/a", "/"), ("./a", ".")] {
            assert_eq!(folder_of(Path::new(path)), Path::new(folder), "{path}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn a_device_without_an_end_is_given_up() {
        let zeros = Path::new("/dev/zero");
        for found in [read_data(zeros).map(drop), read_text(zeros, MOST_TEXT).map(drop)] {
            assert_eq!(found.unwrap_err().kind(), ErrorKind::FileTooLarge);
        }
        assert!(read_data(Path::new("/dev/null")).unwrap().is_empty());
    }
}
