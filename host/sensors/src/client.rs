//! The host's side of the link: asks, waits, asks again, and never mixes settings.

mod waveforms;

use std::hash::{BuildHasher, Hasher, RandomState};
use std::io;
use std::time::{Duration, Instant};

use echoloop_dsp::{Echoes, Hardware, Refusal, ScanPattern, Settings};
use echoloop_files::shown;
use echoloop_link::{
    BEAMS_PER_REPORT, Command, Counters, Decoder, Greeting, MAX_FRAME, Nack, Noise, Report, Room,
    Times, Way, frame, settings_hash,
};
use thiserror::Error;

use crate::pattern::{MOST_BEAMS, MOST_IN_ALL, is_possible, size};
use crate::transport::Transport;
pub use waveforms::Shoot;

/// Why a sensor did not do what it was asked.
#[derive(Debug, Error)]
pub enum ClientError {
    /// It refused the settings and kept its old ones.
    #[error("the sensor refused the settings: {0}")]
    Refused(#[from] Refusal),
    /// It understood and could not.
    #[error("the sensor answered {0:?}")]
    Nack(Nack),
    /// It did not answer.
    #[error("no answer from the sensor to {command} after {tries} tries of {timeout:?}")]
    Silent {
        /// What was asked.
        command: &'static str,
        /// How often.
        tries: u32,
        /// How long each.
        timeout: Duration,
    },
    /// It did not answer, and what was sent came back.
    #[error(
        "no answer from the sensor to {command}, but {echoes} frames of our own: the line echoes. \
         Are its two wires joined, or is it one wire for both ways?"
    )]
    Echo {
        /// What was asked.
        command: &'static str,
        /// Frames that came back.
        echoes: u32,
    },
    /// It speaks another version.
    #[error(
        "the sensor ({build}) speaks protocol {}, schema {:#018x}; this program protocol {}, \
         schema {:#018x}",
        theirs.protocol, theirs.schema, Greeting::OURS.protocol, Greeting::OURS.schema
    )]
    Version {
        /// Its greeting.
        theirs: Greeting,
        /// Its firmware.
        build: String,
    },
    /// It says that it has no beams, or more than there can be.
    #[error(
        "the sensor ({build}) says it has {} beams; expected 1 to {} × 1 to {}, or 1 to \
         {MOST_IN_ALL}",
        size(pattern), MOST_BEAMS[0], MOST_BEAMS[1]
    )]
    Pattern {
        /// Where it says its beams point.
        pattern: ScanPattern,
        /// Its firmware.
        build: String,
    },
    /// It answered something else.
    #[error("the sensor answered {command} with an unexpected report")]
    Unexpected {
        /// What was asked.
        command: &'static str,
    },
    /// The settings changed under a scan.
    #[error("scan {frame} was made with settings {got:#010x}, not {expected:#010x}")]
    Mixed {
        /// The scan.
        frame: u32,
        /// Hash of the settings that were asked for.
        expected: u32,
        /// Hash of those it was made with.
        got: u32,
    },
    /// Other settings are active than those to be confirmed or saved: their trial is over, or the
    /// sensor started anew.
    #[error("the sensor's settings are {got:#010x}, not {expected:#010x}")]
    Changed {
        /// Hash of the settings that were to be kept.
        expected: u32,
        /// Hash of the active ones.
        got: u32,
    },
    /// It has no room for the waveforms that its settings make.
    #[error("the sensor has room for {room} codes a shot; its settings make {needed}")]
    Room {
        /// Codes there is room for.
        room: u32,
        /// Codes of a shot.
        needed: u32,
    },
    /// The line is gone.
    #[error("the link is lost: {0}")]
    Line(#[from] io::Error),
}

/// What a sensor says of itself.
#[derive(Clone, Debug, PartialEq)]
pub struct Identity {
    /// Name and version of its firmware, as a message shows it.
    pub build: String,
    /// What its hardware fixes.
    pub hardware: Hardware,
    /// Where its beams point.
    pub pattern: ScanPattern,
}

/// How long to wait for an answer, and how often to ask.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RetryPolicy {
    /// How long to wait for an answer.
    pub timeout: Duration,
    /// How often to ask.
    pub tries: u32,
}

impl Default for RetryPolicy {
    fn default() -> Self {
        Self { timeout: Duration::from_millis(200), tries: 8 }
    }
}

