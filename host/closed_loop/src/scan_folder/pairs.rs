//! Folder of scanned pairs: clouds, true motions and poses of each, a list, the configuration.

use std::fmt::Write as _;
use std::path::Path;
use std::sync::atomic::AtomicBool;

use rayon::prelude::*;
use serde_json::{Value, json};

use super::{ScanError, go_on, with_points};
use crate::dataset::{Facts, ScanPair};
use crate::evaluation::scan_cloud::recorded_from_scan;
use crate::prepared::{PairSet, Prepared};
use crate::run_folder::atomic_folder::AtomicFolder;
use echoloop_clouds::pose::{Pose, to_rows};
use echoloop_clouds::{CloudFormat, Recorded};

/// A pair, scanned with the configured settings.
pub struct ScannedPair<'a> {
    pair: &'a ScanPair,
    /// Clouds of the first and second scan, which a registration calls target and source.
    pub clouds: [Recorded; 2],
}

/// Scans a set of pairs with the noise that `evaluate` gives them. `done` hears of each.
///
/// # Errors
///
/// [`ScanError`] of the first pair that fails.
pub fn scan_pairs<'a>(
    prepared: &'a Prepared,
    which: PairSet,
    stop: &AtomicBool,
    done: &(dyn Fn() + Sync),
) -> Result<Vec<ScannedPair<'a>>, ScanError> {
    let noisy = prepared.pairs(which);
    let scan_one = |(index, pair)| {
        go_on(stop)?;
        let scanned = scan_pair(prepared, pair, noisy.noise_seed(index));
        done();
        scanned
    };
    noisy.pairs.par_iter().enumerate().map(scan_one).collect()
}

fn scan_pair<'a>(
    prepared: &Prepared,
    pair: &'a ScanPair,
    noise_seed: u64,
) -> Result<ScannedPair<'a>, ScanError> {
    let (bench, settings) = (prepared.bench(), &prepared.start.settings);
    let scans = bench.echoes(settings, pair, noise_seed)?;
    let beams = &*bench.beams(settings)?;
    let duration_s = prepared.config.motion.scan_s(beams.pattern());
    let cloud = |i: usize| {
        let viewpoint = pair.viewpoints[i];
        let recorded = recorded_from_scan(&scans[i], beams, viewpoint, duration_s);
        with_points(recorded, || format!("scan {viewpoint}"))
    };
    Ok(ScannedPair { pair, clouds: [cloud(0)?, cloud(1)?] })
}

/// Writes scanned pairs: `NNN_target.ply`, `NNN_source.ply`, matrices, `pairs.json`, `config.toml`.
///
/// # Errors
///
/// [`ScanError`]; then nothing is written.
pub fn write_pairs(
    folder: &Path,
    prepared: &Prepared,
    scanned: &[ScannedPair<'_>],
    format: CloudFormat,
    stop: &AtomicBool,
) -> Result<(), ScanError> {
    let folder = AtomicFolder::new(folder)?;
    for (index, scanned) in scanned.iter().enumerate() {
        go_on(stop)?;
        write_pair(&folder, index, scanned, format)?;
    }
    folder.write_toml("config.toml", &prepared.config)?;
    let list = json!({
        "format": 1,
        "sensor": prepared.sensor,
        "set": Facts::new(&prepared.dataset),
        "pairs": scanned.iter().enumerate().map(entry).collect::<Vec<_>>(),
    });
    folder.write("pairs.json", format!("{list:#}\n"))?;
    Ok(folder.finish()?)
}

fn write_pair(
    folder: &AtomicFolder,
    index: usize,
    scanned: &ScannedPair<'_>,
    format: CloudFormat,
) -> Result<(), ScanError> {
    let name = name(index);
    let [world_from_target, world_from_source] = &scanned.pair.world_from_sensor;
    for (end, Recorded { cloud, columns, .. }) in
        ["target", "source"].into_iter().zip(&scanned.clouds)
    {
        let file = format!("{name}_{end}.{}", format.name());
        folder.write(&file, format.bytes(cloud, columns))?;
    }
    folder.write(&format!("{name}_target_from_source.txt"), matrix(&scanned.pair.truth))?;
    folder.write(&format!("{name}_world_from_target.txt"), matrix(world_from_target))?;
    Ok(folder.write(&format!("{name}_world_from_source.txt"), matrix(world_from_source))?)
}

fn name(index: usize) -> String {
    format!("{index:03}")
}

/// Four rows of four, every digit: the format of `register --initial`.
fn matrix(pose: &Pose) -> String {
    to_rows(pose).chunks(4).fold(String::new(), |mut text, row| {
        let _ = writeln!(text, "{} {} {} {}", row[0], row[1], row[2], row[3]);
        text
    })
}

/// Entry of a pair in the list. `frames` are the numbers that the firmware writes to the emitter's
/// FRAME register.
fn entry((index, ScannedPair { pair, clouds }): (usize, &ScannedPair<'_>)) -> Value {
    json!({
        "name": name(index),
        "place": pair.place,
        "frames": pair.viewpoints,
        "points": clouds.each_ref().map(|scan| scan.cloud.points.len()),
        "baseline_m": pair.truth.translation.vector.norm(),
        "turn_deg": pair.truth.rotation.angle().to_degrees(),
        "overlap": pair.overlap,
    })
}
