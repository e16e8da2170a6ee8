//! Scan pattern as a list of beams in a CSV file.

use std::collections::HashMap;
use std::fs::File;
use std::io::Read;
use std::path::Path;
use std::sync::Arc;

use crc::{CRC_32_ISCSI, Crc};
use csv::{ByteRecord, ReaderBuilder};
use echoloop_dsp::BeamTable;
use echoloop_dsp::scan_pattern::exact_unit;
use echoloop_files::{one_line, one_line_of};

use echoloop_sensors::pattern::MOST_IN_ALL;

/// Most beams of a list: a scan of an OS1-128 with 1024 columns.
pub const MOST_LISTED: usize = MOST_IN_ALL as usize;

/// Most channels, as many as a grid has rows.
pub const MOST_CHANNELS: u16 = 1024;

/// Most bytes read of a file: more than [`MOST_LISTED`] beams take with every digit of an `f64`.
const MOST_BYTES: u64 = 16 << 20;

/// Columns, in any order; others are ignored.
pub const COLUMNS: [&str; 4] = ["azimuth_deg", "elevation_deg", "time_s", "channel"];

/// Beam in whole units, to which the numbers of a list are rounded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ListedBeam {
    /// Azimuth from ahead towards the left, 10⁻⁶ degrees.
    pub azimuth_udeg: i32,
    /// Elevation upwards, 10⁻⁶ degrees.
    pub elevation_udeg: i32,
    /// Firing time from the beginning of the scan, ns.
    pub time_ns: u64,
    /// Number of laser and receiver, from 0.
    pub channel: u16,
}

/// List of beams, in their order on the link.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BeamList {
    /// Beams.
    pub beams: Vec<ListedBeam>,
    /// Number of beams of the same channel before each beam.
    pub shots: Vec<u32>,
    /// Time of the latest beam, ns, and its line in the file.
    pub latest: (u64, u64),
}

impl BeamList {
    /// Reads a file.
    ///
    /// # Errors
    ///
    /// Message with the line and what is wrong in it.
    pub fn read(path: &Path) -> Result<Self, String> {
        let file = File::open(path).map_err(|error| format!("cannot be read: {error}"))?;
        Self::from_csv(file)
    }

    /// Reads CSV: a header with [`COLUMNS`], then a line for each beam.
    ///
    /// # Errors
    ///
    /// As of [`BeamList::read`].
    pub fn from_csv(from: impl Read) -> Result<Self, String> {
        let bytes = read_most(from)?;
        let mut reader = ReaderBuilder::new().trim(csv::Trim::All).from_reader(&bytes[..]);
        let places = places(reader.byte_headers().map_err(|error| one_line(&error.to_string()))?)?;
        let mut list = Self { beams: Vec::new(), shots: Vec::new(), latest: (0, 0) };
        let (mut seen, mut fired) = (HashMap::new(), HashMap::new());
        let mut lines = Lines { bytes: &bytes, at: 0, line: 1 };
        let mut record = ByteRecord::new();
        loop {
            let line = lines.at(reader.position().byte());
            let in_line = |why: String| format!("line {line}: {why}");
            if !reader.read_byte_record(&mut record).map_err(|error| in_line(message(&error)))? {
                break;
            }
            if list.beams.len() == MOST_LISTED {
                return Err(in_line(format!("more than {MOST_LISTED} beams")));
            }
            let beam = beam(&record, places).map_err(in_line)?;
            if let Some(first) = seen.insert(beam.canonical(), line) {
                let why = format!("the beam of line {first} again (same direction and time)");
                return Err(in_line(why));
            }
            list.add(beam, line, &mut fired);
        }
        if bytes.len() as u64 == MOST_BYTES {
            return Err(format!("more than {} MB", MOST_BYTES >> 20));
        }
        match list.beams.is_empty() {
            true => Err("no beam: expected a line for each below the header".into()),
            false => Ok(list),
        }
    }

