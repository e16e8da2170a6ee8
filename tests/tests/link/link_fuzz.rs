//! A million frames over a line with every fault at a rate of one in twenty: no wrong settings are
//! committed, confirmed or saved, and every command ends in time. After every other command that
//! was given up, the line is good for a while, and the next command is done within a bound. Time is
//! simulated, so the load of the machine does not count.
//!
//! `cargo xtask storm` sends ten million: `ECHOLOOP_FRAMES`, and `ECHOLOOP_SEED` for others.

use std::collections::HashMap;
use std::time::{Duration, Instant};

use echoloop_dsp::{Grid, Hardware, ScanPattern, Settings};
use echoloop_link::Nack;
use echoloop_sensor::store;
use echoloop_sensors::boards::nor_flash::RamNorFlash;
use echoloop_sensors::boards::pc::PcSensor;
use echoloop_sensors::client::{Client, ClientError, RetryPolicy};
use echoloop_sensors::transport::InProcess;
use echoloop_tests::faults::{Faulty, Rates, Target};
use echoloop_tests::vectors;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

type Line = Faulty<InProcess<Target>>;

const HARDWARE: Hardware = Hardware::REFERENCE;
const RETRY_POLICY: RetryPolicy = RetryPolicy { timeout: Duration::from_millis(200), tries: 8 };

/// Time within which every command is answered or given up: all its timeouts, and its frames.
const COMMAND: Duration = Duration::from_millis(8 * 200 + 40);

/// Time within which a good line configures the sensor and scans, whatever the faults left behind:
/// half a frame, delayed answers, a restarted sensor. Some ten frames take as long, so there is no
/// timeout in it.
const RECOVERY: Duration = Duration::from_millis(20);

/// Number of frames in both directions.
const FRAMES: u64 = 1_000_000;

/// Number from the environment.
fn number(name: &str, usual: u64) -> u64 {
    std::env::var(name).map_or(usual, |text| text.parse().unwrap())
}

fn sensor(store: RamNorFlash) -> InProcess<Target> {
    let pattern = ScanPattern::Grid(Grid { columns: 2, rows: 1, ..Grid::default() });
    InProcess(PcSensor::with_store(Target::default(), pattern, HARDWARE, store))
}

/// A program that tunes a sensor, and an observer of the sensor.
///
/// A command that was given up may still arrive until a later one has been answered; until then
/// its settings may become active.
struct LinkFuzz {
    client: Client<Line>,
    rng: ChaCha8Rng,
    /// Active settings.
    active: Settings,
    /// Settings that may become active by the end of a trial or a late command.
    returning: Vec<Settings>,
    /// Settings that the next start may load.
    saved: Vec<Option<Settings>>,
    /// Settings of each generation since the last start.
    names: HashMap<u32, Settings>,
    frame: u32,
    count: Count,
    /// Longest recovery.
    recovery: Duration,
}

/// Numbers of operations by result.
#[derive(Debug, Default)]
struct Count {
    done: u64,
    /// Without an answer in time.
    silent: u64,
    /// Answered with a refusal that the line can cause.
    nacked: u64,
    starts: u64,
    rollbacks: u64,
    /// Recoveries on a good line after a command that was given up, or a start.
    recoveries: u64,
}

/// Result of an operation; `None` when it was not done.
type Done<T> = Option<T>;

impl LinkFuzz {
    fn new(seed: u64, rates: Rates) -> Self {
        let mut line = Faulty::new(sensor(RamNorFlash::default()), seed);
        line.rates = Rates::NONE;
        let mut client = Client::connect_from(line, RETRY_POLICY, 0).unwrap();
        client.transport_mut().rates = rates;
        let settings = Settings::default();
        Self {
            client,
            rng: vectors::rng(seed ^ 0xFFFF),
            active: settings,
            returning: vec![settings],
            saved: vec![None],
            names: HashMap::new(),
            frame: 0,
            count: Count::default(),
            recovery: Duration::ZERO,
        }
    }

    fn sensor(&mut self) -> &mut PcSensor<Target> {
        &mut self.client.transport_mut().inner.0
    }

    /// Active and saved settings, with the sensor's invariants checked.
    fn look(&mut self) -> (Settings, Option<Settings>) {
        let session = self.sensor().session();
        let (settings, (generation, hash)) = (*session.settings(), session.version());
        assert_eq!(hash, echoloop_link::settings_hash(&settings));
        assert_eq!(settings.check(&HARDWARE), Ok(()));
        let named = *self.names.entry(generation).or_insert(settings);
        assert_eq!(named, settings, "generation {generation} named other settings before");
        let saved = store::load(self.sensor().store_mut(), &HARDWARE).map(|saved| saved.settings);
        (settings, saved)
    }

