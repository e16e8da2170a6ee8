//! Client of one sensor: sends commands, waits, retries, and never mixes settings.

mod waveforms;

use std::hash::{BuildHasher, Hasher, RandomState};
use std::io;
use std::time::{Duration, Instant};

use echoloop_dsp::{Echoes, Hardware, Refusal, ScanPattern, Settings};
use echoloop_files::one_line;
use echoloop_link::{
    BEAMS_PER_REPORT, Command, Counters, Decoder, Greeting, MAX_FRAME, Nack, Noise, Report, Room,
    Times, Way, frame, settings_hash,
};
use thiserror::Error;

use crate::pattern::{MOST_BEAMS, MOST_IN_ALL, is_possible, size};
use crate::transport::Transport;
pub use waveforms::Shoot;

/// Failure of a command.
#[derive(Debug, Error)]
pub enum ClientError {
    /// The sensor refused the settings and kept its old ones.
    #[error("the sensor refused the settings: {0}")]
    Refused(#[from] Refusal),
    /// The sensor understood the command and could not execute it.
    #[error("{}", said(*.0))]
    Nack(Nack),
    /// No answer.
    #[error(
        "no answer from the sensor to {command} after {tries} tries of {timeout:?}{}",
        if *.in_use { "; there are frames of another host: who else is on the line?" } else { "" }
    )]
    Silent {
        /// Command.
        command: &'static str,
        /// Number of tries.
        tries: u32,
        /// Timeout of each try.
        timeout: Duration,
        /// True when frames numbered by another host came.
        in_use: bool,
    },
    /// No answer, and the frames that were sent came back.
    #[error(
        "no answer from the sensor to {command}, but {echoes} frames of our own: the line echoes. \
         Are its two wires joined, or is it one wire for both ways?"
    )]
    Echo {
        /// Command.
        command: &'static str,
        /// Frames that came back.
        echoes: u32,
    },
    /// The sensor speaks another version.
    #[error(
        "the sensor ({build}) speaks protocol {}, schema {:#018x}; this program protocol {}, \
         schema {:#018x}",
        theirs.protocol, theirs.schema, Greeting::OURS.protocol, Greeting::OURS.schema
    )]
    Version {
        /// Greeting of the sensor.
        theirs: Greeting,
        /// Name and version of its firmware.
        build: String,
    },
    /// The sensor says that it has no beams, or more than are accepted.
    #[error(
        "the sensor ({build}) says it has {} beams; expected 1 to {} × 1 to {}, or 1 to \
         {MOST_IN_ALL}",
        size(pattern), MOST_BEAMS[0], MOST_BEAMS[1]
    )]
    Pattern {
        /// Scan pattern of the sensor.
        pattern: ScanPattern,
        /// Name and version of its firmware.
        build: String,
    },
    /// Report of another kind than the command's.
    #[error("the sensor answered {command} with an unexpected report")]
    Unexpected {
        /// Command.
        command: &'static str,
    },
    /// The settings changed under a scan.
    #[error("scan {frame} was made with settings {got:#010x}, not {expected:#010x}")]
    Mixed {
        /// Number of the scan.
        frame: u32,
        /// Hash of the settings committed last.
        expected: u32,
        /// Hash of the settings of the scan.
        got: u32,
    },
    /// Other settings are active than those to be confirmed or saved: their trial is over, or the
    /// sensor has restarted.
    #[error("the sensor's settings are {got:#010x}, not {expected:#010x}")]
    Changed {
        /// Hash of the settings to be confirmed or saved.
        expected: u32,
        /// Hash of the active settings.
        got: u32,
    },
    /// The sensor has no room for the waveforms of its settings.
    #[error("the sensor has room for {room} codes a shot; its settings make {needed}")]
    Room {
        /// Room, codes a shot.
        room: u32,
        /// Codes of a shot by the settings.
        needed: u32,
    },
    /// The line is lost.
    #[error("the link is lost: {0}")]
    Line(#[from] io::Error),
}

