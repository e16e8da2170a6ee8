//! Efficiency of a search on many threads.
//!
//! usage: threads [--threads N] [KEY=VALUE...]; runs the search of a configuration on one thread,
//! with the times of its registrations, and on N (2). Prints the efficiency at N, which is
//! processor time over N times wall time, and that of 1 to 64 threads as simulated from the times:
//! idle threads take what comes next, registrations after their scans, and nothing of a batch
//! begins before the one ahead of it ends. What is done between batches has one thread. A
//! registration counts as one piece of work, though some split further.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::sync::Mutex;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use clap::Parser;
use cpu_time::ProcessTime;
use echoloop_closed_loop::config::{RunConfig, load};
use echoloop_closed_loop::prepared::{Preparation, Prepared};
use echoloop_closed_loop::run_folder::journal::Journal;
use echoloop_closed_loop::search::{Observer, ScanTimes, Silent};
use echoloop_sensors::sensor::{Model, Sensors};

/// Numbers of threads that are simulated.
const SIMULATED: [usize; 7] = [1, 2, 4, 8, 16, 32, 64];

/// Number of threads for which batches are told apart by their size.
const MANY: usize = 16;

#[derive(Parser)]
struct Arguments {
    /// Threads to measure on.
    #[arg(long, default_value_t = 2)]
    threads: usize,
    /// Settings, as tune.generations=5.
    settings: Vec<String>,
}

/// Times of all batches, in their order.
#[derive(Default)]
struct Batches(Mutex<Vec<Vec<ScanTimes>>>);

impl Observer for Batches {
    fn batch(&self, times: &[ScanTimes]) {
        self.0.lock().expect("nothing panics").push(times.to_vec());
    }
}

/// Wall time and processor time of a search on a number of threads.
fn searched(
    prepared: &Prepared,
    threads: usize,
    observer: &dyn Observer,
) -> echoloop_benches::Result<[Duration; 2]> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build()?;
    let path = std::env::temp_dir().join(format!("echoloop-threads-{}", std::process::id()));
    let stop = AtomicBool::new(false);
    let search = prepared.search(&stop);
    let mut journal = Journal::create(&path, &search.header())?;
    let (wall, cpu) = (Instant::now(), ProcessTime::now());
    let tuned = pool.install(|| search.run(&mut journal, Vec::new(), observer));
    let times = [wall.elapsed(), cpu.elapsed()];
    std::fs::remove_file(&path)?;
    println!("{threads} threads: {} registrations", tuned?.registrations);
    Ok(times)
}

/// Time from the begin of a batch to its end on a number of threads, s.
fn makespan(batch: &[ScanTimes], threads: usize) -> f64 {
    // Times at which threads are free; work in the order in which it can begin.
    let mut free: BinaryHeap<Reverse<u64>> = (0..threads).map(|_| Reverse(0)).collect();
    let mut ready: BinaryHeap<Reverse<(u64, usize, usize)>> =
        (0..batch.len()).map(|scan| Reverse((0, scan, 0))).collect();
    let mut end = 0;
    while let (Some(Reverse((earliest, scan, part))), Some(Reverse(idle))) =
        (ready.pop(), free.pop())
    {
        let ScanTimes { scan: own, registrations } = &batch[scan];
        let time = if part == 0 { own } else { &registrations[part - 1] };
        let done = earliest.max(idle) + time.as_nanos() as u64;
        if part == 0 {
            ready.extend((1..=registrations.len()).map(|part| Reverse((done, scan, part))));
        }
        free.push(Reverse(done));
        end = end.max(done);
    }
    end as f64 / 1e9
}

fn main() -> echoloop_benches::Result<()> {
    let Arguments { threads, settings } = Arguments::parse();
    let overrides = settings.iter().map(|text| text.parse()).collect::<Result<Vec<_>, _>>()?;
    let config: RunConfig = load(None, &overrides)?;
    let sensors = Sensors::in_process(Model::from(&config));
    let preparation = Preparation::new(config, sensors, &|_| ())?.for_a_search()?;
    let prepared = preparation.traced_for_a_search(&|_, _| ())?;

    let batches = Batches::default();
    let [alone, _] = searched(&prepared, 1, &batches)?;
    let batches = batches.0.into_inner()?;
    let work = |batch: &Vec<ScanTimes>| -> f64 {
        let of_scan = |times: &ScanTimes| times.scan + times.registrations.iter().sum::<Duration>();
        batch.iter().map(of_scan).sum::<Duration>().as_secs_f64()
    };
    let parallel: f64 = batches.iter().map(work).sum();
    let between = (alone.as_secs_f64() - parallel).max(0.0);
    println!(
        "{} batches; {:.2} % of the time is between them",
        batches.len(),
        100.0 * between / alone.as_secs_f64()
    );
    let [wall, cpu] = searched(&prepared, threads, &Silent)?;
    println!(
        "measured: efficiency {:.2} on {threads} threads",
        cpu.as_secs_f64() / (threads as f64 * wall.as_secs_f64())
    );
    for threads in SIMULATED {
        let makespans: f64 = batches.iter().map(|batch| makespan(batch, threads)).sum();
        let efficiency = (parallel + between) / (threads as f64 * (makespans + between));
        println!("simulated: efficiency {efficiency:.2} on {threads} threads");
    }
    let bounds = [1, 8, 16, 32, 64, usize::MAX];
    for bound in bounds.windows(2) {
        let size = |batch: &Vec<ScanTimes>| -> usize {
            batch.iter().map(|scan| scan.registrations.len()).sum()
        };
        let is_own = |batch: &&Vec<ScanTimes>| (bound[0]..bound[1]).contains(&size(batch));
        let own: Vec<_> = batches.iter().filter(is_own).collect();
        if own.is_empty() {
            continue;
        }
        let time: f64 = own.iter().map(|batch| work(batch)).sum();
        let makespans: f64 = own.iter().map(|batch| makespan(batch, MANY)).sum();
        println!(
            "{} batches of {} registrations or more: {:.1} % of the work, {:.2} on {MANY} threads",
            own.len(),
            bound[0],
            100.0 * time / parallel,
            time / (MANY as f64 * makespans)
        );
    }
    Ok(())
}