    fn add(&mut self, beam: ListedBeam, line: u64, fired: &mut HashMap<u16, u32>) {
        let shot = fired.entry(beam.channel).or_insert(0);
        self.shots.push(*shot);
        *shot += 1;
        if self.beams.is_empty() || beam.time_ns > self.latest.0 {
            self.latest = (beam.time_ns, line);
        }
        self.beams.push(beam);
    }

    /// CSV that reads back as the same list.
    pub fn to_csv(&self) -> String {
        let line = |beam: &ListedBeam| {
            let degrees = |udeg: i32| f64::from(udeg) / 1e6;
            let ListedBeam { azimuth_udeg, elevation_udeg, time_ns, channel } = *beam;
            let (azimuth, elevation) = (degrees(azimuth_udeg), degrees(elevation_udeg));
            format!("{azimuth},{elevation},{},{channel}\n", time_ns as f64 / 1e9)
        };
        COLUMNS.join(",") + "\n" + &self.beams.iter().map(line).collect::<String>()
    }

    /// Channel of each beam.
    pub fn channels(&self) -> Arc<[u16]> {
        self.beams.iter().map(|beam| beam.channel).collect()
    }

    /// Numbers and hash by which sensor and host identify the list.
    pub fn name(&self) -> BeamTable {
        let crc = Crc::<u32>::new(&CRC_32_ISCSI);
        let mut sum = crc.digest();
        for beam in &self.beams {
            sum.update(&beam.azimuth_udeg.to_le_bytes());
            sum.update(&beam.elevation_udeg.to_le_bytes());
            sum.update(&beam.time_ns.to_le_bytes());
            sum.update(&beam.channel.to_le_bytes());
        }
        let channels = self.beams.iter().map(|beam| beam.channel).max().unwrap_or(0) + 1;
        BeamTable { beams: self.beams.len() as u32, channels, hash: sum.finalize() }
    }
}

impl ListedBeam {
    /// Unit vector, sensor frame: x ahead, y left, z up.
    pub(super) fn exact_unit(&self) -> [f64; 3] {
        let [azimuth, elevation] = [self.azimuth_udeg, self.elevation_udeg];
        exact_unit(f64::from(azimuth) / 1e6, f64::from(elevation) / 1e6)
    }

    /// Direction and time in a form that is equal for equal beams: azimuth modulo 360°, and 0
    /// straight up and down.
    fn canonical(&self) -> (i32, i32, u64) {
        let straight_up = self.elevation_udeg.abs() == 90_000_000;
        let azimuth = if straight_up { 0 } else { self.azimuth_udeg.rem_euclid(360_000_000) };
        (azimuth, self.elevation_udeg, self.time_ns)
    }
}

/// First bytes of a file, without a byte order mark.
fn read_most(from: impl Read) -> Result<Vec<u8>, String> {
    let mut bytes = Vec::new();
    let read = from.take(MOST_BYTES).read_to_end(&mut bytes);
    read.map_err(|error| format!("cannot be read: {error}"))?;
    if bytes.starts_with(b"\xef\xbb\xbf") {
        bytes.drain(..3);
    }
    Ok(bytes)
}

/// Line counter of a text: the reader's own count leaves out CR LF.
struct Lines<'a> {
    bytes: &'a [u8],
    at: usize,
    line: u64,
}

impl Lines<'_> {
    /// Line of the record at a byte, past any ends of line.
    fn at(&mut self, byte: u64) -> u64 {
        let is_end = |byte: &u8| matches!(byte, b'\r' | b'\n');
        let from = usize::try_from(byte).unwrap_or(usize::MAX).min(self.bytes.len());
        let to = from + self.bytes[from..].iter().take_while(|byte| is_end(byte)).count();
        let ends = self.bytes[self.at.min(to)..to].iter().filter(|byte| **byte == b'\n').count();
        (self.at, self.line) = (to, self.line + ends as u64);
        self.line
    }
}