/// Identity of a sensor, from its hello.
#[derive(Clone, Debug, PartialEq)]
pub struct Identity {
    /// Name and version of its firmware, printable.
    pub build: String,
    /// Hardware.
    pub hardware: Hardware,
    /// Scan pattern.
    pub pattern: ScanPattern,
}

/// Timeout and number of tries of a command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RetryPolicy {
    /// Timeout of an answer.
    pub timeout: Duration,
    /// Number of tries.
    pub tries: u32,
}

impl Default for RetryPolicy {
    fn default() -> Self {
        Self { timeout: Duration::from_millis(200), tries: 8 }
    }
}

/// Client of one sensor.
pub struct Client<T> {
    transport: T,
    decoder: Box<Decoder>,
    retry_policy: RetryPolicy,
    sequence: u16,
    identity: Identity,
    generation: u32,
    hash: u32,
    /// Settings of that hash.
    settings: Settings,
    /// Scan pattern with the aim of the settings.
    pattern: ScanPattern,
    /// True while the settings committed last are on trial: at any frame boundary they may be
    /// replaced and the generation may rise.
    on_trial: bool,
    /// True when an answer was lost or the sensor has no session: greet and read back the settings
    /// first.
    unsure: bool,
    /// Own frames that came back since the last command was numbered.
    echoes: u32,
    /// Frames that came broken since then, and those with another host's numbers.
    broken: u32,
    foreign: u32,
    /// Greatest number of beams that are asked for at once: less on a line that breaks long frames.
    most_beams: u16,
    /// Newest reports that came at the first try, one after the other.
    at_once: u32,
}

/// Broken frames after which a command with a long answer is given up for shorter ones.
const BREAKS: u32 = 2;

/// Number of newest commands whose late answers may still come.
const RECENT: u16 = 256;

/// Reports in a row at the first try after which longer ones are tried again.
const WHOLE: u32 = 64;

impl<T: Transport> Client<T> {
    /// Connects, and reads the sensor's identity and settings.
    ///
    /// # Errors
    ///
    /// [`ClientError`]; [`ClientError::Version`] for a sensor of another version.
    pub fn connect(transport: T, retry_policy: RetryPolicy) -> Result<Self, ClientError> {
        // Random, so that late answers to an earlier program match no number of ours.
        let sequence = RandomState::new().build_hasher().finish() as u16;
        Self::connect_from(transport, retry_policy, sequence)
    }

    /// As [`Client::connect`], with commands numbered from `sequence + 1`: the same bytes every
    /// time.
    ///
    /// # Errors
    ///
    /// As [`Client::connect`].
    pub fn connect_from(
        transport: T,
        retry_policy: RetryPolicy,
        sequence: u16,
    ) -> Result<Self, ClientError> {
        let identity = Identity {
            build: String::new(),
            hardware: Hardware::REFERENCE,
            pattern: ScanPattern::default(),
        };
        let mut client = Self {
            transport,
            decoder: Box::new(Decoder::new()),
            retry_policy,
            sequence,
            identity,
            generation: 0,
            hash: 0,
            settings: Settings::default(),
            pattern: ScanPattern::default(),
            on_trial: false,
            unsure: true,
            echoes: 0,
            broken: 0,
            foreign: 0,
            most_beams: BEAMS_PER_REPORT as u16,
            at_once: 0,
        };
        client.read_settings()?; // unsure, it says hello first
        Ok(client)
    }

    /// Greets. A sensor that takes the first number for an overtaken one answers with the number to
    /// continue after.
    fn say_hello(&mut self) -> Result<Report, ClientError> {
        let hello = Command::Hello(Greeting::OURS);
        match self.ask(&hello) {
            Err(ClientError::Nack(Nack::Overtaken { newest })) => {
                self.sequence = newest;
                self.ask(&hello)
            }
            answered => answered,
        }
    }

    fn greet(&mut self) -> Result<(), ClientError> {
        let Report::Hello { greeting, build, hardware, pattern } = self.say_hello()? else {
            return Err(ClientError::Unexpected { command: "hello" });
        };
        let build = one_line(&build);
        if greeting != Greeting::OURS {
            return Err(ClientError::Version { theirs: greeting, build });
        }
        if !is_possible(&pattern) {
            return Err(ClientError::Pattern { pattern, build });
        }
        self.identity = Identity { build, hardware, pattern };
        Ok(())
    }

