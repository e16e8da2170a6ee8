//! Size of a scan on the link, bits.

use echoloop_dsp::Echoes;
use echoloop_link::{BEAMS_PER_REPORT, Command, MAX_FRAME, Message, Report, encode};

/// Bits of a scan both ways, from the delimiter before the first command to that after the last
/// report: the frames of [`Client::scan`](super::client::Client::scan) on a line without loss.
///
/// The frames are encoded as scan 1 of generation 1. Later ones have longer numbers and other COBS
/// bytes, a difference of a thousandth.
pub fn scan_bits(scan: &[Echoes], settings_hash: u32) -> u64 {
    let beams_of = |(i, beams): (usize, &[Echoes])| {
        let first = (i * BEAMS_PER_REPORT) as u32;
        let command = Command::ReadBeams { frame: 1, first, count: beams.len() as u16 };
        let report = Report::Beams {
            frame: 1,
            first,
            generation: 1,
            hash: settings_hash,
            beams: beams.iter().cloned().collect(),
        };
        bytes(i as u16, &command) + bytes(i as u16, &report)
    };
    8 * scan.chunks(BEAMS_PER_REPORT).enumerate().map(beams_of).sum::<u64>()
}

fn bytes(sequence: u16, message: &impl Message) -> u64 {
    let mut frame = [0; MAX_FRAME];
    // Every message of a scan fits: tests/tests/link/wire.rs fills the fullest.
    encode(sequence, message, &mut frame).map_or(0, |frame| frame.len() as u64)
}