/// Index of each of [`COLUMNS`] in a line.
fn places(header: &ByteRecord) -> Result<[usize; 4], String> {
    let names: Vec<String> =
        header.iter().map(|name| String::from_utf8_lossy(name).into_owned()).collect();
    let mut places = [0; 4];
    for (place, wanted) in places.iter_mut().zip(COLUMNS) {
        let mut at = names.iter().enumerate().filter(|(_, name)| *name == wanted);
        let found = at.next().ok_or_else(|| {
            let there = one_line_of(&names.join(","), 80);
            format!("line 1: no column {wanted} in the header '{there}'")
        })?;
        if at.next().is_some() {
            return Err(format!("line 1: two columns {wanted}"));
        }
        *place = found.0;
    }
    Ok(places)
}

fn beam(record: &ByteRecord, places: [usize; 4]) -> Result<ListedBeam, String> {
    let [azimuth, elevation, time, channel] = places.map(|at| record.get(at).unwrap_or_default());
    let udeg = |degrees: f64| (degrees * 1e6).round() as i32;
    let azimuth = number(azimuth, 0, -360.0..=360.0, "-360 to 360")?;
    let elevation = number(elevation, 1, -90.0..=90.0, "-90 to 90")?;
    let time = number(time, 2, 0.0..=10.0, "0 to 10")?;
    let channel = text(channel);
    let channel = channel.parse().ok().filter(|n: &u16| *n < MOST_CHANNELS).ok_or_else(|| {
        format!(
            "channel = {} must be a whole number, 0 to {}",
            one_line(&channel),
            MOST_CHANNELS - 1
        )
    })?;
    Ok(ListedBeam {
        azimuth_udeg: udeg(azimuth),
        elevation_udeg: udeg(elevation),
        time_ns: (time * 1e9).round() as u64,
        channel,
    })
}

fn text(cell: &[u8]) -> String {
    String::from_utf8_lossy(cell).into_owned()
}

fn number(
    cell: &[u8],
    column: usize,
    range: std::ops::RangeInclusive<f64>,
    expected: &str,
) -> Result<f64, String> {
    let text = text(cell);
    let value = text.parse().ok().filter(|value| range.contains(value));
    value.ok_or_else(|| {
        let found = if text.is_empty() { "nothing".into() } else { one_line_of(&text, 24) };
        format!("{} = {found} must be {expected}", COLUMNS[column])
    })
}

