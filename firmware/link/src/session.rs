//! The sensor's side of the conversation: hello, stage → check → commit → confirm, frame
//! boundaries.

use echoloop_dsp::{Echoes, Hardware, ScanPattern, Settings};
use heapless::String;

use crate::message::{
    BEAMS_PER_REPORT, Command, Counters, Greeting, Nack, Noise, Place, Report, settings_hash,
};

/// Settings with generation and hash, by which they are named.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Version {
    generation: u32,
    hash: u32,
    settings: Settings,
    /// Number of frames of their trial as committed; 0: no trial.
    confirm_within: u16,
}

/// Trial of the active settings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Trial {
    /// Number of frames left to confirm in; never 0.
    left: u16,
    /// Settings that return without a confirmation.
    good: Settings,
}

/// Scan being read. It stays open until its last beam has been sent and another command comes, so
/// that the last beams can be asked for again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Frame {
    number: u32,
    complete: bool,
    /// Number of beams measured from the first on, without a gap.
    measured: u32,
    /// True when any beam had an echo.
    seen: bool,
}

/// Action that a command asks of the sensor.
#[derive(Clone, Debug, PartialEq)]
#[allow(
    clippy::large_enum_variant,
    reason = "lives for one answer, and there is no heap to box it on"
)]
pub enum Answer<'a> {
    /// Send this report.
    Report(Report),
    /// Measure these beams with the active settings, pass them to [`Session::measured`], and send
    /// them.
    Measure {
        /// Number of the scan.
        frame: u32,
        /// Index of the first beam.
        first: u32,
        /// Number of beams, 1 to [`BEAMS_PER_REPORT`].
        count: u16,
        /// Scan and seed that decide the noise of a simulated front end, if the host gave them.
        noise: Option<Noise>,
    },
    /// Take these codes as those of shots with the active settings, pass the beams that they
    /// complete to [`Session::measured`], and send those beams.
    Take {
        /// Number of the scan.
        frame: u32,
        /// Place of the first code. The beam exists.
        from: Place,
        /// Codes.
        packed: &'a [u8],
    },
    /// Report the room for waveforms.
    TellRoom,
    /// Set the deadline of scans, and report it.
    SetDeadline {
        /// Longest time that the sensor may be busy for a scan, µs; 0: no limit.
        scan_us: u32,
    },
    /// Report the times that scans have taken.
    TellTimes,
    /// Store these settings, unless they are stored already.
    Save {
        /// Active settings.
        settings: Settings,
        /// Hash of the settings.
        hash: u32,
    },
    /// Erase the stored settings.
    Forget,
}

/// State of the conversation. It holds whole sets of settings: staged, active, or waiting for the
/// frame to end.
///
/// Invariants, from start to start:
///
/// * the active settings passed [`Settings::check`] and [`ScanPattern::aimed`];
/// * they change only between frames;
/// * a generation always names the same set of settings: those that return after a trial get a new
///   one;
/// * only active settings that are not on trial are saved.
#[derive(Clone, Debug)]
pub struct Session {
    hardware: Hardware,
    /// Scan pattern as the sensor has it.
    own_pattern: ScanPattern,
    /// Scan pattern with the aim of the active settings.
    pattern: ScanPattern,
    build: &'static str,
    ready: bool,
    staged: Option<Settings>,
    active: Version,
    /// Trial of the active settings, if they are on trial.
    trial: Option<Trial>,
    /// Settings committed while a frame was open; they become active when it ends.
    pending: Option<Version>,
    frame: Option<Frame>,
    /// Number of scans begun, wrapping.
    begun: u32,
    /// Counters of the link.
    pub counters: Counters,
}

impl Session {
    /// Session of a sensor that starts with these settings as generation 0, or with the defaults
    /// when they do not pass the check.
    pub fn new(
        hardware: Hardware,
        pattern: ScanPattern,
        build: &'static str,
        settings: Settings,
    ) -> Self {
        let is_possible = settings.check(&hardware).and(pattern.aimed(&settings)).is_ok();
        let settings = if is_possible { settings } else { Settings::default() };
        Self {
            hardware,
            own_pattern: pattern,
            pattern: pattern.aimed(&settings).unwrap_or(pattern),
            build,
            ready: false,
            staged: None,
            active: Version {
                generation: 0,
                hash: settings_hash(&settings),
                settings,
                confirm_within: 0,
            },
            trial: None,
            pending: None,
            frame: None,
            begun: 0,
            counters: Counters::default(),
        }
    }

