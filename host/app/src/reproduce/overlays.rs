//! Repeats the scans and registrations of the pairs that figures show.

use std::path::Path;

use super::super::choice::SensorChoice;
use super::super::exit::Failure;
use super::super::prepared::connect;
use super::super::progress::Progress;
use echoloop_closed_loop::config::{RunConfig, load};
use echoloop_closed_loop::dataset::Dataset;
use echoloop_closed_loop::evaluation::objective::Registered;
use echoloop_closed_loop::parameters::Parameters;
use echoloop_closed_loop::run_folder::run::{CONFIG, TUNED};
use echoloop_closed_loop::seed::{Purpose, derive};
use echoloop_clouds::Pose;
use echoloop_study::{
    Cell, Cells, Folder, LaidOn, Record, Seen, SeenPair, configuration, shown_pair,
};

/// A pair of each cell where both were tuned. One that cannot be shown is listed with the reason;
/// the table does not need it.
pub(super) fn overlays(folder: &Folder, cells: &Cells) -> Seen {
    let mut seen = Seen::default();
    let is_done = |cell: &&Cell| cell.is_joint() && cells.run(cell).is_some();
    let searches = &cells.searches;
    for cell in searches.iter().flat_map(|search| &search.cells).filter(is_done) {
        match seen_pair(folder, cells, cell) {
            Ok((pair, unseen)) => {
                seen.pairs.push(pair);
                seen.unseen.extend(unseen);
            }
            Err(why) => seen.unseen.push((*cell, why.message)),
        }
    }
    seen
}

/// Cells that cannot be shown, each with the reason.
type Unseen = Vec<(Cell, String)>;

/// Pair of a cell, and the halves that cannot be shown; an error where no view can be shown.
fn seen_pair(folder: &Folder, cells: &Cells, cell: &Cell) -> Result<(SeenPair, Unseen), Failure> {
    let (Some(joint), Some(start)) = (cells.record(cell), cells.record(&cell.untuned())) else {
        return Err(Failure::usage("the cell where nothing is tuned is missing"));
    };
    let Some(index) = shown_pair(joint) else { return Err(Failure::usage("it has no pair")) };
    let config = of_file(&folder.run_of(cell).join(CONFIG))?;
    if configuration(&config) != joint.configuration {
        return Err(Failure::usage("the run's configuration is not the cell's"));
    }
    let Some(dataset) = Dataset::held_out(&config, index)? else {
        return Err(Failure::usage(format_args!("there is no pair {index}")));
    };
    let preparation = connect(config, &SensorChoice::in_process(), &Progress::new(true))?;
    let device = preparation.device;
    let prepared = preparation.with(dataset);
    let noise = derive(prepared.config.seed, Purpose::TestNoise, index as u64);
    let pair = &prepared.dataset.test[0];
    // Scanned and registered with the noise of its evaluation.
    let repeated = |parameters: &Parameters, record: &Record| {
        let registered = prepared.bench().register(parameters, index, pair, noise)?;
        match record.summary.errors.contains(&registered.error) {
            true => Ok(registered),
            false => Err(Failure::usage(format_args!(
                "in this build pair {index} comes out otherwise with {}",
                record.cell.tuned_name()
            ))),
        }
    };
    let laid = |seen: &Registered| LaidOn::new(&seen.clouds, &seen.first_from_second, &pair.truth);
    let tuned = |record: &Record| -> Result<LaidOn, Failure> {
        let tuned = of_file(&folder.run_of(&record.cell).join(TUNED))?;
        let tuned = Parameters::start(&tuned, &device).map_err(Failure::usage)?;
        Ok(laid(&repeated(&tuned, record)?))
    };
    let first = repeated(&prepared.start, start)?;
    let before = LaidOn::new(&first.clouds, &Pose::identity(), &pair.truth);
    let mut unseen = Unseen::new();
    let [lidar, registration] = cell.halves().map(|half| match tuned(cells.record(&half)?) {
        Ok(laid) => Some(laid),
        Err(why) => {
            unseen.push((half, why.message));
            None
        }
    });
    let views = [Some(before), Some(laid(&first)), lidar, registration, Some(tuned(joint)?)];
    Ok((SeenPair { cell: *cell, pair: index, views }, unseen))
}

fn of_file(path: &Path) -> Result<RunConfig, Failure> {
    load(Some(path), &[]).map_err(Failure::usage)
}
