//! Checksums against damage and mix-ups, not against forgery: CRC-64/XZ.

use std::fmt::{Display, Formatter, Result as Format};
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use crc::{CRC_64_XZ, Crc, Digest, Table};

static CRC: Crc<u64, Table<16>> = Crc::<u64, Table<16>>::new(&CRC_64_XZ);

/// A checksum: 16 hexadecimal digits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Checksum(u64);

impl Display for Checksum {
    fn fmt(&self, f: &mut Formatter<'_>) -> Format {
        write!(f, "{:016x}", self.0)
    }
}

/// Checksum of bytes that arrive in pieces.
pub struct Running(Digest<'static, u64, Table<16>>);

impl Running {
    /// Adds bytes.
    pub fn add(&mut self, bytes: &[u8]) {
        self.0.update(bytes);
    }

    /// Checksum of all bytes added.
    pub fn end(self) -> Checksum {
        Checksum(self.0.finalize())
    }
}

impl Default for Running {
    fn default() -> Self {
        Self(CRC.digest())
    }
}

impl Checksum {
    /// Bytes of the checksum, little endian.
    pub fn to_le_bytes(self) -> [u8; 8] {
        self.0.to_le_bytes()
    }

    /// Checksum of several pieces, one after the other.
    pub fn of(pieces: &[&[u8]]) -> Self {
        let mut running = Running::default();
        pieces.iter().for_each(|piece| running.add(piece));
        running.end()
    }

    /// Checksum of the content of a file.
    ///
    /// # Errors
    ///
    /// Errors of reading; [`io::ErrorKind::InvalidInput`] for anything but a regular file: a pipe
    /// or device may never end.
    pub fn of_file(path: &Path) -> io::Result<Self> {
        if !path.metadata()?.is_file() {
            return Err(io::ErrorKind::InvalidInput.into());
        }
        let (mut file, mut chunk) = (File::open(path)?, vec![0; 1 << 16]);
        let mut running = Running::default();
        loop {
            match file.read(&mut chunk)? {
                0 => return Ok(running.end()),
                length => running.add(&chunk[..length]),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_and_files_have_the_checksum_of_the_catalogue() {
        assert_eq!(Checksum::of(&[b"123456789"]).to_string(), "995dc9bbdf1939fa");
        assert_eq!(Checksum::of(&[b"12345", b"6789"]), Checksum::of(&[b"123456789"]));
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        let content = vec![7; 200_000];
        std::fs::write(&path, &content).unwrap();
        assert_eq!(Checksum::of_file(&path).unwrap(), Checksum::of(&[&content]));
        assert!(Checksum::of_file(folder.path()).is_err());
    }
}