    /// Active settings.
    pub fn settings(&self) -> &Settings {
        &self.active.settings
    }

    /// Scan pattern with the aim of the active settings.
    pub fn pattern(&self) -> &ScanPattern {
        &self.pattern
    }

    /// Generation and hash of the active settings.
    pub fn version(&self) -> (u32, u32) {
        (self.active.generation, self.active.hash)
    }

    /// True when the active settings are on trial.
    pub fn on_trial(&self) -> bool {
        self.trial.is_some()
    }

    /// True when a matching hello has come.
    pub fn is_open(&self) -> bool {
        self.ready
    }

    /// Index of the open scan since the start, from 1, wrapping, and true when all its beams have
    /// been measured; `None` when no scan is open. The same number in another session is another
    /// scan.
    pub fn open_scan(&self) -> Option<(u32, bool)> {
        self.frame.map(|frame| (self.begun, frame.measured == self.pattern.beams()))
    }

    /// Handles a command.
    pub fn handle<'a>(&mut self, command: Command<'a>) -> Answer<'a> {
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
            Command::Commit { hash, base_generation, confirm_within } => {
                Answer::Report(self.commit(hash, base_generation, confirm_within))
            }
            Command::ReadSettings => Answer::Report(self.read_settings()),
            Command::ReadBeams { frame, first, count } => {
                self.read_beams(frame, first, count, None)
            }
            Command::ReadNoisyBeams { frame, first, count, noise } => {
                self.read_beams(frame, first, count, Some(noise))
            }
            Command::ReadCounters => Answer::Report(Report::Counters(self.counters)),
            Command::Confirm { generation } => Answer::Report(self.confirm(generation)),
            Command::Save { hash } => self.save(hash),
            Command::Forget => Answer::Forget,
            Command::ReadRoom => Answer::TellRoom,
            Command::SetDeadline { scan_us } => Answer::SetDeadline { scan_us },
            Command::ReadTimes => Answer::TellTimes,
            Command::Waveforms { frame, from, packed } => self.take(frame, from, packed),
        }
    }

    /// Records the beams measured for an [`Answer::Measure`] or an [`Answer::Take`]: a trial needs
    /// echoes.
    pub fn measured(&mut self, first: u32, beams: &[Echoes]) {
        let Some(frame) = &mut self.frame else { return };
        frame.seen |= beams.iter().any(|echoes| !echoes.is_empty());
        let end = first.saturating_add(beams.len() as u32);
        if !beams.is_empty() {
            frame.complete = end == self.pattern.beams();
        }
        if first <= frame.measured {
            frame.measured = frame.measured.max(end);
        }
    }

    /// Answers with our greeting in any case; the session opens only when theirs is the same. An
    /// open scan ends, so that the new session reads the settings committed during it. A trial ends
    /// too: its host is gone and cannot confirm it.
    fn hello(&mut self, theirs: Greeting) -> Report {
        self.ready = theirs == Greeting::OURS;
        self.staged = None;
        self.end_frame();
        self.roll_back();
        Report::Hello {
            greeting: Greeting::OURS,
            build: self.build.chars().take(32).fold(String::new(), |mut text, c| {
                let _ = text.push(c); // a longer name is cut
                text
            }),
            hardware: self.hardware,
            pattern: self.own_pattern,
        }
    }

    fn stage(&mut self, settings: Settings) -> Report {
        match settings.check(&self.hardware).and(self.own_pattern.aimed(&settings)) {
            Ok(_) => {
                self.staged = Some(settings);
                Report::Staged { hash: settings_hash(&settings) }
            }
            Err(refusal) => {
                self.counters.refusals = self.counters.refusals.wrapping_add(1);
                Report::Refused(refusal)
            }
        }
    }

    /// Commits by compare and swap. A commit that has already happened is answered again, so that a
    /// host can repeat it.
    fn commit(&mut self, hash: u32, base_generation: u32, confirm_within: u16) -> Report {
        let newest = self.pending.unwrap_or(self.active);
        let generation = base_generation.wrapping_add(1);
        if (newest.generation, newest.hash, newest.confirm_within)
            == (generation, hash, confirm_within)
        {
            return Report::Committed { generation, hash };
        }
        if newest.generation != base_generation {
            return Report::Nack(Nack::WrongGeneration { generation: newest.generation });
        }
        let Some(settings) = self.staged.filter(|s| settings_hash(s) == hash) else {
            return Report::Nack(Nack::NotStaged {
                staged: self.staged.map_or(0, |s| settings_hash(&s)),
            });
        };
        let version = Version { generation, hash, settings, confirm_within };
        self.staged = None;
        match self.frame {
            Some(_) => self.pending = Some(version),
            None => self.activate(version),
        }
        Report::Committed { generation, hash }
    }

    /// Ends the trial of the active settings, which stay. A repeated confirmation is answered
    /// again; settings that are not on trial count as confirmed.
    fn confirm(&mut self, generation: u32) -> Report {
        if generation != self.active.generation {
            return Report::Nack(Nack::WrongGeneration { generation: self.active.generation });
        }
        self.trial = None;
        Report::Confirmed { generation }
    }

    fn save(&self, hash: u32) -> Answer<'static> {
        let active = self.active;
        if hash != active.hash {
            return nack(Nack::NotActive { hash: active.hash });
        }
        if self.on_trial() {
            return nack(Nack::OnTrial);
        }
        Answer::Save { settings: active.settings, hash }
    }

    fn read_settings(&self) -> Report {
        let Version { generation, hash, settings, .. } = self.active;
        Report::Settings { generation, hash, settings }
    }

    fn read_beams(
        &mut self,
        number: u32,
        first: u32,
        count: u16,
        noise: Option<Noise>,
    ) -> Answer<'static> {
        let beams = self.pattern.beams();
        let fits = (1..=BEAMS_PER_REPORT).contains(&usize::from(count));
        let end = first.checked_add(u32::from(count)).filter(|&end| fits && end <= beams);
        let Some(end) = end else { return nack(Nack::NoSuchBeams { beams }) };
        self.open_frame(number).complete = end == beams;
        Answer::Measure { frame: number, first, count, noise }
    }

    fn take<'a>(&mut self, number: u32, from: Place, packed: &'a [u8]) -> Answer<'a> {
        let beams = self.pattern.beams();
        if from.beam >= beams {
            return nack(Nack::NoSuchBeams { beams });
        }
        self.open_frame(number); // complete when its last beam has been measured
        Answer::Take { frame: number, from, packed }
    }

    /// Continues the open frame, or begins one.
    fn open_frame(&mut self, number: u32) -> &mut Frame {
        if self.frame.is_none() {
            self.begun = self.begun.wrapping_add(1);
        }
        let begun = Frame { number, complete: false, measured: 0, seen: false };
        self.frame.get_or_insert(begun)
    }

    /// Ends the open frame if the command is beyond it: settings committed during the frame become
    /// active, and a trial is judged. A confirmation is handled before the frame that it follows
    /// ends.
    fn end_frame_before(&mut self, command: &Command<'_>) {
        let Some(open) = self.frame else { return };
        let ends = match command {
            Command::ReadBeams { frame, .. }
            | Command::ReadNoisyBeams { frame, .. }
            | Command::Waveforms { frame, .. } => *frame != open.number,
            Command::Confirm { .. } => false,
            _ => open.complete,
        };
        if ends {
            self.end_frame();
        }
    }

    fn end_frame(&mut self) {
        let Some(frame) = self.frame.take() else { return };
        match self.pending.take() {
            Some(version) => self.activate(version),
            None => self.judge(frame),
        }
    }

    /// Makes settings active. If they replace settings on trial, a rollback returns to those before
    /// both.
    fn activate(&mut self, version: Version) {
        let good = self.trial.map_or(self.active.settings, |trial| trial.good);
        self.active = version;
        self.aim();
        self.trial =
            (version.confirm_within > 0).then_some(Trial { left: version.confirm_within, good });
    }

    /// Aims the pattern by the active settings, which passed the check.
    fn aim(&mut self) {
        if let Ok(pattern) = self.own_pattern.aimed(&self.active.settings) {
            self.pattern = pattern;
        }
    }

    /// Ends a trial after its last frame, or after a whole frame without an echo.
    fn judge(&mut self, frame: Frame) {
        let Some(trial) = &mut self.trial else { return };
        trial.left = trial.left.saturating_sub(1);
        let blind = frame.measured == self.pattern.beams() && !frame.seen;
        if trial.left == 0 || blind {
            self.roll_back();
        }
    }

    /// Returns to the last good settings, under a new generation.
    fn roll_back(&mut self) {
        let Some(Trial { good: settings, .. }) = self.trial.take() else { return };
        let generation = self.active.generation.wrapping_add(1);
        self.active =
            Version { generation, hash: settings_hash(&settings), settings, confirm_within: 0 };
        self.aim();
        self.counters.rollbacks = self.counters.rollbacks.wrapping_add(1);
    }
}