/// A conversation with one sensor.
pub struct Client<T> {
    transport: T,
    decoder: Box<Decoder>,
    retry_policy: RetryPolicy,
    sequence: u16,
    identity: Identity,
    generation: u32,
    hash: u32,
    /// The settings of that hash.
    settings: Settings,
    /// The settings committed last are on trial: at any frame boundary they may be replaced, and
    /// the generation rise.
    on_trial: bool,
    /// An answer was lost, or the sensor knows nothing of a session: say hello and read back before
    /// going on.
    unsure: bool,
    /// Frames of our own that came back since the last command was numbered.
    echoes: u32,
}

impl<T: Transport> Client<T> {
    /// Says hello and learns who is there.
    ///
    /// # Errors
    ///
    /// [`ClientError`]; of a sensor of another version, [`ClientError::Version`] with both.
    pub fn connect(transport: T, retry_policy: RetryPolicy) -> Result<Self, ClientError> {
        // Anywhere, so that late answers to an earlier program are not taken for ours.
        Self::connect_from(
            transport,
            retry_policy,
            RandomState::new().build_hasher().finish() as u16,
        )
    }

    /// As [`Client::connect`], numbering commands from the one after `sequence`: the same bytes
    /// every time.
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
        let decoder = Box::new(Decoder::new());
        let (generation, hash, on_trial, unsure) = (0, 0, false, true);
        let settings = Settings::default();
        let mut client = Self {
            transport,
            decoder,
            retry_policy,
            sequence,
            identity,
            generation,
            hash,
            settings,
            on_trial,
            unsure,
            echoes: 0,
        };
        client.read_settings()?; // unsure, it says hello first
        Ok(client)
    }

    /// A sensor that takes our first number for an overtaken one says after which to begin.
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
        let build = shown(&build);
        if greeting != Greeting::OURS {
            return Err(ClientError::Version { theirs: greeting, build });
        }
        if !is_possible(&pattern) {
            return Err(ClientError::Pattern { pattern, build });
        }
        self.identity = Identity { build, hardware, pattern };
        Ok(())
    }

    /// What the sensor said of itself.
    pub fn identity(&self) -> &Identity {
        &self.identity
    }

    /// The line, for those who own its other end.
    pub fn transport_mut(&mut self) -> &mut T {
        &mut self.transport
    }

    /// The active settings. After an error it opens the session anew.
    ///
    /// # Errors
    ///
    /// [`ClientError`].
    pub fn read_settings(&mut self) -> Result<Settings, ClientError> {
        if self.unsure {
            self.greet()?;
        }
        let Report::Settings { generation, hash, settings } = self.ask(&Command::ReadSettings)?
        else {
            return Err(ClientError::Unexpected { command: "read settings" });
        };
        self.on_trial &= (generation, hash) == (self.generation, self.hash);
        (self.generation, self.hash, self.unsure) = (generation, hash, false);
        self.settings = settings;
        Ok(settings)
    }

    /// The active settings, as far as this side knows; it asks when it does not.
    ///
    /// # Errors
    ///
    /// [`ClientError`].
    pub fn settings(&mut self) -> Result<Settings, ClientError> {
        if self.unsure { self.read_settings() } else { Ok(self.settings) }
    }

    /// How the link has been, as the sensor counts.
    ///
    /// # Errors
    ///
    /// [`ClientError`].
    pub fn read_counters(&mut self) -> Result<Counters, ClientError> {
        match self.ask(&Command::ReadCounters)? {
            Report::Counters(counters) => Ok(counters),
            _ => Err(ClientError::Unexpected { command: "read counters" }),
        }
    }

    /// Says how long a scan may take, µs, 0: as long as it likes, and begins to count anew.
    ///
    /// # Errors
    ///
    /// [`ClientError`].
    pub fn set_deadline(&mut self, scan_us: u32) -> Result<Times, ClientError> {
        self.ask_times(&Command::SetDeadline { scan_us })
    }

    /// How long scans have taken the sensor since its deadline was set.
    ///
    /// # Errors
    ///
    /// [`ClientError`].
    pub fn read_times(&mut self) -> Result<Times, ClientError> {
        self.ask_times(&Command::ReadTimes)
    }

    fn ask_times(&mut self, command: &Command<'_>) -> Result<Times, ClientError> {
        match self.ask(command)? {
            Report::Times(times) => Ok(times),
            _ => Err(ClientError::Unexpected { command: name(command) }),
        }
    }

    /// Stages a whole set of settings, commits it, and returns the hash it now goes by.
    ///
    /// # Errors
    ///
    /// [`ClientError::Refused`] with field and bound, and the sensor keeps what it had. After
    /// [`ClientError::Silent`] or [`ClientError::Echo`] it has the old settings or the new, and the
    /// next call of this or of [`Client::read_settings`] finds out which before it goes on.
    pub fn configure(&mut self, settings: &Settings) -> Result<u32, ClientError> {
        self.configure_on_trial(settings, 0)
    }

    /// As [`Client::configure`], on trial. The sensor goes back to its last settings that were not
    /// on trial
    ///
    /// - unless [`Client::confirm`] comes before `frames` frames have ended (`0`: no trial),
    /// - when one whole frame has no echo,
    /// - when this program ends and another says hello.
    ///
    /// The scan after that is [`ClientError::Mixed`]. A frame ends when anything but a confirmation
    /// follows its last beam.
    ///
    /// # Errors
    ///
    /// As [`Client::configure`].
    pub fn configure_on_trial(
        &mut self,
        settings: &Settings,
        frames: u16,
    ) -> Result<u32, ClientError> {
        if self.unsure {
            self.read_settings()?;
        }
        let was_on_trial = self.on_trial;
        match self.stage_and_commit(settings, frames) {
            // A hello that came late dropped what was staged; the commit did not happen.
            Err(ClientError::Nack(Nack::NotStaged { .. })) => {
                self.stage_and_commit(settings, frames)
            }
            // The trial before this ended, and with it the generation that this one was to follow.
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
        (self.generation, self.hash, self.on_trial, self.unsure) =
            (generation, hash, frames > 0, false);
        self.settings = *settings;
        Ok(hash)
    }

    /// Ends the trial of the settings committed last: they stay. Said again, it is true again.
    ///
    /// # Errors
    ///
    /// [`ClientError::Nack`] with [`Nack::WrongGeneration`] or [`ClientError::Changed`] when their
    /// trial is over already. After [`ClientError::Silent`] or [`ClientError::Echo`], another call
    /// finds out.
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

    /// Makes the settings committed last those that the sensor starts with; their revision. What is
    /// saved already is not written again.
    ///
    /// # Errors
    ///
    /// [`ClientError::Nack`] with [`Nack::OnTrial`] before they are confirmed, with
    /// [`Nack::Storage`] when the flash failed; [`ClientError::Changed`] when they are active no
    /// longer. After [`ClientError::Silent`] or [`ClientError::Echo`] the sensor starts with the
    /// settings saved before or with these; another call makes it these.
    pub fn save(&mut self) -> Result<u32, ClientError> {
        self.be_sure_of_settings()?;
        let hash = self.hash;
        match self.ask(&Command::Save { hash })? {
            Report::Saved { hash: of, revision } if of == hash => Ok(revision),
            _ => Err(ClientError::Unexpected { command: "save" }),
        }
    }

    /// Makes the sensor start with its defaults. The active settings stay.
    ///
    /// # Errors
    ///
    /// As [`Client::save`].
    pub fn forget(&mut self) -> Result<(), ClientError> {
        if self.unsure {
            self.read_settings()?;
        }
        match self.ask(&Command::Forget)? {
            Report::Forgotten => Ok(()),
            _ => Err(ClientError::Unexpected { command: "forget" }),
        }
    }

    /// Opens the session anew when an answer was lost, and sees whether the settings are still
    /// those it knew. A hello ends a trial, so what is still there is not on trial.
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
        // Asked again, it is as wrong.
        (self.generation, self.hash, self.unsure) = (generation, expected, true);
        Err(ClientError::Changed { expected, got })
    }

    /// What room there is for waveforms.
    ///
    /// # Errors
    ///
    /// [`ClientError`].
    pub fn read_room(&mut self) -> Result<Room, ClientError> {
        match self.ask(&Command::ReadRoom)? {
            Report::Room(room) => Ok(room),
            _ => Err(ClientError::Unexpected { command: "read room" }),
        }
    }

    /// Measures all beams as scan `frame`; the echoes, beam by beam.
    ///
    /// # Errors
    ///
    /// [`ClientError::Mixed`] when any beam was made with other settings than those committed last;
    /// else [`ClientError`].
    pub fn scan(&mut self, frame: u32) -> Result<Vec<Echoes>, ClientError> {
        self.read_scan(frame, |first, count| Command::ReadBeams { frame, first, count })
    }

    /// As [`Client::scan`], with the noise that a simulated front end is to have.
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
        question: impl Fn(u32, u16) -> Command<'static>,
    ) -> Result<Vec<Echoes>, ClientError> {
        let total = self.identity.pattern.beams();
        let mut scan = Vec::with_capacity(total as usize);
        while (scan.len() as u32) < total {
            let first = scan.len() as u32;
            let count = (total - first).min(BEAMS_PER_REPORT as u32) as u16;
            let report = self.ask(&question(first, count))?;
            scan.extend(self.beams(report, frame, first, count.into())?);
        }
        Ok(scan)
    }

    /// The echoes of so many beams of a scan, by the settings committed last.
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
            self.unsure = true; // a trial ended, or the sensor is another's
            return Err(ClientError::Mixed { frame, expected: self.hash, got: hash });
        }
        Ok(beams)
    }

    /// Sends a command and waits for its own answer, asking again when it does not come. Refusals
    /// become errors.
    fn ask(&mut self, command: &Command<'_>) -> Result<Report, ClientError> {
        let mut frame = [0; MAX_FRAME];
        let bytes = self.numbered(command, &mut frame)?;
        let sequence = self.sequence;
        for _ in 0..self.retry_policy.tries {
            self.transport.send(bytes)?;
            match self.listen(|of| of == sequence)?.pop() {
                Some((_, Report::Refused(refusal))) => return Err(refusal.into()),
                Some((_, Report::Nack(reason))) => {
                    self.unsure |= reason == Nack::NotReady;
                    return Err(ClientError::Nack(reason));
                }
                Some((_, report)) => return Ok(report),
                None => {}
            }
        }
        Err(self.silent(name(command)))
    }

    /// A command as a frame with a number of its own.
    fn numbered<'a>(
        &mut self,
        command: &Command<'_>,
        frame: &'a mut [u8; MAX_FRAME],
    ) -> Result<&'a [u8], ClientError> {
        self.sequence = self.sequence.wrapping_add(1);
        self.echoes = 0;
        let frame = echoloop_link::encode(self.sequence, command, frame);
        frame.map_err(|error| io::Error::new(io::ErrorKind::InvalidInput, error).into())
    }

    /// It was asked often enough.
    fn silent(&mut self, command: &'static str) -> ClientError {
        self.unsure = true;
        if self.echoes > 0 {
            return ClientError::Echo { command, echoes: self.echoes };
        }
        let RetryPolicy { timeout, tries } = self.retry_policy;
        ClientError::Silent { command, tries, timeout }
    }

    /// The reports of numbers that are awaited, in the order in which they come: those of the first
    /// bytes that hold any; none when none comes in time. Broken frames and answers to older
    /// questions are dropped; a line that never falls quiet is not listened to for longer.
    fn listen(&mut self, awaited: impl Fn(u16) -> bool) -> Result<Vec<(u16, Report)>, ClientError> {
        let deadline = Instant::now() + self.retry_policy.timeout;
        let mut chunk = [0; 1024];
        loop {
            let left = deadline.saturating_duration_since(Instant::now());
            let length = self.transport.receive(&mut chunk, left)?;
            let mut answers = Vec::new();
            for &byte in &chunk[..length] {
                let Some(Ok(frame)) = self.decoder.push(byte) else { continue };
                match echoloop_link::open(frame) {
                    Ok((Way::ToSensor, _, body)) if !answers_another_hello(body) => {
                        self.echoes = self.echoes.saturating_add(1);
                    }
                    Ok((_, sequence, body)) if awaited(sequence) => {
                        answers.extend(read(body)?.map(|report| (sequence, report)));
                    }
                    _ => {} // broken, or an answer to another question
                }
            }
            if length == 0 || !answers.is_empty() || left.is_zero() {
                return Ok(answers);
            }
        }
    }
}

/// Whether it is an answer to a hello, of a sensor whose protocol is not ours: it has not the mark
/// of its way.
fn answers_another_hello(body: &[u8]) -> bool {
    Greeting::from_answer(body).is_some_and(|theirs| theirs != Greeting::OURS)
}

/// A report of this schema; `None` of another. A greeting is understood whatever follows it.
fn read(body: &[u8]) -> Result<Option<Report>, ClientError> {
    match (frame::message(body), Greeting::from_answer(body)) {
        (Some(report), _) => Ok(Some(report)),
        (None, Some(theirs)) if theirs != Greeting::OURS => {
            Err(ClientError::Version { theirs, build: "of another build".into() })
        }
        _ => Ok(None),
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
