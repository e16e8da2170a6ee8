//! Campaign of many cases of one kind. Each case has its own random stream and verdict; none may
//! panic or hang. The report is one line.

use std::collections::BTreeMap;
use std::env;
use std::io::{Write, stderr};
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Time limit of a case.
const LIMIT: Duration = Duration::from_secs(60);

/// Interval of progress reports of a long campaign.
const NEWS: Duration = Duration::from_secs(5);

/// Result of a case: the name under which it is counted, or the failure.
pub(crate) type Verdict = Result<&'static str, String>;

/// Cases of a kind.
pub(crate) struct Campaign {
    /// Name of the kind's file.
    pub(crate) kind: &'static str,
    /// Number of cases in the test command.
    pub(crate) cases: u64,
}

/// Options of `cargo xtask attack`, from the environment.
struct Asked {
    cases: Option<u64>,
    seed: u64,
    /// The only case to run.
    case: Option<u64>,
}

impl Asked {
    fn from_environment() -> Self {
        let number = |name: &str| {
            let text = env::var(name).ok()?;
            Some(text.parse().unwrap_or_else(|_| panic!("{name} = {text} must be a number")))
        };
        Self {
            cases: number("ECHOLOOP_ATTACK_CASES"),
            seed: number("ECHOLOOP_ATTACK_SEED").unwrap_or(1),
            case: number("ECHOLOOP_ATTACK_CASE"),
        }
    }
}

/// Progress of a campaign.
struct Progress {
    began: Instant,
    /// Start of each running case.
    running: Mutex<BTreeMap<u64, Instant>>,
    verdicts: Mutex<BTreeMap<&'static str, u64>>,
    failures: Mutex<BTreeMap<u64, String>>,
    over: AtomicBool,
}

impl Campaign {
    /// Runs the cases on all threads; panics with the first failures.
    pub(crate) fn run(&self, case: impl Fn(&mut ChaCha8Rng) -> Verdict + Sync) {
        let asked = Asked::from_environment();
        let cases = asked.cases.unwrap_or(self.cases);
        let numbers = asked.case.map_or(0..cases, |case| case..case + 1);
        let progress = Progress::new();
        thread::scope(|scope| {
            scope.spawn(|| self.watch(&progress, cases, asked.cases.is_some()));
            work_off(numbers, |number| {
                progress.judge(number, || case(&mut stream(self.kind, asked.seed, number)));
            });
            progress.over.store(true, Ordering::Relaxed);
        });
        self.report(&progress, asked.seed);
    }

    /// Ends the process at a case that does not end; reports the progress of a long campaign.
    fn watch(&self, progress: &Progress, cases: u64, printing: bool) {
        let mut reported = Instant::now();
        while !progress.over.load(Ordering::Relaxed) {
            thread::sleep(Duration::from_millis(20));
            if let Some(case) = progress.stuck() {
                say(&format!("attack {}: case {case} has not ended after {LIMIT:?}", self.kind));
                std::process::exit(101);
            }
            if printing && reported.elapsed() >= NEWS {
                reported = Instant::now();
                say(&format!("attack {}: {} of {cases}", self.kind, progress.done()));
            }
        }
    }

    fn report(&self, progress: &Progress, seed: u64) {
        let failures = progress.failures.lock().expect("no panic holds it");
        let verdicts = progress.verdicts.lock().expect("no panic holds it");
        let counted: Vec<String> =
            verdicts.iter().map(|(name, count)| format!("{count} {name}")).collect();
        say(&format!(
            "attack {}: {} cases, seed {seed}, {:.0} s: {}, {} failed",
            self.kind,
            verdicts.values().sum::<u64>() + failures.len() as u64,
            progress.began.elapsed().as_secs_f64(),
            counted.join(", "),
            failures.len()
        ));
        let first: Vec<String> = failures
            .iter()
            .take(5)
            .map(|(case, what)| {
                format!(
                    "case {case}: {what}\n  again: cargo xtask attack --kind {} --seed {seed} \
                     --case {case}",
                    self.kind
                )
            })
            .collect();
        assert!(first.is_empty(), "{}", first.join("\n"));
    }
}

impl Progress {
    fn new() -> Self {
        Self {
            began: Instant::now(),
            running: Mutex::default(),
            verdicts: Mutex::default(),
            failures: Mutex::default(),
            over: AtomicBool::new(false),
        }
    }

    fn judge(&self, number: u64, case: impl FnOnce() -> Verdict) {
        self.running.lock().expect("no panic holds it").insert(number, Instant::now());
        let verdict = catch_unwind(AssertUnwindSafe(case)).unwrap_or_else(|panic| {
            let text = panic.downcast_ref::<String>().map(String::as_str);
            let text = text.or_else(|| panic.downcast_ref::<&str>().copied());
            Err(format!("panic: {}", text.unwrap_or("without a text")))
        });
        match verdict {
            Ok(name) => {
                *self.verdicts.lock().expect("no panic holds it").entry(name).or_default() += 1;
            }
            Err(what) => {
                self.failures.lock().expect("no panic holds it").insert(number, what);
            }
        }
        self.running.lock().expect("no panic holds it").remove(&number);
    }

    fn stuck(&self) -> Option<u64> {
        let running = self.running.lock().expect("no panic holds it");
        running.iter().find(|(_, since)| since.elapsed() > LIMIT).map(|(case, _)| *case)
    }

    fn done(&self) -> u64 {
        let failed = self.failures.lock().expect("no panic holds it").len() as u64;
        failed + self.verdicts.lock().expect("no panic holds it").values().sum::<u64>()
    }
}

/// Runs the cases on one thread per processor. Not on rayon's: a thread that waits inside a case
/// would begin another one.
fn work_off(numbers: Range<u64>, work: impl Fn(u64) + Sync) {
    let next = AtomicU64::new(numbers.start);
    let worker = || {
        let take = || Some(next.fetch_add(1, Ordering::Relaxed)).filter(|n| numbers.contains(n));
        std::iter::from_fn(take).for_each(&work);
    };
    let threads = thread::available_parallelism().map_or(1, usize::from);
    thread::scope(|scope| (0..threads).for_each(|_| drop(scope.spawn(worker))));
}

/// Prints a line past the test harness, which captures the output of passing tests.
fn say(line: &str) {
    let _ = writeln!(stderr(), "{line}");
}

/// Random stream of a case, independent of other cases and of the thread.
fn stream(kind: &str, seed: u64, case: u64) -> ChaCha8Rng {
    let kind = kind.bytes().fold(0, |sum, byte| echoloop_random::derive(sum, byte.into(), 0));
    ChaCha8Rng::seed_from_u64(echoloop_random::derive(seed, kind, case))
}

#[test]
fn failing_and_panicking_cases_are_reported_with_their_commands() {
    let failed = catch_unwind(|| {
        Campaign { kind: "trial", cases: 20 }.run(|rng| {
            use rand::RngExt;
            match rng.random_range(0..3) {
                0 => Ok("borne"),
                1 => Err("not borne".into()),
                _ => panic!("over {}", 3),
            }
        });
    });
    let text = failed.expect_err("a failure").downcast_ref::<String>().cloned().expect("a text");
    assert!(text.contains("not borne") && text.contains("panic: over 3"), "{text}");
    assert!(text.contains("again: cargo xtask attack --kind trial --seed 1 --case "), "{text}");
}