fn nack(reason: Nack) -> Answer<'static> {
    Answer::Report(Report::Nack(reason))
}

#[cfg(test)]
mod tests {
    use echoloop_dsp::Grid;

    use super::*;
    use crate::message::SCHEMA;

    const PATTERN: ScanPattern = ScanPattern::Grid(Grid {
        columns: 10,
        rows: 10,
        azimuth_cdeg: 18_000,
        elevation_cdeg: 9_000,
    });

    fn opened() -> Session {
        let mut session = Session::new(Hardware::REFERENCE, PATTERN, "test", Settings::default());
        session.handle(Command::Hello(Greeting::OURS));
        session
    }

    fn report(session: &mut Session, command: Command<'_>) -> Report {
        match session.handle(command) {
            Answer::Report(report) => report,
            other => panic!("a report was expected, not {other:?}"),
        }
    }

    fn stage(session: &mut Session, gain_cdb: i32) -> u32 {
        match report(session, Command::Stage(Settings { gain_cdb, ..Settings::default() })) {
            Report::Staged { hash } => hash,
            other => panic!("{other:?}"),
        }
    }

    fn commit(
        session: &mut Session,
        hash: u32,
        base_generation: u32,
        confirm_within: u16,
    ) -> Report {
        report(session, Command::Commit { hash, base_generation, confirm_within })
    }

