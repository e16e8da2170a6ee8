//! Scans and registers the pairs that figures show again, as their cells did.

use std::path::Path;

use super::super::choice::SensorChoice;
use super::super::exit::Failure;
use super::super::prepared::Met;
use super::super::progress::Progress;
use crate::experiment::config::{RunConfig, load};
use crate::experiment::dataset::{Dataset, ScanPair};
use crate::experiment::objective::{Bench, PairError, Registered};
use crate::experiment::params::Parameters;
use crate::experiment::run::{CONFIG, TUNED};
use crate::experiment::seed::{Purpose, derive};
use crate::reproduce::{
    Cell, Cells, Folder, LaidOn, Record, Seen, SeenPair, configuration, shown_pair,
};
use echoloop_registration::pose::Pose;

/// A pair of each cell where both were tuned. What cannot be shown is said, and no failure: the
/// table has no need of it.
pub(super) fn overlays(folder: &Folder, cells: &Cells) -> Seen {
    let mut seen = Seen::default();
    let is_done = |cell: &&Cell| cell.is_joint() && cells.run(cell).is_some();
    let searches = cells.searches();
    for cell in searches.iter().flat_map(|search| &search.cells).filter(is_done) {
        match seen_pair(folder, cells, cell) {
            Ok(pair) => seen.pairs.push(pair),
            Err(why) => seen.unseen.push((*cell, why.message)),
        }
    }
    seen
}

/// The pair of a cell, or why there is none to be seen.
fn seen_pair(folder: &Folder, cells: &Cells, cell: &Cell) -> Result<SeenPair, Failure> {
    let (Some(joint), Some(start)) = (cells.record(cell), cells.record(&cell.untuned())) else {
        return Err(Failure::usage("the cell where nothing is tuned is missing"));
    };
    let Some(index) = shown_pair(joint) else { return Err(Failure::usage("it has no pair")) };
    let run = folder.run_of(cell);
    let [config, tuned] = [CONFIG, TUNED].map(|name| of_file(&run.join(name)));
    let (config, tuned) = (config?, tuned?);
    if configuration(&config) != joint.configuration {
        return Err(Failure::usage("the run's configuration is not the cell's"));
    }
    let Some(dataset) = Dataset::held_out(&config, index)? else {
        return Err(Failure::usage(format_args!("there is no pair {index}")));
    };
    let met = Met::new(config, &SensorChoice::in_process(), &Progress::new(true))?;
    let after = Parameters::start(&tuned, &met.hardware).map_err(Failure::usage)?;
    let prepared = met.with(dataset);
    let noise = derive(prepared.config.seed, Purpose::TestNoise, index as u64);
    let pair = &prepared.dataset.test[0];
    let looked = |parameters: &Parameters| again(prepared.bench(), parameters, index, pair, noise);
    let [before, after] = [looked(&prepared.start)?, looked(&after)?];
    for (registered, record) in [(&before, start), (&after, joint)] {
        if !is_as_recorded(&registered.error, record) {
            return Err(Failure::usage(format_args!(
                "in this build pair {index} comes out otherwise"
            )));
        }
    }
    let views = [
        LaidOn::new(&before.clouds, &Pose::identity(), &pair.truth),
        LaidOn::new(&before.clouds, &before.first_from_second, &pair.truth),
        LaidOn::new(&after.clouds, &after.first_from_second, &pair.truth),
    ];
    Ok(SeenPair { cell: *cell, pair: index, views })
}

fn of_file(path: &Path) -> Result<RunConfig, Failure> {
    load(Some(path), &[]).map_err(Failure::usage)
}

/// Scanned and registered with the noise that it was judged with.
fn again(
    bench: Bench<'_>,
    parameters: &Parameters,
    index: usize,
    pair: &ScanPair,
    noise: u64,
) -> Result<Registered, Failure> {
    Ok(bench.register(parameters, index, pair, noise)?)
}

/// Whether a figure of it would show what the table tells.
fn is_as_recorded(error: &PairError, record: &Record) -> bool {
    record.summary.errors.iter().any(|recorded| recorded == error)
}