    /// Counts the result of an operation; panics at one that the line cannot cause.
    fn judge<T>(&mut self, what: &str, result: Result<T, ClientError>) -> Done<T> {
        match result {
            Ok(value) => {
                self.count.done += 1;
                return Some(value);
            }
            Err(ClientError::Silent { .. }) => self.count.silent += 1,
            Err(ClientError::Changed { .. } | ClientError::Mixed { .. }) => self.count.nacked += 1,
            Err(ClientError::Nack(
                Nack::NotReady
                | Nack::Overtaken { .. }
                | Nack::NotStaged { .. }
                | Nack::WrongGeneration { .. }
                | Nack::NotActive { .. }
                | Nack::OnTrial,
            )) => self.count.nacked += 1,
            Err(other) => panic!("{what}: {other}"),
        }
        None
    }

    /// Checks after an operation that the active settings were active, may return, or were wanted.
    /// Once it is answered, only the settings before a trial can still return.
    fn settle(&mut self, what: &str, done: bool, wanted: Option<Settings>) {
        let (active, saved) = self.look();
        self.returning.extend(wanted);
        let asked = done && what == "configure";
        assert!(
            asked || active == self.active || self.returning.contains(&active),
            "{what}: {active:?}"
        );
        assert!(self.saved.contains(&saved), "{what}: {saved:?}");
        self.active = active;
        if done {
            self.saved = vec![saved];
        }
        if done && !self.sensor().session().on_trial() {
            self.returning = vec![active];
        }
    }

    fn draw(&mut self) -> Settings {
        Settings {
            gain_cdb: self.rng.random_range(-900..=3_000),
            noise_floor_ppm: self.rng.random_range(4_000..5_000),
            ..Settings::default()
        }
    }

    fn configure(&mut self, wanted: Settings, frames: u16) -> bool {
        let result = self.client.configure_on_trial(&wanted, frames);
        let done = self.judge("configure", result).is_some();
        if done {
            assert_eq!(self.look().0, wanted, "configure was answered");
        }
        // Without an answer, the command may arrive late and make these settings active.
        self.settle("configure", done, (!done).then_some(wanted));
        done
    }

    fn scan(&mut self) -> bool {
        self.frame += 1;
        let result = self.client.scan(self.frame);
        let beams = self.judge("scan", result);
        // A trial may end when a scan begins, so the echoes tell which settings were active.
        if let Some(beams) = &beams {
            let seen = beams.iter().all(|beam| beam.len() == 1);
            assert_eq!(seen, self.look().0.gain_cdb >= -900, "{:?}", self.active);
        }
        self.settle("scan", beams.is_some(), None);
        beams.is_some()
    }

    fn confirm(&mut self) {
        let wanted = self.active;
        let result = self.client.confirm();
        let done = self.judge("confirm", result).is_some();
        if done {
            assert_eq!(self.look().0, wanted, "confirm was answered");
            assert!(!self.sensor().session().on_trial());
        }
        self.settle("confirm", done, Some(wanted));
    }

    fn save(&mut self) {
        let wanted = self.active;
        let result = self.client.save();
        let done = self.judge("save", result).is_some();
        if done {
            assert_eq!(self.look().1, Some(wanted), "save was answered");
        }
        self.saved.push(Some(wanted));
        self.settle("save", done, None);
    }

    fn forget(&mut self) {
        let result = self.client.forget();
        let done = self.judge("forget", result).is_some();
        if done {
            assert_eq!(self.look().1, None, "forget was answered");
        }
        self.saved.push(None);
        self.settle("forget", done, None);
    }

    /// Switches the sensor's power off and on, without the program's knowledge.
    fn restart(&mut self) {
        self.count.rollbacks += u64::from(self.sensor().session().counters.rollbacks);
        let store = self.sensor().store_mut().clone();
        self.client.transport_mut().inner = sensor(store);
        self.names.clear();
        let (active, _) = self.look();
        assert!(
            self.saved.iter().any(|saved| saved.unwrap_or_default() == active),
            "a start with {active:?}"
        );
        (self.active, self.returning) = (active, vec![active]);
        self.count.starts += 1;
    }

    /// Tries settings before confirming them.
    fn trial(&mut self) {
        let blind = self.rng.random_bool(0.1);
        let mut wanted = self.draw();
        if blind {
            wanted.gain_cdb = -1_000;
        }
        let frames = self.rng.random_range(1..=3);
        if !self.configure(wanted, frames) {
            return;
        }
        for _ in 0..self.rng.random_range(0..4) {
            if !self.scan() {
                return;
            }
        }
        if self.rng.random_bool(0.6) {
            self.confirm();
        }
    }

