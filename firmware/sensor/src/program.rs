//! Actions of the commands: the sensor drives the front end, runs the DSP, and answers.

use echoloop_dsp::{Echoes, MAX_CODES, Pipeline, Settings};
use echoloop_link::{
    Answer, BEAMS_PER_REPORT, Command, FrameError, Greeting, MAX_FRAME, Message, Nack, Noise,
    Report, Room, Way,
};
use embedded_io::Write;
use heapless::Vec;

use crate::afe::{self, AfeError};
use crate::app::{App, LinkLost, MAX_LATE_HELLO, MAX_SKIPPED};
use crate::board::Board;
use crate::state::Configured;
use crate::store;

impl<B: Board> App<B> {
    /// Answers a command.
    pub(crate) fn take(&mut self, sequence: u16, command: Command<'_>) -> Result<(), LinkLost> {
        if let Some(newest) = self.overtaken(sequence, &command) {
            return self.take_stale(sequence, &command, newest);
        }
        self.sequence = Some(sequence);
        let began_us = self.board.now_us();
        let report = self.answer(command);
        self.session.counters.frames = self.session.counters.frames.wrapping_add(1);
        self.send(sequence, &report)?;
        self.time(&report, began_us);
        Ok(())
    }

    /// Times the beams of a scan: they have just been sent, and work on them began at `began_us`.
    fn time(&mut self, report: &Report, began_us: Option<u32>) {
        if let (Report::Beams { .. }, Some((scan, whole))) = (report, self.session.open_scan())
            && let (Some(began_us), Some(now_us)) = (began_us, self.board.now_us())
        {
            self.stopwatch.add(scan, now_us.wrapping_sub(began_us), whole);
        }
    }

    /// Number of the newest command, if this command was overtaken by it or is from an earlier
    /// session. Its host has given it up, so it must neither act now nor make the commands that
    /// follow look old. A hello begins a new session, unless it is just behind the newest command.
    fn overtaken(&self, sequence: u16, command: &Command<'_>) -> Option<u16> {
        self.sequence.filter(|newest| match command {
            Command::Hello(Greeting::OURS) => {
                (1..=MAX_LATE_HELLO).contains(&newest.wrapping_sub(sequence))
            }
            Command::Hello(_) => false,
            _ => sequence.wrapping_sub(*newest) > MAX_SKIPPED,
        })
    }

    /// Counts an overtaken command; only a hello is answered, because it may be a new host's.
    fn take_stale(
        &mut self,
        sequence: u16,
        command: &Command<'_>,
        newest: u16,
    ) -> Result<(), LinkLost> {
        self.session.counters.stale = self.session.counters.stale.wrapping_add(1);
        match command {
            Command::Hello(_) => self.send(sequence, &Report::Nack(Nack::Overtaken { newest })),
            _ => Ok(()),
        }
    }

    /// Counts a bad frame, which never acts. Only an intact frame of another schema can be
    /// answered.
    pub(crate) fn take_bad_frame(&mut self, error: FrameError) -> Result<(), LinkLost> {
        #[cfg(feature = "defmt")]
        defmt::warn!("frame dropped: {}", error);
        let counters = &mut self.session.counters;
        let counter = match error {
            FrameError::Crc => &mut counters.crc_failures,
            FrameError::Cobs => &mut counters.cobs_failures,
            FrameError::TooLong => &mut counters.overflows,
            FrameError::Body { .. } => &mut counters.unintelligible,
            // The sensor's own frame, returned by the line. An answer would be returned too,
            // without end.
            FrameError::Echo { .. } => &mut counters.echoes,
        };
        *counter = counter.wrapping_add(1);
        match error {
            FrameError::Body { sequence } => {
                self.send(sequence, &Report::Nack(Nack::Unintelligible))
            }
            _ => Ok(()),
        }
    }