    /// Asks for 20 beams.
    fn read(session: &mut Session, frame: u32, first: u32) {
        session.handle(Command::ReadBeams { frame, first, count: 20 });
    }

    #[test]
    fn nothing_is_answered_before_a_matching_hello() {
        let mut session = Session::new(Hardware::REFERENCE, PATTERN, "test", Settings::default());
        assert_eq!(report(&mut session, Command::ReadSettings), Report::Nack(Nack::NotReady));
        let other = Greeting { schema: SCHEMA ^ 1, ..Greeting::OURS };
        let Report::Hello { greeting, .. } = report(&mut session, Command::Hello(other)) else {
            panic!()
        };
        assert_eq!(greeting, Greeting::OURS);
        assert_eq!(report(&mut session, Command::ReadSettings), Report::Nack(Nack::NotReady));
    }

    #[test]
    fn a_commit_sent_twice_is_answered_twice_and_acts_once() {
        let mut session = opened();
        let hash = stage(&mut session, 100);
        for _ in 0..2 {
            let answer = commit(&mut session, hash, 0, 0);
            assert_eq!(answer, Report::Committed { generation: 1, hash });
        }
        assert_eq!(session.settings().gain_cdb, 100);
    }

    #[test]
    fn a_commit_on_another_generation_changes_nothing() {
        let mut session = opened();
        let hash = stage(&mut session, 100);
        let answer = commit(&mut session, hash, 7, 0);
        assert_eq!(answer, Report::Nack(Nack::WrongGeneration { generation: 0 }));
        let answer = commit(&mut session, hash ^ 1, 0, 0);
        assert_eq!(answer, Report::Nack(Nack::NotStaged { staged: hash }));
        assert_eq!(*session.settings(), Settings::default());
    }

