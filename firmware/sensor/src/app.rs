//! Application: takes bytes from the link and answers every whole frame.

use echoloop_dsp::{MAX_CODES, Scratch, Settings};
use echoloop_link::{Command, Decoder, MAX_FRAME, Noise, Session, decode};
use embedded_io::{Read, ReadReady};
use heapless::Vec;

use crate::board::Board;
use crate::state::{Configured, Intake};
use crate::stopwatch::Stopwatch;
use crate::store;

/// Name and version of this firmware.
pub const BUILD: &str = concat!("echoloop-sensor ", env!("CARGO_PKG_VERSION"));

/// Most numbers by which a command may be ahead of the newest. A host that gives a command up goes
/// on counting; beyond this it has to say hello.
pub const MAX_SKIPPED: u16 = 256;

/// Most numbers by which a hello may be behind the newest command and still be refused as
/// overtaken. If it were accepted, it would end a trial, and other overtaken commands could act
/// after it. A new host that begins there by chance gets an answer that says so.
pub const MAX_LATE_HELLO: u16 = 64;

/// Error: the link cannot be read or written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LinkLost;

/// Sensor: a board, and the state of conversation and DSP.
pub struct App<B> {
    pub(crate) board: B,
    pub(crate) session: Session,
    decoder: Decoder,
    /// Number of the newest command taken; `None` until there is one.
    pub(crate) sequence: Option<u16>,
    /// DSP for the active settings; `None` until it is needed.
    pub(crate) configured: Option<Configured>,
    /// Scan that the front end has been told of.
    pub(crate) frame: Option<(u32, Option<Noise>)>,
    /// Waveform that is coming over the link.
    pub(crate) intake: Option<Intake>,
    pub(crate) stopwatch: Stopwatch,
    pub(crate) scratch: Scratch,
    pub(crate) codes: [u16; MAX_CODES],
    pub(crate) transmit: [u8; MAX_FRAME],
}

impl<B: Board> App<B> {
    /// Sensor with the saved settings, or the defaults. The front end is set when it is first
    /// needed.
    pub fn new(mut board: B) -> Self {
        let hardware = board.hardware();
        let settings = store::load(board.store(), &hardware)
            .map_or_else(Settings::default, |saved| saved.settings);
        let mut session = Session::new(hardware, board.pattern(), BUILD, settings);
        session.counters.restarts = board.restarts();
        Self {
            board,
            session,
            decoder: Decoder::new(),
            sequence: None,
            configured: None,
            frame: None,
            intake: None,
            stopwatch: Stopwatch::default(),
            scratch: Scratch::new(),
            codes: [0; MAX_CODES],
            transmit: [0; MAX_FRAME],
        }
    }

    /// Board of the sensor.
    pub fn board_mut(&mut self) -> &mut B {
        &mut self.board
    }

    /// State of the conversation.
    pub fn session(&self) -> &Session {
        &self.session
    }

    /// Takes the bytes that have arrived and answers every whole frame. Returns when no byte is
    /// left to read. Feeds the watchdog on every turn, even when no byte has arrived.
    ///
    /// # Errors
    ///
    /// [`LinkLost`] when the link cannot be read or written; the sensor's state is as before the
    /// current frame.
    pub fn poll(&mut self) -> Result<(), LinkLost> {
        let mut chunk = [0; 64];
        self.board.feed_watchdog();
        while self.board.link().read_ready().map_err(|_| LinkLost)? {
            let length = self.board.link().read(&mut chunk).map_err(|_| LinkLost)?;
            if length == 0 {
                return Ok(());
            }
            for &byte in chunk.iter().take(length) {
                self.take_byte(byte)?;
            }
            self.board.feed_watchdog();
        }
        Ok(())
    }

    // Not inlined, like `answer`. Inlined into `main`, whose stack frame holds the whole sensor,
    // every spilled value would lie beyond the reach of a short load, and the image would grow by
    // 10 to 20 %.
    #[inline(never)]
    fn take_byte(&mut self, byte: u8) -> Result<(), LinkLost> {
        match self.decoder.push(byte) {
            None => Ok(()),
            // A copy: the waveforms in the frame are read while the rest of `self` is written.
            Some(Ok(frame)) => match Vec::from_slice(frame) {
                Ok(frame) => self.take_frame(frame),
                Err(_) => Ok(()), // never: a decoder's frames fit
            },
            Some(Err(error)) => self.take_bad_frame(error),
        }
    }

    fn take_frame(&mut self, mut frame: Vec<u8, MAX_FRAME>) -> Result<(), LinkLost> {
        match decode::<Command<'_>>(&mut frame) {
            Ok((sequence, command)) => self.take(sequence, command),
            Err(error) => self.take_bad_frame(error),
        }
    }
}
