//! The sensor's side of the conversation: hello, stage → check → commit, frame boundaries.

use echoloop_dsp::{Hardware, ScanPattern, Settings};
use heapless::String;

use crate::message::{
    BEAMS_PER_REPORT, Command, Counters, Greeting, MAGIC, Nack, PROTOCOL, Report, SCHEMA, settings_hash,
};

/// Settings with the name they go by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Version {
    generation: u32,
    hash: u32,
    settings: Settings,
}

/// The scan being read. It stays open until its last beam has been sent and something else is asked, so that the last beams
/// may be asked again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Frame {
    number: u32,
    complete: bool,
}

/// What a command asks of the sensor.
#[derive(Clone, Debug, PartialEq)]
#[allow(clippy::large_enum_variant, reason = "lives for one answer, and there is no heap to box it on")]
pub enum Answer {
    /// Send this.
    Report(Report),
    /// Measure these beams with the active settings and send them.
    Measure {
        /// Number of the scan.
        frame: u32,
        /// First beam.
        first: u32,
        /// How many, 1 to [`BEAMS_PER_REPORT`].
        count: u16,
    },
}

/// State of the conversation. Settings are whole in it: staged, active, or waiting for the frame to end.
///
/// Invariants: the active settings passed [`Settings::check`]; they change only between frames; a generation names one set of
/// settings for ever.
#[derive(Clone, Debug)]
pub struct Session {
    hardware: Hardware,
    pattern: ScanPattern,
    build: &'static str,
    ready: bool,
    staged: Option<Settings>,
    active: Version,
    /// Committed while a frame was open; takes its place when the frame ends.
    pending: Option<Version>,
    frame: Option<Frame>,
    /// How the link has been.
    pub counters: Counters,
}

impl Session {
    /// A sensor with its default settings, generation 0.
    pub fn new(hardware: Hardware, pattern: ScanPattern, build: &'static str) -> Self {
        let settings = Settings::default();
        Self {
            hardware,
            pattern,
            build,
            ready: false,
            staged: None,
            active: Version { generation: 0, hash: settings_hash(&settings), settings },
            pending: None,
            frame: None,
            counters: Counters::default(),
        }
    }

    /// The active settings.
    pub fn settings(&self) -> &Settings {
        &self.active.settings
    }

    /// Generation and hash of the active settings.
    pub fn version(&self) -> (u32, u32) {
        (self.active.generation, self.active.hash)
    }

    /// Takes one command.
    pub fn handle(&mut self, command: Command) -> Answer {
        if let Command::Hello(greeting) = command {
            return Answer::Report(self.hello(greeting));
        }
        if !self.ready {
            return nack(Nack::NotReady);
        }
        self.end_frame_before(&command);
        match command {
            Command::Hello(_) => nack(Nack::NotReady), // answered above
            Command::Stage(settings) => Answer::Report(self.stage(settings)),
            Command::Commit { hash, base_generation } => Answer::Report(self.commit(hash, base_generation)),
            Command::ReadSettings => Answer::Report(self.read_settings()),
            Command::ReadBeams { frame, first, count } => self.read_beams(frame, first, count),
            Command::ReadCounters => Answer::Report(Report::Counters(self.counters)),
        }
    }

    /// Our greeting in any case; the session opens only when theirs is the same. Whatever scan was open is over, so that what
    /// was committed during it is what the new session reads.
    fn hello(&mut self, theirs: Greeting) -> Report {
        self.ready = theirs == Greeting::OURS;
        self.staged = None;
        self.end_frame();
        Report::Hello {
            greeting: Greeting { magic: MAGIC, protocol: PROTOCOL, schema: SCHEMA },
            build: self.build.chars().take(32).fold(String::new(), |mut text, c| {
                let _ = text.push(c); // a longer name is cut
                text
            }),
            hardware: self.hardware,
            pattern: self.pattern,
        }
    }

    fn stage(&mut self, settings: Settings) -> Report {
        match settings.check(&self.hardware) {
            Ok(()) => {
                self.staged = Some(settings);
                Report::Staged { hash: settings_hash(&settings) }
            }
            Err(refusal) => {
                self.counters.refusals = self.counters.refusals.wrapping_add(1);
                Report::Refused(refusal)
            }
        }
    }

    /// Compare and swap. A commit that has already happened is answered again, so that a host may repeat it.
    fn commit(&mut self, hash: u32, base_generation: u32) -> Report {
        let newest = self.pending.unwrap_or(self.active);
        if newest.generation == base_generation.wrapping_add(1) && newest.hash == hash {
            return Report::Committed { generation: newest.generation, hash };
        }
        if newest.generation != base_generation {
            return Report::Nack(Nack::WrongGeneration { generation: newest.generation });
        }
        let Some(settings) = self.staged.filter(|s| settings_hash(s) == hash) else {
            return Report::Nack(Nack::NotStaged { staged: self.staged.map_or(0, |s| settings_hash(&s)) });
        };
        let version = Version { generation: base_generation.wrapping_add(1), hash, settings };
        self.staged = None;
        match self.frame {
            Some(_) => self.pending = Some(version),
            None => self.active = version,
        }
        Report::Committed { generation: version.generation, hash }
    }

    fn read_settings(&self) -> Report {
        let Version { generation, hash, settings } = self.active;
        Report::Settings { generation, hash, settings }
    }

    fn read_beams(&mut self, frame: u32, first: u32, count: u16) -> Answer {
        let beams = self.pattern.beams();
        let fits = (1..=BEAMS_PER_REPORT).contains(&usize::from(count));
        let end = first.checked_add(u32::from(count)).filter(|&end| fits && end <= beams);
        let Some(end) = end else { return nack(Nack::NoSuchBeams { beams }) };
        self.frame = Some(Frame { number: frame, complete: end == beams });
        Answer::Measure { frame, first, count }
    }