    #[test]
    fn a_refused_set_leaves_the_staged_and_the_active_one() {
        let mut session = opened();
        let hash = stage(&mut session, 100);
        let refused = report(
            &mut session,
            Command::Stage(Settings { gain_cdb: 9_999, ..Settings::default() }),
        );
        assert!(matches!(refused, Report::Refused(_)));
        assert_eq!(*session.settings(), Settings::default());
        let answer = commit(&mut session, hash, 0, 0);
        assert_eq!(answer, Report::Committed { generation: 1, hash });
    }

    #[test]
    fn settings_change_only_between_frames() {
        let mut session = opened();
        read(&mut session, 1, 0);
        assert_eq!(session.version().0, 0);
        let hash = stage(&mut session, 100);
        commit(&mut session, hash, 0, 0);
        for first in [20, 40, 60, 80, 80] {
            read(&mut session, 1, first);
            assert_eq!(session.version().0, 0, "in the frame, its last beams asked again too");
        }
        read(&mut session, 2, 0);
        assert_eq!(session.version().0, 1, "in the next");
    }

    #[test]
    fn a_finished_frame_does_not_hold_a_commit_up() {
        let mut session = opened();
        read(&mut session, 1, 80);
        let hash = stage(&mut session, 100);
        commit(&mut session, hash, 0, 0);
        assert_eq!(session.version(), (1, hash));
    }