    /// Identity of the sensor.
    pub fn identity(&self) -> &Identity {
        &self.identity
    }

    /// Transport of the client.
    pub fn transport_mut(&mut self) -> &mut T {
        &mut self.transport
    }

    /// Reads the active settings. After an error it greets again first.
    pub fn read_settings(&mut self) -> Result<Settings, ClientError> {
        if self.unsure {
            self.greet()?;
        }
        let Report::Settings { generation, hash, settings } = self.ask(&Command::ReadSettings)?
        else {
            return Err(ClientError::Unexpected { command: "read settings" });
        };
        self.on_trial &= (generation, hash) == (self.generation, self.hash);
        self.hold(&settings)?;
        (self.generation, self.hash, self.unsure) = (generation, hash, false);
        Ok(settings)
    }

    /// Keeps the active settings, and the pattern with their aim.
    fn hold(&mut self, settings: &Settings) -> Result<(), ClientError> {
        self.pattern = self.identity.pattern.aimed(settings)?; // the sensor checked them
        self.settings = *settings;
        Ok(())
    }

    /// Scan pattern with the aim of the settings committed last.
    pub fn pattern(&self) -> &ScanPattern {
        &self.pattern
    }

    /// Active settings, read from the sensor only where this side is unsure.
    pub fn settings(&mut self) -> Result<Settings, ClientError> {
        if self.unsure { self.read_settings() } else { Ok(self.settings) }
    }

    /// Reads the sensor's counters of link errors.
    pub fn read_counters(&mut self) -> Result<Counters, ClientError> {
        match self.ask(&Command::ReadCounters)? {
            Report::Counters(counters) => Ok(counters),
            _ => Err(ClientError::Unexpected { command: "read counters" }),
        }
    }

    /// Sets the deadline of a scan, µs, 0 for none, and restarts its statistics.
    pub fn set_deadline(&mut self, scan_us: u32) -> Result<Times, ClientError> {
        self.ask_times(&Command::SetDeadline { scan_us })
    }

    /// Reads the durations of scans since the deadline was set.
    pub fn read_times(&mut self) -> Result<Times, ClientError> {
        self.ask_times(&Command::ReadTimes)
    }

    fn ask_times(&mut self, command: &Command<'_>) -> Result<Times, ClientError> {
        match self.ask(command)? {
            Report::Times(times) => Ok(times),
            _ => Err(ClientError::Unexpected { command: name(command) }),
        }
    }

    /// Stages and commits settings, and returns their hash.
    ///
    /// # Errors
    ///
    /// [`ClientError::Refused`] with field and bound; the sensor keeps its old settings. After
    /// [`ClientError::Silent`] or [`ClientError::Echo`] either may be active: the next call of this
    /// or of [`Client::read_settings`] reads back which.
    pub fn configure(&mut self, settings: &Settings) -> Result<u32, ClientError> {
        self.configure_on_trial(settings, 0)
    }

    /// As [`Client::configure`], on trial. The sensor returns to its last settings that were not on
    /// trial
    ///
    /// - unless [`Client::confirm`] comes before `frames` frames have ended (`0`: no trial),
    /// - when one whole frame has no echo,
    /// - when this program ends and another greets.
    ///
    /// The next scan is then [`ClientError::Mixed`]. A frame ends when any command but a
    /// confirmation follows its last beam.
    ///
    /// # Errors
    ///
    /// As [`Client::configure`].
    pub fn configure_on_trial(
        &mut self,
        settings: &Settings,
        frames: u16,
    ) -> Result<u32, ClientError> {
        self.settings()?;
        let was_on_trial = self.on_trial;
        match self.stage_and_commit(settings, frames) {
            // A late hello dropped the staged settings, so the commit did not happen.
            Err(ClientError::Nack(Nack::NotStaged { .. })) => {
                self.stage_and_commit(settings, frames)
            }
            // The trial before this one ended, and the generation rose.
            Err(ClientError::Nack(Nack::WrongGeneration { .. })) if was_on_trial => {
                self.read_settings()?;
                self.stage_and_commit(settings, frames)
            }
            done => done,
        }
    }

