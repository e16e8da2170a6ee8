//! The held-out pair that a run shows: registered with default and with tuned parameters, and
//! written.

use echoloop_registration::cloud::{Cloud, CloudFormat};

use super::exit::Failure;
use super::prepared::Prepared;
use echoloop_closed_loop::evaluation::objective::Registered;
use echoloop_closed_loop::parameters::Parameters;
use echoloop_closed_loop::run_folder::run::{AFTER, BEFORE, RunFolder, RunResult};
use echoloop_closed_loop::seed::{Purpose, derive};

/// Registers the shown pair both ways, and writes both as PLY.
pub(super) fn write_clouds(
    folder: &RunFolder,
    prepared: &Prepared,
    tuned: &Parameters,
    result: &RunResult,
) -> Result<(), Failure> {
    let index = result.shown_pair();
    let pair = &prepared.dataset.test[index];
    let noise = derive(prepared.config.seed, Purpose::TestNoise, index as u64);
    for (name, parameters) in [(BEFORE, &prepared.start), (AFTER, tuned)] {
        let registered = prepared.bench().register(parameters, index, pair, noise)?;
        folder.write(name, pair_bytes(&registered))?;
    }
    Ok(())
}

/// Both clouds in the first one's frame, as registered.
fn pair_bytes(registered: &Registered) -> Vec<u8> {
    let [first, second] = &registered.clouds;
    let pose = registered.first_from_second.cast::<f32>();
    let laid_on = second.points.iter().map(|p| pose * p);
    let points = first.points.iter().copied().chain(laid_on).collect();
    CloudFormat::Ply.bytes(&Cloud::new(points), &[])
}
