//! The application: takes bytes off the link, answers every whole frame.

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

/// How far ahead of the newest command the next may be numbered. A host counts on when it gives a
/// command up; after so many it has to say hello.
pub const MAX_SKIPPED: u16 = 256;

/// How far behind the newest command a hello counts as overtaken: were it taken, it would end a
/// trial, and other overtaken commands could act after it. A new host that begins there by chance
/// is told so.
pub const MAX_LATE_HELLO: u16 = 64;

/// The link is gone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LinkLost;

/// The sensor.
pub struct App<B> {
    pub(crate) board: B,
    pub(crate) session: Session,
    decoder: Decoder,
    /// Of the newest command taken; `None` until there is one.
    pub(crate) sequence: Option<u16>,
    /// `None` until the active settings were needed.
    pub(crate) configured: Option<Configured>,
    /// The scan that the front end knows of.
    pub(crate) frame: Option<(u32, Option<Noise>)>,
    /// The waveform that is coming over the link.
    pub(crate) intake: Option<Intake>,
    pub(crate) stopwatch: Stopwatch,
    pub(crate) scratch: Scratch,
    pub(crate) codes: [u16; MAX_CODES],
    pub(crate) transmit: [u8; MAX_FRAME],
}

impl<B: Board> App<B> {
    /// A sensor with the settings that were saved, or the defaults; the front end is set when it is
    /// first needed.
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

    /// The board, for those who put something on it.
    pub fn board_mut(&mut self) -> &mut B {
        &mut self.board
    }

    /// The conversation's state.
    pub fn session(&self) -> &Session {
        &self.session
    }

    /// Takes what has arrived and answers every whole frame. Returns when nothing is left to read.
    /// Feeds the watchdog at every turn, even when nothing has arrived.
    ///
    /// # Errors
    ///
    /// [`LinkLost`] when the link cannot be read or written; the sensor's state is as before the
    /// frame at hand.
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

    // Its own frame, as has `answer`: inlined into `main`, whose frame holds the whole sensor,
    // every spilled value lies beyond the reach of a short load, and the image grows by 10 to 20 %.
    #[inline(never)]
    fn take_byte(&mut self, byte: u8) -> Result<(), LinkLost> {
        match self.decoder.push(byte) {
            None => Ok(()),
            // A copy: its waveforms are read while all else here is written.
            Some(Ok(frame)) => match Vec::from_slice(frame) {
                Ok(frame) => self.take_frame(frame),
                Err(_) => Ok(()), // a decoder's frames fit
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