    fn stage_and_commit(&mut self, settings: &Settings, frames: u16) -> Result<u32, ClientError> {
        let Report::Staged { hash } = self.ask(&Command::Stage(*settings))? else {
            return Err(ClientError::Unexpected { command: "stage" });
        };
        if hash != settings_hash(settings) {
            return Err(ClientError::Unexpected { command: "stage" });
        }
        let commit =
            Command::Commit { hash, base_generation: self.generation, confirm_within: frames };
        self.unsure = true; // until the answer is here
        let Report::Committed { generation, hash } = self.ask(&commit)? else {
            return Err(ClientError::Unexpected { command: "commit" });
        };
        self.hold(settings)?;
        (self.generation, self.hash, self.on_trial, self.unsure) =
            (generation, hash, frames > 0, false);
        Ok(hash)
    }

    /// Ends the trial of the settings committed last, which stay active. May be repeated.
    ///
    /// # Errors
    ///
    /// [`ClientError::Nack`] with [`Nack::WrongGeneration`] or [`ClientError::Changed`] when their
    /// trial is over already. After [`ClientError::Silent`] or [`ClientError::Echo`], call it
    /// again.
    pub fn confirm(&mut self) -> Result<(), ClientError> {
        self.be_sure_of_settings()?;
        let generation = self.generation;
        self.unsure = true; // until the answer is here
        match self.ask(&Command::Confirm { generation })? {
            Report::Confirmed { generation: of } if of == generation => {
                (self.on_trial, self.unsure) = (false, false);
                Ok(())
            }
            _ => Err(ClientError::Unexpected { command: "confirm" }),
        }
    }

    /// Saves the settings committed last, so that the sensor starts with them, and returns their
    /// revision. Settings that are saved already are not written again.
    ///
    /// # Errors
    ///
    /// [`ClientError::Nack`] with [`Nack::OnTrial`] before they are confirmed, with
    /// [`Nack::Storage`] when the flash failed; [`ClientError::Changed`] when others are active.
    /// After [`ClientError::Silent`] or [`ClientError::Echo`] either the old or these are saved;
    /// call it again.
    pub fn save(&mut self) -> Result<u32, ClientError> {
        self.be_sure_of_settings()?;
        let hash = self.hash;
        match self.ask(&Command::Save { hash })? {
            Report::Saved { hash: of, revision } if of == hash => Ok(revision),
            _ => Err(ClientError::Unexpected { command: "save" }),
        }
    }

    /// Erases the saved settings, so that the sensor starts with its defaults. The active ones
    /// stay.
    ///
    /// # Errors
    ///
    /// As [`Client::save`].
    pub fn forget(&mut self) -> Result<(), ClientError> {
        self.settings()?;
        match self.ask(&Command::Forget)? {
            Report::Forgotten => Ok(()),
            _ => Err(ClientError::Unexpected { command: "forget" }),
        }
    }

    /// After a lost answer, reads back the settings and refuses others than those known. The
    /// greeting ends any trial.
    fn be_sure_of_settings(&mut self) -> Result<(), ClientError> {
        if !self.unsure {
            return Ok(());
        }
        let (generation, expected) = (self.generation, self.hash);
        self.read_settings()?;
        if (self.generation, self.hash) == (generation, expected) {
            return Ok(());
        }
        let got = self.hash;
        // Still unsure: another call is refused as well.
        (self.generation, self.hash, self.unsure) = (generation, expected, true);
        Err(ClientError::Changed { expected, got })
    }

    /// Reads the sensor's room for waveforms.
    pub fn read_room(&mut self) -> Result<Room, ClientError> {
        match self.ask(&Command::ReadRoom)? {
            Report::Room(room) => Ok(room),
            _ => Err(ClientError::Unexpected { command: "read room" }),
        }
    }