    /// A frame boundary: what was committed during the frame takes its place.
    fn end_frame_before(&mut self, command: &Command) {
        let Some(open) = self.frame else { return };
        let ends = match command {
            Command::ReadBeams { frame, .. } => *frame != open.number,
            _ => open.complete,
        };
        if ends {
            self.end_frame();
        }
    }

    fn end_frame(&mut self) {
        self.frame = None;
        self.active = self.pending.take().unwrap_or(self.active);
    }
}

fn nack(reason: Nack) -> Answer {
    Answer::Report(Report::Nack(reason))
}

#[cfg(test)]
mod tests {
    use super::*;

    const PATTERN: ScanPattern = ScanPattern { columns: 10, rows: 10, azimuth_cdeg: 18_000, elevation_cdeg: 9_000 };

    fn opened() -> Session {
        let mut session = Session::new(Hardware::REFERENCE, PATTERN, "test");
        session.handle(Command::Hello(Greeting::OURS));
        session
    }

    fn report(session: &mut Session, command: Command) -> Report {
        match session.handle(command) {
            Answer::Report(report) => report,
            Answer::Measure { .. } => panic!("a report was expected"),
        }
    }

    fn stage(session: &mut Session, gain_cdb: i32) -> u32 {
        match report(session, Command::Stage(Settings { gain_cdb, ..Settings::default() })) {
            Report::Staged { hash } => hash,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn nothing_is_answered_before_a_matching_hello() {
        let mut session = Session::new(Hardware::REFERENCE, PATTERN, "test");
        assert_eq!(report(&mut session, Command::ReadSettings), Report::Nack(Nack::NotReady));
        let other = Greeting { schema: SCHEMA ^ 1, ..Greeting::OURS };
        let Report::Hello { greeting, .. } = report(&mut session, Command::Hello(other)) else { panic!() };
        assert_eq!(greeting, Greeting::OURS);
        assert_eq!(report(&mut session, Command::ReadSettings), Report::Nack(Nack::NotReady));
    }

    #[test]
    fn a_commit_said_twice_is_answered_twice_and_happens_once() {
        let mut session = opened();
        let hash = stage(&mut session, 100);
        for _ in 0..2 {
            let answer = report(&mut session, Command::Commit { hash, base_generation: 0 });
            assert_eq!(answer, Report::Committed { generation: 1, hash });
        }
        assert_eq!(session.settings().gain_cdb, 100);
    }

    #[test]
    fn a_commit_on_another_generation_changes_nothing() {
        let mut session = opened();
        let hash = stage(&mut session, 100);
        let answer = report(&mut session, Command::Commit { hash, base_generation: 7 });
        assert_eq!(answer, Report::Nack(Nack::WrongGeneration { generation: 0 }));
        let answer = report(&mut session, Command::Commit { hash: hash ^ 1, base_generation: 0 });
        assert_eq!(answer, Report::Nack(Nack::NotStaged { staged: hash }));
        assert_eq!(*session.settings(), Settings::default());
    }

    #[test]
    fn a_refused_set_leaves_the_staged_and_the_active_one() {
        let mut session = opened();
        let hash = stage(&mut session, 100);
        let refused = report(&mut session, Command::Stage(Settings { gain_cdb: 9_999, ..Settings::default() }));
        assert!(matches!(refused, Report::Refused(_)));
        assert_eq!(*session.settings(), Settings::default());
        let answer = report(&mut session, Command::Commit { hash, base_generation: 0 });
        assert_eq!(answer, Report::Committed { generation: 1, hash });
    }

    #[test]
    fn settings_change_only_between_frames() {
        let mut session = opened();
        let read = |session: &mut Session, frame, first| {
            session.handle(Command::ReadBeams { frame, first, count: 20 });
            session.version().0
        };
        assert_eq!(read(&mut session, 1, 0), 0);
        let hash = stage(&mut session, 100);
        report(&mut session, Command::Commit { hash, base_generation: 0 });
        for first in [20, 40, 60, 80, 80] {
            assert_eq!(read(&mut session, 1, first), 0, "in the frame, its last beams asked again too");
        }
        assert_eq!(read(&mut session, 2, 0), 1, "in the next");
    }

    #[test]
    fn a_finished_frame_does_not_hold_a_commit_up() {
        let mut session = opened();
        session.handle(Command::ReadBeams { frame: 1, first: 80, count: 20 });
        let hash = stage(&mut session, 100);
        report(&mut session, Command::Commit { hash, base_generation: 0 });
        assert_eq!(session.version(), (1, hash));
    }

    #[test]
    fn a_hello_ends_the_frame_that_another_session_left_open() {
        let mut session = opened();
        session.handle(Command::ReadBeams { frame: 1, first: 0, count: 20 });
        let hash = stage(&mut session, 100);
        report(&mut session, Command::Commit { hash, base_generation: 0 });
        assert_eq!(session.version().0, 0, "the frame is open");
        report(&mut session, Command::Hello(Greeting::OURS));
        assert_eq!(session.version(), (1, hash));
    }

    #[test]
    fn beams_that_do_not_exist_are_refused() {
        let mut session = opened();
        for (first, count) in [(0, 0), (0, 33), (90, 20), (u32::MAX, 1)] {
            let answer = report(&mut session, Command::ReadBeams { frame: 1, first, count });
            assert_eq!(answer, Report::Nack(Nack::NoSuchBeams { beams: 100 }), "{first} {count}");
        }
    }
}