    /// Configures and scans over a good line, within the bound.
    fn recover(&mut self) {
        let rates = std::mem::replace(&mut self.client.transport_mut().rates, Rates::NONE);
        let began = self.client.transport_mut().now;
        let wanted = self.draw();
        // The first may find that the sensor has lost the session, or that a trial has ended.
        let done = self.configure(wanted, 0) || self.configure(wanted, 0);
        assert!(done, "configured over a good line");
        assert!(self.scan(), "scanned over a good line");
        let took = self.client.transport_mut().now - began;
        assert!(took <= RECOVERY, "it took {took:?} to recover");
        self.recovery = self.recovery.max(took);
        self.count.recoveries += 1;
        self.client.transport_mut().rates = rates;
    }

    /// Makes a step; recovers after every other one that was given up.
    fn step_and_recover(&mut self) {
        let before = (self.count.silent, self.count.starts);
        self.step();
        if before != (self.count.silent, self.count.starts) && self.rng.random_bool(0.5) {
            self.recover();
        }
    }

    fn step(&mut self) {
        match self.rng.random_range(0..100) {
            0..50 => {
                let wanted = self.draw();
                self.configure(wanted, 0);
            }
            50..60 => self.trial(),
            60..70 => {
                self.scan();
            }
            70..80 => {
                let result = self.client.read_settings();
                let read = self.judge("read settings", result);
                assert!(read.is_none_or(|read| read == self.look().0), "active settings are read");
                self.settle("read settings", read.is_some(), None);
            }
            80..90 => {
                let result = self.client.read_counters();
                let done = self.judge("read counters", result).is_some();
                self.settle("read counters", done, None);
            }
            90..95 => self.save(),
            95..97 => self.forget(),
            97..99 => self.confirm(),
            _ if self.rng.random_bool(0.1) => self.restart(),
            _ => {}
        }
    }
}

/// Runs a number of frames over a line with these faults.
fn fuzz(seed: u64, rates: Rates, frames: u64) -> LinkFuzz {
    let mut run = LinkFuzz::new(seed, rates);
    let began = Instant::now();
    while run.client.transport_mut().carried.iter().sum::<u64>() < frames {
        run.step_and_recover();
    }
    let line = run.client.transport_mut();
    line.tries.end(line.now);
    let longest = line.tries.longest;
    assert!(longest <= COMMAND, "a command took {longest:?}");
    let seconds = began.elapsed().as_secs_f64();
    run.restart(); // counts the last start's rollbacks
    let recovery = run.recovery;
    let line = run.client.transport_mut();
    let [sent, answered] = line.carried;
    println!("{rates:?}, seed {seed}");
    println!("  {sent} frames sent, {answered} answered, {} harms", line.harmed);
    println!("  {:.0} frames/s; {:?}", (sent + answered) as f64 / seconds, run.count);
    let (line_s, tries) = (line.now.as_secs(), &line.tries.commands[1..]);
    println!("  commands by tries, from 1: {tries:?}");
    println!(
        "  {line_s} s of the line; the longest command {longest:?} of {COMMAND:?}, the longest \
         recovery {recovery:?} of {RECOVERY:?}"
    );
    run
}

#[test]
fn a_storm_of_a_million_frames_commits_nothing_wrong_and_every_recovery_is_in_time() {
    let seed = number("ECHOLOOP_SEED", 41);
    let frames = number("ECHOLOOP_FRAMES", FRAMES);
    let mut run = fuzz(seed, Rates::all(0.05), frames);
    let tries = std::mem::take(&mut run.client.transport_mut().tries.commands);
    let count = &run.count;
    assert!(count.rollbacks > frames / 1_000 && count.starts > frames / 10_000, "{count:?}");
    assert!(count.done > 1_000 * count.silent && count.recoveries > frames / 20_000, "{count:?}");
    assert!(tries.len() <= 1 + RETRY_POLICY.tries as usize, "{tries:?}");
    // Nine of ten repeated commands are answered by the third repetition: one good frame in each
    // direction is enough.
    let repeated: u64 = tries[2..].iter().sum();
    assert!(10 * tries[2..5].iter().sum::<u64>() > 9 * repeated, "{tries:?}");
}

#[test]
fn every_fault_alone_and_all_at_high_rates_commit_nothing_wrong() {
    let none = Rates::NONE;
    let table = [
        Rates { drop: 0.3, ..none },
        Rates { flip: 0.3, ..none },
        Rates { duplicate: 0.5, ..none },
        Rates { reorder: 0.3, ..none },
        Rates { truncate: 0.3, ..none },
        Rates { delay: 0.3, ..none },
        Rates { reorder: 0.1, delay: 0.2, duplicate: 0.2, ..none },
        Rates::all(0.1),
        Rates::all(0.2),
    ];
    for (seed, rates) in (50..).zip(table) {
        let run = fuzz(seed, rates, FRAMES / 20);
        assert!(run.count.done > 500, "{rates:?}: {:?}", run.count);
    }
}