    /// Measures all beams as scan `frame`, and returns the echoes of each beam.
    ///
    /// # Errors
    ///
    /// [`ClientError::Mixed`] when any beam was measured with other settings than those committed
    /// last; else [`ClientError`].
    pub fn scan(&mut self, frame: u32) -> Result<Vec<Echoes>, ClientError> {
        self.read_scan(frame, |first, count| Command::ReadBeams { frame, first, count })
    }

    /// As [`Client::scan`], with the noise of a simulated front end.
    ///
    /// # Errors
    ///
    /// As [`Client::scan`].
    pub fn scan_with(&mut self, frame: u32, noise: Noise) -> Result<Vec<Echoes>, ClientError> {
        self.read_scan(frame, |first, count| Command::ReadNoisyBeams { frame, first, count, noise })
    }

    fn read_scan(
        &mut self,
        frame: u32,
        command: impl Fn(u32, u16) -> Command<'static>,
    ) -> Result<Vec<Echoes>, ClientError> {
        let total = self.pattern.beams();
        let mut scan = Vec::with_capacity(total as usize);
        while (scan.len() as u32) < total {
            let first = scan.len() as u32;
            let count = (total - first).min(self.most_beams.into()) as u16;
            let was_unsure = self.unsure;
            match self.ask(&command(first, count)) {
                Err(ClientError::Silent { .. }) if count > 1 && self.broken > 0 => {
                    self.most_beams = (self.most_beams / 2).max(1);
                    (self.at_once, self.unsure) = (0, was_unsure);
                }
                report => scan.extend(self.beams(report?, frame, first, count.into())?),
            }
        }
        Ok(scan)
    }

    /// Counts reports that came at the first try; after many of them, longer ones are tried again.
    fn count_report(&mut self, at_once: bool) {
        self.at_once = if at_once { self.at_once + 1 } else { 0 };
        if self.at_once >= WHOLE {
            self.at_once = 0;
            self.most_beams = (2 * self.most_beams).min(BEAMS_PER_REPORT as u16);
        }
    }

    /// Echoes of `count` beams of a scan, checked to be of the settings committed last.
    fn beams(
        &mut self,
        report: Report,
        frame: u32,
        first: u32,
        count: usize,
    ) -> Result<heapless::Vec<Echoes, BEAMS_PER_REPORT>, ClientError> {
        let Report::Beams { frame: of, first: from, generation, hash, beams } = report else {
            return Err(ClientError::Unexpected { command: "read beams" });
        };
        if (of, from, beams.len()) != (frame, first, count) {
            return Err(ClientError::Unexpected { command: "read beams" });
        }
        if (generation, hash) != (self.generation, self.hash) {
            self.unsure = true; // a trial ended, or another program has the sensor
            return Err(ClientError::Mixed { frame, expected: self.hash, got: hash });
        }
        Ok(beams)
    }

    /// Sends a command and waits for its own answer, with retries. Refusals become errors.
    fn ask(&mut self, command: &Command<'_>) -> Result<Report, ClientError> {
        let mut frame = [0; MAX_FRAME];
        let bytes = self.numbered(command, &mut frame)?;
        let sequence = self.sequence;
        for step in 0..self.retry_policy.tries {
            if self.broken >= BREAKS && is_long(command) {
                break;
            }
            self.transport.send(bytes)?;
            match self.listen(|of| of == sequence)?.pop() {
                Some((_, Report::Refused(refusal))) => return Err(refusal.into()),
                Some((_, Report::Nack(reason))) => {
                    self.unsure |= reason == Nack::NotReady;
                    return Err(ClientError::Nack(reason));
                }
                Some((_, report)) => {
                    if matches!(report, Report::Beams { .. }) {
                        self.count_report(step == 0);
                    }
                    return Ok(report);
                }
                None => {}
            }
        }
        Err(self.silent(name(command)))
    }

