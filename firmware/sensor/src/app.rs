//! The application: takes commands, drives the front end, runs the DSP, answers.

use echoloop_dsp::{Echoes, MAX_CODES, Pipeline, Scratch, Settings};
use echoloop_link::{
    Answer, BEAMS_PER_REPORT, Command, Decoder, FrameError, Greeting, MAX_FRAME, Nack, Report,
    Session,
};
use embedded_io::{Read, ReadReady, Write};
use heapless::Vec;

use crate::afe::{self, AfeError};
use crate::board::Board;
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

/// What one set of settings turned into, and whose it is.
struct Configured {
    settings: Settings,
    pipeline: Pipeline,
}

/// The sensor.
pub struct App<B> {
    board: B,
    session: Session,
    decoder: Decoder,
    /// Of the newest command taken; `None` until there is one.
    sequence: Option<u16>,
    /// `None` until the front end has taken the active settings.
    configured: Option<Configured>,
    frame: Option<u32>,
    scratch: Scratch,
    codes: [u16; MAX_CODES],
    transmit: [u8; MAX_FRAME],
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
        let Some(frame) = self.decoder.push(byte) else { return Ok(()) };
        match frame.and_then(echoloop_link::decode::<Command>) {
            Ok((sequence, command)) => {
                if let Some(newest) = self.overtaken(sequence, &command) {
                    return self.take_stale(sequence, &command, newest);
                }
                self.sequence = Some(sequence);
                let report = self.answer(command);
                self.session.counters.frames = self.session.counters.frames.wrapping_add(1);
                self.send(sequence, &report)
            }
            Err(error) => self.take_bad_frame(error),
        }
    }

    /// The number of the newest command, when this one was overtaken by it or is of an earlier
    /// session: its host has given it up, so it must not act now, nor make what follows look old. A
    /// hello begins anew, unless it is one of those just overtaken.
    fn overtaken(&self, sequence: u16, command: &Command) -> Option<u16> {
        self.sequence.filter(|newest| match command {
            Command::Hello(Greeting::OURS) => {
                (1..=MAX_LATE_HELLO).contains(&newest.wrapping_sub(sequence))
            }
            Command::Hello(_) => false,
            _ => sequence.wrapping_sub(*newest) > MAX_SKIPPED,
        })
    }

    /// It is counted; only a hello is answered, which may be a new host's.
    fn take_stale(
        &mut self,
        sequence: u16,
        command: &Command,
        newest: u16,
    ) -> Result<(), LinkLost> {
        self.session.counters.stale = self.session.counters.stale.wrapping_add(1);
        match command {
            Command::Hello(_) => self.send(sequence, &Report::Nack(Nack::Overtaken { newest })),
            _ => Ok(()),
        }
    }

    /// A broken frame is counted and never acted on; only an intact one of another schema can be
    /// answered.
    fn take_bad_frame(&mut self, error: FrameError) -> Result<(), LinkLost> {
        #[cfg(feature = "defmt")]
        defmt::warn!("frame dropped: {}", error);
        let counters = &mut self.session.counters;
        let counter = match error {
            FrameError::Crc => &mut counters.crc_failures,
            FrameError::Cobs => &mut counters.cobs_failures,
            FrameError::TooLong => &mut counters.overflows,
            FrameError::Body { .. } => &mut counters.unintelligible,
        };
        *counter = counter.wrapping_add(1);
        match error {
            FrameError::Body { sequence } => {
                self.send(sequence, &Report::Nack(Nack::Unintelligible))
            }
            _ => Ok(()),
        }
    }

    /// Does what a command asks for.
    #[inline(never)]
    fn answer(&mut self, command: Command) -> Report {
        match self.session.handle(command) {
            Answer::Report(report) => report,
            Answer::Measure { frame, first, count } => {
                self.measure(frame, first, count).unwrap_or_else(|_| self.front_end_failed())
            }
            Answer::Save { settings, hash } => self.save(&settings, hash),
            Answer::Forget => self.forget(),
        }
    }

    fn save(&mut self, settings: &Settings, hash: u32) -> Report {
        let hardware = self.board.hardware();
        match store::save(self.board.store(), &hardware, settings) {
            Ok(revision) => Report::Saved { hash, revision },
            Err(error) => storage_failed(error),
        }
    }

    fn forget(&mut self) -> Report {
        let hardware = self.board.hardware();
        store::forget(self.board.store(), &hardware)
            .map_or_else(storage_failed, |()| Report::Forgotten)
    }

    /// Fires the beams and reports their echoes under the name of the settings that made them.
    fn measure(&mut self, frame: u32, first: u32, count: u16) -> Result<Report, AfeError> {
        self.configure()?;
        if self.frame != Some(frame) {
            afe::begin_frame(self.board.emitter(), frame)?;
            self.frame = Some(frame);
        }
        let mut beams: Vec<Echoes, BEAMS_PER_REPORT> = Vec::new();
        for beam in first..first.saturating_add(u32::from(count)) {
            self.board.feed_watchdog();
            let echoes = self.shoot(beam)?;
            let _ = beams.push(echoes); // the session grants no more than fit
        }
        self.session.measured(first, &beams);
        let (generation, hash) = self.session.version();
        Ok(Report::Beams { frame, first, generation, hash, beams })
    }

    fn shoot(&mut self, beam: u32) -> Result<Echoes, AfeError> {
        let Some(Configured { settings, pipeline }) = &self.configured else {
            return Err(AfeError::Bus);
        };
        let hardware = self.board.hardware();
        let config = pipeline.config();
        let codes = self.codes.get_mut(..config.codes()).ok_or(AfeError::Bus)?;
        for shot in 0..config.shots() {
            if config.shots() > 1 {
                afe::number_shot(self.board.emitter(), shot)?;
            }
            if settings.phases() > 1 {
                afe::delay_shot(self.board.adc(), settings, &hardware, shot)?;
            }
            afe::fire(self.board.emitter(), beam)?;
            if !self.board.samples(codes) {
                return Err(AfeError::Bus);
            }
            if config.shots() > 1 {
                self.scratch.shots().add(shot, codes);
                self.board.feed_watchdog();
            }
        }
        if config.shots() > 1 {
            self.scratch.shots().read(config.sum_shift(), codes);
        }
        Ok(self.board.detect(pipeline, codes, &mut self.scratch))
    }

    /// Brings front end and DSP to the active settings, both or neither.
    fn configure(&mut self) -> Result<(), AfeError> {
        let settings = *self.session.settings();
        if self.configured.as_ref().is_some_and(|c| c.settings == settings) {
            return Ok(());
        }
        self.configured = None;
        let hardware = self.board.hardware();
        // The session checked the settings before it let them be active.
        let pipeline = Pipeline::new(&settings, &hardware).map_err(|_| AfeError::Bus)?;
        afe::apply(&settings, &mut self.board)?;
        self.configured = Some(Configured { settings, pipeline });
        #[cfg(feature = "defmt")]
        defmt::info!("settings {=u32:#010x} active: {}", self.session.version().1, settings);
        Ok(())
    }

    /// Start anew next time: what the front end holds is not known.
    fn front_end_failed(&mut self) -> Report {
        self.configured = None;
        self.frame = None;
        Report::Nack(Nack::FrontEnd)
    }

    fn send(&mut self, sequence: u16, report: &Report) -> Result<(), LinkLost> {
        // Every report fits: beams are bounded by BEAMS_PER_REPORT, which a test fills.
        let Ok(bytes) = echoloop_link::encode(sequence, report, &mut self.transmit) else {
            return Ok(());
        };
        let link = self.board.link();
        write_all(link, bytes)?;
        link.flush().map_err(|_| LinkLost)
    }
}

/// [`Write::write_all`], but for its panic when the link takes nothing.
fn write_all(link: &mut impl Write, mut bytes: &[u8]) -> Result<(), LinkLost> {
    while !bytes.is_empty() {
        let taken = link.write(bytes).map_err(|_| LinkLost)?;
        bytes = bytes.get(taken..).filter(|_| taken > 0).ok_or(LinkLost)?;
    }
    Ok(())
}

#[cfg_attr(not(feature = "defmt"), allow(unused_variables, reason = "only the log says it"))]
fn storage_failed(error: store::StoreError) -> Report {
    #[cfg(feature = "defmt")]
    defmt::warn!("settings not stored: {}", error);
    Report::Nack(Nack::Storage)
}