    /// Carries out a command.
    #[inline(never)]
    fn answer(&mut self, command: Command<'_>) -> Report {
        match self.session.handle(command) {
            Answer::Report(report) => report,
            Answer::Measure { frame, first, count, noise } => {
                self.measure((frame, noise), first, count)
            }
            Answer::Take { frame, from, packed } => self.take_codes(frame, from, packed),
            Answer::TellRoom => Report::Room(self.room()),
            Answer::SetDeadline { scan_us } => {
                self.stopwatch.set_deadline(scan_us);
                self.times()
            }
            Answer::TellTimes => self.times(),
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

    fn room(&self) -> Room {
        let waiting = self.board.link_buffer() / MAX_FRAME;
        let frames = u16::try_from(waiting.saturating_add(1)).unwrap_or(u16::MAX);
        Room { codes: MAX_CODES as u32, frames }
    }

    fn times(&mut self) -> Report {
        Report::Times(self.stopwatch.times(self.board.now_us().is_some()))
    }

    /// Fires the beams and reports their echoes, named by the settings that they were measured
    /// with.
    // Not inlined: its stack frame holds the only list of echoes beside the report that takes it.
    #[inline(never)]
    fn measure(&mut self, scan: (u32, Option<Noise>), first: u32, count: u16) -> Report {
        let mut beams: Vec<Echoes, BEAMS_PER_REPORT> = Vec::new();
        match self.fire_beams(scan, first, count, &mut beams) {
            Ok(()) => self.measured(scan.0, first, beams),
            Err(_) => self.front_end_failed(),
        }
    }

    fn fire_beams(
        &mut self,
        scan: (u32, Option<Noise>),
        first: u32,
        count: u16,
        beams: &mut Vec<Echoes, BEAMS_PER_REPORT>,
    ) -> Result<(), AfeError> {
        self.intake = None; // its memory, the codes, is needed
        self.configure()?;
        self.set_front_end()?;
        self.begin_scan(scan)?;
        let shots = self.configured.as_ref().map_or(0, |c| c.pipeline.config().shots);
        let end = first.saturating_add(u32::from(count));
        self.fire(first, 0)?;
        for beam in first..end {
            self.board.feed_watchdog();
            for shot in 0..shots {
                self.take_samples()?;
                // The converter takes the next shot while the program works on this one.
                if let Some((beam, shot)) = shot_after(beam, shot, shots, end) {
                    self.fire(beam, shot)?;
                }
                self.end_shot(shot);
            }
            let echoes = self.detect().ok_or(AfeError::Bus)?;
            let _ = beams.push(echoes); // the session grants no more than fit
        }
        Ok(())
    }

    /// Tells the front end of a scan, unless it has been told.
    fn begin_scan(&mut self, scan: (u32, Option<Noise>)) -> Result<(), AfeError> {
        if self.frame == Some(scan) {
            return Ok(());
        }
        self.frame = None;
        afe::begin_frame(self.board.emitter(), scan.0)?;
        afe::name_noise(self.board.emitter(), scan.1)?;
        self.frame = Some(scan);
        Ok(())
    }

    /// Report of echoes, named by the settings that they were measured with.
    pub(crate) fn measured(
        &mut self,
        frame: u32,
        first: u32,
        beams: Vec<Echoes, BEAMS_PER_REPORT>,
    ) -> Report {
        self.session.measured(first, &beams);
        let (generation, hash) = self.session.version();
        Report::Beams { frame, first, generation, hash, beams }
    }

    /// Fires a shot.
    fn fire(&mut self, beam: u32, shot: u32) -> Result<(), AfeError> {
        let Some(Configured { settings, pattern, .. }) = &self.configured else {
            return Err(AfeError::Bus);
        };
        afe::fire(&mut self.board, settings, pattern, beam, shot)?;
        self.board.begin_shot();
        Ok(())
    }

    /// Waits for the codes of the last shot.
    fn take_samples(&mut self) -> Result<(), AfeError> {
        let codes = self.configured.as_ref().map_or(0, |c| c.pipeline.config().codes());
        let codes = self.codes.get_mut(..codes).ok_or(AfeError::Bus)?;
        if self.board.samples(codes) { Ok(()) } else { Err(AfeError::Bus) }
    }

    /// Adds the codes of a whole shot up, where several make a waveform.
    pub(crate) fn end_shot(&mut self, shot: u32) {
        let Some(Configured { pipeline, .. }) = &self.configured else { return };
        let config = pipeline.config();
        if let Some(codes) = self.codes.get(..config.codes()).filter(|_| config.shots > 1) {
            self.scratch.shots().add(shot, codes);
            self.board.feed_watchdog();
        }
    }

    /// Detects the echoes of a beam whose shots are all there; `None` without settings.
    pub(crate) fn detect(&mut self) -> Option<Echoes> {
        let Configured { pipeline, .. } = self.configured.as_ref()?;
        let config = pipeline.config();
        let codes = self.codes.get_mut(..config.codes())?;
        if config.shots > 1 {
            self.scratch.shots().read(config.sum_shift, codes);
        }
        Some(self.board.detect(pipeline, codes, &mut self.scratch))
    }

    /// Configures the DSP for the active settings; the front end still has the ones before.
    pub(crate) fn configure(&mut self) -> Result<(), AfeError> {
        let settings = *self.session.settings();
        if self.configured.as_ref().is_some_and(|c| c.settings == settings) {
            return Ok(());
        }
        (self.configured, self.intake) = (None, None);
        let hardware = self.board.hardware();
        // The session checked the settings before it let them be active.
        let pipeline = Pipeline::new(&settings, &hardware).map_err(|_| AfeError::Bus)?;
        let pattern = *self.session.pattern();
        self.configured = Some(Configured { settings, pipeline, pattern, front_end_set: false });
        #[cfg(feature = "defmt")]
        defmt::info!("settings {=u32:#010x} active: {}", self.session.version().1, settings);
        Ok(())
    }

    /// Sets the front end to the settings of the DSP.
    fn set_front_end(&mut self) -> Result<(), AfeError> {
        let Some(configured) = self.configured.as_mut().filter(|c| !c.front_end_set) else {
            return Ok(());
        };
        afe::apply(&configured.settings, &mut self.board)?;
        configured.front_end_set = true;
        Ok(())
    }

    /// Reports a failure of the front end. Its registers are unknown now, so it is set anew next
    /// time.
    fn front_end_failed(&mut self) -> Report {
        self.configured = None;
        self.frame = None;
        Report::Nack(Nack::FrontEnd)
    }

    fn send(&mut self, sequence: u16, report: &Report) -> Result<(), LinkLost> {
        // Every report fits: a test encodes the longest, of BEAMS_PER_REPORT beams. A host whose
        // hello did not match may be older than the mark of the way, and must be able to read the
        // refusal.
        let way = match report {
            Report::Hello { .. } if !self.session.is_open() => Way::ToSensor,
            _ => Report::WAY,
        };
        let bytes = echoloop_link::encode_for(way, sequence, report, &mut self.transmit);
        let Ok(bytes) = bytes else { return Ok(()) };
        let link = self.board.link();
        write_all(link, bytes)?;
        link.flush().map_err(|_| LinkLost)
    }
}

/// Beam and shot that follow these, with `shots` shots a beam, up to beam `end`.
fn shot_after(beam: u32, shot: u32, shots: u32, end: u32) -> Option<(u32, u32)> {
    let (next_shot, next_beam) = (shot.saturating_add(1), beam.saturating_add(1));
    match next_shot < shots {
        true => Some((beam, next_shot)),
        false => (next_beam < end).then_some((next_beam, 0)),
    }
}

/// [`Write::write_all`] without its panic when the link takes no byte.
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