/// Message of the reader about a line.
fn message(error: &csv::Error) -> String {
    match error.kind() {
        csv::ErrorKind::UnequalLengths { expected_len, len, .. } => {
            format!("{len} values for {expected_len} columns")
        }
        _ => one_line(&error.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: &str = "azimuth_deg,elevation_deg,time_s,channel\n";

    fn fault(text: &str) -> String {
        BeamList::from_csv(text.as_bytes()).unwrap_err()
    }

    #[test]
    fn a_list_reads_back_as_it_was_written_and_its_columns_may_stand_in_any_order() {
        let text = "\u{feff}channel, time_s,what,\"azimuth_deg\",elevation_deg\r\n\
                    3,0.000000001,x,-12.5,89.999999\r\n\r\n0,0.1,y,360,-90\n\
                    3,0.05,z,0.1,0.2";
        let list = BeamList::from_csv(text.as_bytes()).unwrap();
        assert_eq!(
            list.beams[0],
            ListedBeam {
                azimuth_udeg: -12_500_000,
                elevation_udeg: 89_999_999,
                time_ns: 1,
                channel: 3
            }
        );
        assert_eq!((list.shots.as_slice(), list.latest), (&[0, 0, 1][..], (100_000_000, 4)));
        let again = BeamList::from_csv(list.to_csv().as_bytes()).unwrap();
        assert_eq!((again.beams, again.shots), (list.beams.clone(), list.shots.clone()));
        let name = list.name();
        assert_eq!((name.beams, name.channels), (3, 4));
    }

    /// By hand: 18 bytes of one beam, and the CRC-32C of them.
    #[test]
    fn the_hash_is_that_of_eighteen_bytes_a_beam_in_their_order() {
        let of = |rows: &str| BeamList::from_csv((HEADER.to_owned() + rows).as_bytes()).unwrap();
        let bytes = [64, 66, 15, 0, 192, 189, 240, 255, 160, 134, 1, 0, 0, 0, 0, 0, 2, 0_u8];
        let expected = Crc::<u32>::new(&CRC_32_ISCSI).checksum(&bytes);
        assert_eq!(of("1,-1,0.0001,2\n").name().hash, expected);
        let [a, b] = ["1,1,0,0\n2,2,0,1\n", "2,2,0,1\n1,1,0,0\n"].map(|rows| of(rows).name().hash);
        assert_ne!(a, b);
    }

    #[test]
    fn a_bad_line_is_refused_with_its_number_and_the_reason() {
        for (text, said) in [
            ("", "line 1: no column azimuth_deg in the header ''"),
            (
                "azimuth_deg,elevation_deg,channel\n1,2,3\n",
                "line 1: no column time_s in the header 'azimuth_deg,elevation_deg,channel'",
            ),
            ("channel,azimuth_deg,elevation_deg,time_s,channel\n", "line 1: two columns channel"),
        ] {
            assert_eq!(fault(text), said);
        }
        for (rows, said) in [
            ("", "no beam: expected a line for each below the header"),
            ("1,2,0,0\nNaN,2,0,0\n", "line 3: azimuth_deg = NaN must be -360 to 360"),
            ("inf,2,0,0\n", "line 2: azimuth_deg = inf must be -360 to 360"),
            ("1,90.1,0,0\n", "line 2: elevation_deg = 90.1 must be -90 to 90"),
            ("1,2,-0.1,0\n", "line 2: time_s = -0.1 must be 0 to 10"),
            ("1,2,,0\n", "line 2: time_s = nothing must be 0 to 10"),
            ("1,2,0,1024\n", "line 2: channel = 1024 must be a whole number, 0 to 1023"),
            ("1,2,0,1.5\n", "line 2: channel = 1.5 must be a whole number, 0 to 1023"),
            ("1,2,0\n", "line 2: 3 values for 4 columns"),
            ("1,2,0,0\r\n\r\nx,2,0,0\r\n", "line 4: azimuth_deg = x must be -360 to 360"),
            (
                "1,2,0,0\n\n1,2,0.5,0\n1,2,0,7\n",
                "line 5: the beam of line 2 again (same direction and time)",
            ),
            (
                "-10,2,0,0\n350,2,0,0\n",
                "line 3: the beam of line 2 again (same direction and time)",
            ),
            (
                "-10,90,0,0\n30,90,0,0\n",
                "line 3: the beam of line 2 again (same direction and time)",
            ),
        ] {
            assert_eq!(fault(&(HEADER.to_owned() + rows)), said, "{rows}");
        }
    }

    #[test]
    fn a_list_of_the_most_beams_is_read_and_a_longer_one_is_not_read_to_its_end() {
        use std::cell::Cell;
        /// Endless rows, and a count of the bytes read.
        struct Endless<'a>(u64, Vec<u8>, &'a Cell<usize>);
        impl Read for Endless<'_> {
            fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
                while self.1.len() < buffer.len() {
                    self.0 += 1;
                    self.1.extend(format!("1,2,{},0\n", self.0 as f64 * 1e-8).into_bytes());
                }
                let rest = self.1.split_off(buffer.len());
                buffer.copy_from_slice(&std::mem::replace(&mut self.1, rest));
                self.2.set(self.2.get() + buffer.len());
                Ok(buffer.len())
            }
        }
        let read = Cell::new(0);
        let rows = Endless(0, HEADER.as_bytes().to_vec(), &read);
        let said = BeamList::from_csv(rows).unwrap_err();
        assert_eq!(said, "line 131074: more than 131072 beams");
        assert!(read.get() <= 16 << 20, "{} bytes were read", read.get());
        let rows: String =
            (0..MOST_LISTED).map(|n| format!("1,2,{},0\n", n as f64 / 1e6)).collect();
        let list = BeamList::from_csv((HEADER.to_owned() + &rows).as_bytes()).unwrap();
        assert_eq!(list.name().beams, 131_072);
        let blank = std::io::repeat(b' ');
        assert!(BeamList::from_csv(HEADER.as_bytes().chain(blank)).is_err());
    }
}