    /// Frame of a command with the next number.
    fn numbered<'a>(
        &mut self,
        command: &Command<'_>,
        frame: &'a mut [u8; MAX_FRAME],
    ) -> Result<&'a [u8], ClientError> {
        self.sequence = self.sequence.wrapping_add(1);
        (self.echoes, self.broken, self.foreign) = (0, 0, 0);
        let frame = echoloop_link::encode(self.sequence, command, frame);
        frame.map_err(|error| io::Error::new(io::ErrorKind::InvalidInput, error).into())
    }

    /// Error after the last try.
    fn silent(&mut self, command: &'static str) -> ClientError {
        self.unsure = true;
        if self.echoes > 0 {
            return ClientError::Echo { command, echoes: self.echoes };
        }
        let RetryPolicy { timeout, tries } = self.retry_policy;
        ClientError::Silent { command, tries, timeout, in_use: self.foreign > 0 }
    }

    /// Reports with awaited numbers, in their order of arrival: all those in the first bytes that
    /// hold any; empty at the timeout, even on a line that is never quiet. Broken frames and
    /// answers to older commands are dropped.
    fn listen(&mut self, awaited: impl Fn(u16) -> bool) -> Result<Vec<(u16, Report)>, ClientError> {
        let deadline = Instant::now() + self.retry_policy.timeout;
        let mut chunk = [0; 1024];
        loop {
            let left = deadline.saturating_duration_since(Instant::now());
            let length = self.transport.receive(&mut chunk, left)?;
            let mut answers = Vec::new();
            for &byte in &chunk[..length] {
                let frame = match self.decoder.push(byte) {
                    Some(Ok(frame)) => frame,
                    broken => {
                        self.broken = self.broken.saturating_add(broken.is_some().into());
                        continue;
                    }
                };
                let ours = self.sequence;
                match echoloop_link::open(frame) {
                    Ok((_, of, _)) if ours.wrapping_sub(of) > RECENT && !awaited(of) => {
                        self.foreign = self.foreign.saturating_add(1);
                    }
                    Err(_) => self.broken = self.broken.saturating_add(1),
                    Ok((Way::ToSensor, _, body)) if !answers_another_hello(body) => {
                        self.echoes = self.echoes.saturating_add(1);
                    }
                    Ok((_, sequence, body)) if awaited(sequence) => {
                        answers.extend(read(body)?.map(|report| (sequence, report)));
                    }
                    _ => {} // an answer to another command
                }
            }
            if length == 0 || !answers.is_empty() || left.is_zero() {
                return Ok(answers);
            }
        }
    }
}

/// True for the answer to a hello from a sensor of another protocol, which does not mark its
/// direction.
fn answers_another_hello(body: &[u8]) -> bool {
    Greeting::from_answer(body).is_some_and(|theirs| theirs != Greeting::OURS)
}

/// Report of this schema; `None` of another. A greeting is read whatever follows it.
fn read(body: &[u8]) -> Result<Option<Report>, ClientError> {
    match (frame::message(body), Greeting::from_answer(body)) {
        (Some(report), _) => Ok(Some(report)),
        (None, Some(theirs)) if theirs != Greeting::OURS => {
            Err(ClientError::Version { theirs, build: "of another build".into() })
        }
        _ => Ok(None),
    }
}

/// True of a command whose answer is the shorter the fewer beams it asks for.
fn is_long(command: &Command<'_>) -> bool {
    match command {
        Command::ReadBeams { count, .. } | Command::ReadNoisyBeams { count, .. } => *count > 1,
        _ => false,
    }
}

/// What a sensor answers instead of a report.
fn said(nack: Nack) -> String {
    match nack {
        Nack::NotReady => "the sensor restarted: it waits for a greeting, and its settings are \
                           those that it saved"
            .into(),
        other => format!("the sensor answered {other:?}"),
    }
}

fn name(command: &Command<'_>) -> &'static str {
    match command {
        Command::Hello(_) => "hello",
        Command::Stage(_) => "stage",
        Command::Commit { .. } => "commit",
        Command::ReadSettings => "read settings",
        Command::ReadBeams { .. } | Command::ReadNoisyBeams { .. } => "read beams",
        Command::ReadCounters => "read counters",
        Command::Confirm { .. } => "confirm",
        Command::Save { .. } => "save",
        Command::Forget => "forget",
        Command::ReadRoom => "read room",
        Command::Waveforms { .. } => "waveforms",
        Command::SetDeadline { .. } => "set deadline",
        Command::ReadTimes => "read times",
    }
}
