//! Times the stages of our registration on a pair of clouds, for `benches/peers`.
//!
//! ```text
//! stages TARGET SOURCE --voxel 0.3 --threads 1 --repeats 5 --truth T.txt     # JSON: medians
//! stages --serve --threads 1                            # JSON: a line for each line of input
//!   {"load": {"target": "t.ply", "source": "s.ply", "voxel_m": 0.3, "initial": [16 numbers]}}
//!   {"run": "normals"}
//! ```
//!
//! With `--serve`, one process runs stage after stage on request, so that ours and the peers' take
//! turns on the same core. The inputs of a stage are computed before the clock starts. CPU time is
//! that of the process, all threads.

mod pair;
mod stage;

use std::io::{BufRead, Write, stdin, stdout};
use std::path::PathBuf;

use clap::Parser;
use echoloop_benches::Result;
use echoloop_clouds::pose::{Pose, from_rows, read_pose, rotation_error_deg, translation_error_m};
use echoloop_statistics::median;
use serde::Deserialize;
use serde_json::{Value, json};

use pair::Pair;
use stage::{Measured, STAGES};

#[derive(Parser)]
struct Args {
    /// The cloud that stays.
    #[arg(required_unless_present = "serve")]
    target: Option<PathBuf>,
    /// The cloud that moves.
    #[arg(required_unless_present = "serve")]
    source: Option<PathBuf>,
    /// Edge of the voxels, m; radii are its multiples.
    #[arg(long, default_value_t = 0.3)]
    voxel: f64,
    /// Threads; 0: as many as there are processors.
    #[arg(long, default_value_t = 1)]
    threads: usize,
    /// Runs of each stage, after one to warm up.
    #[arg(long, default_value_t = 5)]
    repeats: usize,
    /// File with the true motion, target_from_source, 4 × 4.
    #[arg(long)]
    truth: Option<PathBuf>,
    /// File with the motion that local methods start from [default: identity].
    #[arg(long)]
    initial: Option<PathBuf>,
    /// Reads requests from standard input.
    #[arg(long, conflicts_with_all = ["target", "source"])]
    serve: bool,
}

/// A line of standard input.
#[derive(Deserialize)]
#[serde(rename_all = "snake_case")]
enum Request {
    Load { target: PathBuf, source: PathBuf, voxel_m: f64, initial: Option<[f64; 16]> },
    Run(String),
}

fn main() -> Result<()> {
    let args = Args::parse();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(args.threads).build()?;
    // Stages run inside the pool; waiting for input does not, so that it holds no thread.
    match (&args.target, &args.source) {
        (Some(target), Some(source)) => {
            let initial =
                args.initial.as_deref().map(read_pose).transpose()?.unwrap_or_else(Pose::identity);
            let truth = args.truth.as_deref().map(read_pose).transpose()?;
            let mut pair = Pair::load(target, source, args.voxel, initial)?;
            STAGES.iter().try_for_each(|name| {
                println!("{}", median_line(&pool, &mut pair, name, args.repeats, truth.as_ref())?);
                Ok(())
            })
        }
        _ => serve(&pool),
    }
}

/// Medians of a stage over the repeats, and the error of its motion.
fn median_line(
    pool: &rayon::ThreadPool,
    pair: &mut Pair,
    name: &str,
    repeats: usize,
    truth: Option<&Pose>,
) -> Result<Value> {
    let first = pool.install(|| stage::run(pair, name))?;
    let runs = (0..repeats).map(|_| pool.install(|| stage::run(pair, name)));
    let runs = runs.collect::<Result<Vec<Measured>>>()?;
    let mut line = json!({
        "stage": name, "n_in": first.n_in, "n_out": first.n_out,
        "cpu_ms": median(runs.iter().map(|run| run.cpu_ms)),
        "wall_ms": median(runs.iter().map(|run| run.wall_ms)),
    });
    if let (Some(pose), Some(truth)) = (&first.target_from_source, truth) {
        line["translation_error_m"] = translation_error_m(pose, truth).into();
        line["rotation_error_deg"] = rotation_error_deg(pose, truth).into();
        line["stop"] = first.stop.clone().into();
    }
    Ok(line)
}

/// Answers requests until the input ends; one that fails is answered with the reason.
fn serve(pool: &rayon::ThreadPool) -> Result<()> {
    let mut pair = None;
    for line in stdin().lock().lines() {
        let answer = answer(pool, &mut pair, &line?)
            .unwrap_or_else(|error| json!({"error": error.to_string()}));
        println!("{answer}");
        stdout().flush()?;
    }
    Ok(())
}

fn answer(pool: &rayon::ThreadPool, pair: &mut Option<Pair>, line: &str) -> Result<Value> {
    match serde_json::from_str(line)? {
        Request::Load { target, source, voxel_m, initial } => {
            let initial = initial.map_or(Ok(Pose::identity()), |rows| from_rows(&rows))?;
            let loaded = pair.insert(Pair::load(&target, &source, voxel_m, initial)?);
            let points = [&loaded.target, &loaded.source].map(|cloud| cloud.points.len());
            Ok(json!({"points": points, "stages": STAGES}))
        }
        Request::Run(name) => {
            let pair = pair.as_mut().ok_or("expected a pair to be loaded first")?;
            let measured = pool.install(|| stage::run(pair, &name))?;
            Ok(serde_json::to_value(&measured)?)
        }
    }
}