    #[test]
    fn a_hello_ends_the_frame_that_another_session_left_open() {
        let mut session = opened();
        read(&mut session, 1, 0);
        let hash = stage(&mut session, 100);
        commit(&mut session, hash, 0, 0);
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

    /// Commits gain 1.00 dB on trial, as generation 1.
    fn on_trial(confirm_within: u16) -> (Session, u32) {
        let mut session = opened();
        let hash = stage(&mut session, 100);
        let answer = commit(&mut session, hash, 0, confirm_within);
        assert_eq!(answer, Report::Committed { generation: 1, hash });
        (session, hash)
    }

    /// Reads a whole frame; every beam has that many echoes.
    fn scan(session: &mut Session, number: u32, echoes: usize) {
        for first in (0..100).step_by(20) {
            read(session, number, first);
            let beam: Echoes = (0..echoes).map(|_| echoloop_dsp::Echo::default()).collect();
            session.measured(first, &core::array::from_fn::<_, 20, _>(|_| beam.clone()));
        }
    }

    fn gain(session: &Session) -> (u32, i32) {
        (session.version().0, session.settings().gain_cdb)
    }

    #[test]
    fn a_trial_that_nobody_confirms_ends_after_its_frames_under_a_new_name() {
        let (mut session, _) = on_trial(3);
        for number in 1..=3 {
            scan(&mut session, number, 1);
            assert_eq!(gain(&session), (1, 100), "frame {number}");
        }
        report(&mut session, Command::ReadSettings);
        assert_eq!(gain(&session), (2, 0));
        assert_eq!(session.counters.rollbacks, 1);
    }

    #[test]
    fn a_confirmed_trial_stays() {
        for frames in 0..=2 {
            let (mut session, _) = on_trial(2);
            (1..=frames).for_each(|number| scan(&mut session, number, 1));
            for _ in 0..2 {
                let answer = report(&mut session, Command::Confirm { generation: 1 });
                assert_eq!(answer, Report::Confirmed { generation: 1 }, "after {frames} frames");
            }
            (11..15).for_each(|number| scan(&mut session, number, 0));
            report(&mut session, Command::Hello(Greeting::OURS));
            assert_eq!(gain(&session), (1, 100));
            assert_eq!(session.counters.rollbacks, 0);
        }
    }

    #[test]
    fn a_confirmation_that_comes_too_late_changes_nothing() {
        let (mut session, _) = on_trial(1);
        scan(&mut session, 1, 1);
        scan(&mut session, 2, 1);
        let answer = report(&mut session, Command::Confirm { generation: 1 });
        assert_eq!(answer, Report::Nack(Nack::WrongGeneration { generation: 2 }));
        assert_eq!(gain(&session), (2, 0));
    }

    #[test]
    fn a_trial_without_a_single_echo_in_a_frame_ends_with_it() {
        let (mut session, _) = on_trial(100);
        scan(&mut session, 1, 1);
        scan(&mut session, 2, 0);
        assert_eq!(gain(&session), (1, 100), "in the frame");
        scan(&mut session, 3, 1);
        assert_eq!(gain(&session), (2, 0));
    }

    #[test]
    fn half_a_frame_without_an_echo_proves_nothing() {
        let (mut session, _) = on_trial(100);
        for number in 1..9 {
            read(&mut session, number, 80);
            session.measured(80, &core::array::from_fn::<_, 20, _>(|_| Echoes::new()));
        }
        assert_eq!(gain(&session), (1, 100));
    }

    #[test]
    fn settings_that_are_not_on_trial_may_find_no_echo() {
        let (mut session, _) = on_trial(0);
        (1..9).for_each(|number| scan(&mut session, number, 0));
        assert_eq!(gain(&session), (1, 100));
    }

    #[test]
    fn a_new_session_ends_a_trial() {
        let (mut session, _) = on_trial(100);
        report(&mut session, Command::Hello(Greeting::OURS));
        assert_eq!(gain(&session), (2, 0));
    }

    #[test]
    fn a_trial_after_a_trial_rolls_back_to_the_settings_before_both() {
        let (mut session, _) = on_trial(100);
        let hash = stage(&mut session, 200);
        commit(&mut session, hash, 1, 1);
        assert_eq!(gain(&session), (2, 200));
        scan(&mut session, 1, 1);
        report(&mut session, Command::ReadCounters);
        assert_eq!(gain(&session), (3, 0));
    }

    #[test]
    fn a_commit_in_a_trial_s_last_frame_takes_its_place() {
        let (mut session, _) = on_trial(1);
        read(&mut session, 1, 0);
        let hash = stage(&mut session, 200);
        commit(&mut session, hash, 1, 0);
        report(&mut session, Command::Hello(Greeting::OURS));
        assert_eq!(gain(&session), (2, 200));
        assert_eq!(session.counters.rollbacks, 0);
    }

    #[test]
    fn settings_that_wait_for_a_frame_to_end_cannot_be_confirmed_yet() {
        let mut session = opened();
        read(&mut session, 1, 80);
        read(&mut session, 1, 0);
        let hash = stage(&mut session, 100);
        commit(&mut session, hash, 0, 1);
        let answer = report(&mut session, Command::Confirm { generation: 1 });
        assert_eq!(answer, Report::Nack(Nack::WrongGeneration { generation: 0 }));
        scan(&mut session, 2, 1);
        assert_eq!(gain(&session), (1, 100));
    }

    #[test]
    fn a_trial_sent_twice_is_one_trial_and_no_other_commit() {
        let (mut session, hash) = on_trial(2);
        scan(&mut session, 1, 1);
        let again = commit(&mut session, hash, 0, 2);
        assert_eq!(again, Report::Committed { generation: 1, hash });
        let plain = commit(&mut session, hash, 0, 0);
        assert_eq!(
            plain,
            Report::Nack(Nack::WrongGeneration { generation: 1 }),
            "it would be no trial"
        );
        scan(&mut session, 2, 1);
        scan(&mut session, 3, 1);
        assert_eq!(gain(&session), (2, 0), "the repetition gave it no more frames");
    }

    #[test]
    fn only_active_settings_that_are_not_on_trial_are_saved() {
        let (mut session, hash) = on_trial(100);
        let before = settings_hash(&Settings::default());
        assert_eq!(
            report(&mut session, Command::Save { hash: before }),
            Report::Nack(Nack::NotActive { hash })
        );
        assert_eq!(report(&mut session, Command::Save { hash }), Report::Nack(Nack::OnTrial));
        report(&mut session, Command::Confirm { generation: 1 });
        let settings = *session.settings();
        assert_eq!(session.handle(Command::Save { hash }), Answer::Save { settings, hash });
    }

    #[test]
    fn a_start_with_refused_settings_has_the_defaults() {
        let settings = Settings { gain_cdb: 9_999, ..Settings::default() };
        let session = Session::new(Hardware::REFERENCE, PATTERN, "test", settings);
        assert_eq!(*session.settings(), Settings::default());
    }
}
