//! A million frames over a line that does every harm to one in twenty: nothing wrong is
//! committed, confirmed or saved, every command ends within its time, and where the line is
//! good again, which it is after every other command that was given up, the next one is done
//! within a bound. Time is the line's, so that no load of this machine counts.
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

/// Within so long every command is answered or given up: all its waits, and frames on the line.
const COMMAND: Duration = Duration::from_millis(8 * 200 + 40);

/// Within so long a line that is good again carries a set of settings to the sensor, and the
/// echoes of a scan back: as long as some ten frames take. Not one wait is lost, whatever the storm
/// left behind: half a frame, answers held back, a sensor that has started anew.
const RECOVERY: Duration = Duration::from_millis(20);

/// Frames to send and answers to get.
const FRAMES: u64 = 1_000_000;

/// A number of the environment.
fn number(name: &str, usual: u64) -> u64 {
    std::env::var(name).map_or(usual, |text| text.parse().unwrap())
}

fn sensor(store: RamNorFlash) -> InProcess<Target> {
    let pattern = ScanPattern::Grid(Grid { columns: 2, rows: 1, ..Grid::default() });
    InProcess(PcSensor::with_store(Target::default(), pattern, HARDWARE, store))
}

/// A program that tunes a sensor, and what an observer sees that the program cannot.
///
/// A command that was given up may still be under way, and act until a later one has been answered;
/// so what it asked for stays possible until then.
struct LinkFuzz {
    client: Client<Line>,
    rng: ChaCha8Rng,
    /// What is active.
    active: Settings,
    /// What may be active next without being asked for: a trial ends, or a command comes late.
    returning: Vec<Settings>,
    /// What the next start may begin with.
    saved: Vec<Option<Settings>>,
    /// What each generation since the last start named.
    names: HashMap<u32, Settings>,
    frame: u32,
    count: Count,
    /// The longest that it took to recover.
    recovery: Duration,
}

/// What became of the operations.
#[derive(Debug, Default)]
struct Count {
    done: u64,
    /// No answer in time.
    silent: u64,
    /// Answered with a reason, all of which the line can bring about.
    nacked: u64,
    starts: u64,
    rollbacks: u64,
    /// Times that the line was good again after a command had been given up, or a start.
    recoveries: u64,
}

/// Whether an operation was done; `None`: it says it was not.
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

    /// What is active now, checked against everything that may not be.
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

    /// Counts what an operation came to; anything the line cannot bring about ends the test.
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

    /// After an operation: what is active was so, or may return, or was wanted. Once it is answered
    /// nothing else is possible any more, but for what a trial returns to.
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
        // Answered, it returns from no trial but its own; that it was wanted matters when it comes
        // late.
        self.settle("configure", done, (!done).then_some(wanted));
        done
    }

    fn scan(&mut self) -> bool {
        self.frame += 1;
        let result = self.client.scan(self.frame);
        let beams = self.judge("scan", result);
        // A scan begins with the boundary at which a trial may end; it says whose echoes it holds.
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

    /// The sensor's power goes and comes back; the program does not know.
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

    /// Sees whether settings are any good before it keeps them.
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

    /// The line is good from now on: new settings and a scan with them, within the bound.
    fn recover(&mut self) {
        let rates = std::mem::replace(&mut self.client.transport_mut().rates, Rates::NONE);
        let began = self.client.transport_mut().now;
        let wanted = self.draw();
        // The first may find that the sensor knows nothing of a session, or that a trial ended.
        let done = self.configure(wanted, 0) || self.configure(wanted, 0);
        assert!(done, "configured over a good line");
        assert!(self.scan(), "scanned over a good line");
        let took = self.client.transport_mut().now - began;
        assert!(took <= RECOVERY, "it took {took:?} to recover");
        self.recovery = self.recovery.max(took);
        self.count.recoveries += 1;
        self.client.transport_mut().rates = rates;
    }

    /// A step of the program, and after every other one that was given up a good line.
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
                assert!(read.is_none_or(|read| read == self.look().0), "what is read is active");
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

/// So many frames over a line of these faults, and what became of them; the tries are those of
/// whole commands.
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
    run.restart(); // adds up the last life
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
fn a_storm_of_a_million_frames_does_nothing_wrong_and_every_recovery_has_its_bound() {
    let seed = number("ECHOLOOP_SEED", 41);
    let frames = number("ECHOLOOP_FRAMES", FRAMES);
    let mut run = fuzz(seed, Rates::all(0.05), frames);
    let tries = std::mem::take(&mut run.client.transport_mut().tries.commands);
    let count = &run.count;
    assert!(count.rollbacks > frames / 1_000 && count.starts > frames / 10_000, "{count:?}");
    assert!(count.done > 1_000 * count.silent && count.recoveries > frames / 20_000, "{count:?}");
    assert!(tries.len() <= 1 + RETRY_POLICY.tries as usize, "{tries:?}");
    // Nine of ten commands that were harmed are answered by the third repetition: one good frame
    // each way is enough.
    let repeated: u64 = tries[2..].iter().sum();
    assert!(10 * tries[2..5].iter().sum::<u64>() > 9 * repeated, "{tries:?}");
}

#[test]
fn every_harm_alone_and_all_of_them_at_their_worst_do_nothing_wrong() {
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
