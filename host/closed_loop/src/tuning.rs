//! One run from search to result: evaluation on the held-out pairs, front, files of the run folder.

use std::borrow::Cow;

use std::path::Path;
use std::sync::atomic::Ordering;

use crate::config::RunConfig;
use crate::config::preset::LidarPreset;
use crate::cost::CostKind;
use crate::evaluation::compare::Comparison;
use crate::evaluation::objective::Registered;
use crate::evaluation::summary::Summary;
use crate::front::{Front, FrontSearch};
use crate::parameters::Parameters;
use crate::prepared::Prepared;
use crate::run_folder::files::FileError;
use crate::run_folder::journal::{Generation, Journal};
use crate::run_folder::run::{
    AFTER, AxisRecord, BEFORE, Background, FRONT, RESULT, RunFolder, RunResult, TUNED,
};
use crate::search::{Observer, Stage, TuneError, TuneSearch, Tuned};
use crate::seed::{Purpose, derive};
use echoloop_clouds::{Cloud, CloudFormat};
use echoloop_dsp::ScanPattern;
use echoloop_sensors::pattern::size;
use echoloop_sensors::sensor::SensorError;

/// Errors on the held-out pairs.
pub struct Judged {
    /// Errors of the start's sensor with the plain method, where the start's is not plain.
    pub plain: Option<Summary>,
    /// Errors of the start.
    pub before: Summary,
    /// Errors of the tuned parameters.
    pub after: Summary,
}

/// Searches, going on after the generations that are done, then evaluates on the held-out pairs.
///
/// # Errors
///
/// [`TuneError`]; [`TuneError::NothingFound`] when no registration found a motion.
pub fn search_and_judge(
    search: &TuneSearch<'_>,
    journal: &mut Journal,
    done: Vec<Generation>,
    observer: &dyn Observer,
) -> Result<(Tuned, Judged), TuneError> {
    let tuned = search.run(journal, done, observer)?;
    if let Some(stop) = tuned.nothing_found {
        return Err(TuneError::NothingFound { registrations: tuned.registrations, stop });
    }
    let start = search.start;
    let plain = start.registration.plain().map(|registration| Parameters { registration, ..start });
    // A search that kept its start has nothing more to evaluate.
    let is_start = tuned.parameters == start;
    let judgements = 1 + usize::from(plain.is_some()) + usize::from(!is_start);
    observer.stage("judging", judgements * search.bench.dataset.test.len());
    let plain = plain.map(|plain| search.judge(&plain, observer)).transpose()?;
    let before = search.judge(&start, observer)?;
    let after = match is_start {
        true => before.clone(),
        false => search.judge(&tuned.parameters, observer)?,
    };
    let judged = Judged { plain, before, after };
    match search.stop.load(Ordering::Relaxed) {
        true => Err(TuneError::Interrupted { generations: tuned.generations.len() }),
        false => Ok((tuned, judged)),
    }
}

/// Searches the front, where the configuration asks for one, with a journal of its own. With
/// `repair` the damaged end of that journal is dropped.
pub fn search_front(
    search: &TuneSearch<'_>,
    (tuned, judged): &(Tuned, Judged),
    folder: &RunFolder,
    repair: bool,
    observer: &dyn Observer,
) -> Result<Option<Front>, TuneError> {
    let config = search.config;
    let Some(cost) = config.front.cost else { return Ok(None) };
    let is_bounded = config.tune.axes.of("lidar.power").is_some();
    let space = match cost {
        CostKind::Energy if !is_bounded => search.space.clone().with_power(LidarPreset::Full),
        _ => search.space.clone(),
    };
    let judged = [&judged.before, &judged.after];
    let of_front = FrontSearch { search, space, tuned: tuned.parameters, judged, cost };
    let (path, header) = (folder.file(FRONT), of_front.header());
    let (mut journal, done) = match path.exists() {
        true => Journal::resume(&path, &header, repair)?,
        false => (Journal::create(&path, &header)?, Vec::new()),
    };
    let each = of_front.registrations() / config.front.generations.max(1) as usize;
    observer.stage("front", of_front.registrations().saturating_sub(each * done.len()));
    let front = of_front.run(&mut journal, done, observer)?;
    Ok(Some(front))
}

/// Searches, judges, and searches the front where one is asked for: the tuned parameters, and the
/// result of the run. `done` are the generations that the journal holds.
///
/// # Errors
///
/// [`TuneError`], as of [`search_and_judge`] and [`search_front`].
pub fn tuned(
    search: &TuneSearch<'_>,
    (journal, done): (&mut Journal, Vec<Generation>),
    folder: &RunFolder,
    repair: bool,
    observer: &dyn Observer,
) -> Result<(Parameters, RunResult), TuneError> {
    let found = search_and_judge(search, journal, done, observer)?;
    let front = search_front(search, &found, folder, repair, observer)?;
    let (tuned, judged) = found;
    let result = RunResult { front, ..result(search, &tuned, judged) };
    Ok((tuned.parameters, result))
}

/// Result of a run, without its front.
pub fn result(search: &TuneSearch<'_>, tuned: &Tuned, judged: Judged) -> RunResult {
    let config = search.config;
    RunResult {
        format: 1,
        protocol: config.tune.protocol.name().into(),
        method: config.registration.name(),
        scene: config.scene.source.clone(),
        seed: config.seed,
        generations: tuned.generations.len(),
        registrations: tuned.registrations,
        origin: tuned.origin.clone(),
        default: search.start.values(config),
        tuned: tuned.parameters.values(config),
        finalists: tuned.finalists.clone(),
        check: tuned.check.clone(),
        comparison: Comparison::new(
            &judged.before.errors,
            &judged.after.errors,
            config.tune.error_cap,
        ),
        plain_summary: judged.plain,
        default_summary: judged.before,
        tuned_summary: judged.after,
        front: None,
        background: Some(background(search, tuned)),
    }
}

/// Facts of the search that its page shows besides the result.
fn background(search: &TuneSearch<'_>, tuned: &Tuned) -> Background {
    let (dataset, axes) = (search.bench.dataset, search.space.axes());
    let beams =
        dataset.beams.aimed(&search.start.settings).unwrap_or(Cow::Borrowed(&dataset.beams));
    let pattern = beams.pattern();
    let stages = search.stages();
    let last = stages.last().map(|stage| stage.axes.clone()).unwrap_or_default();
    let was_made = |stage: &&Stage| tuned.generations.iter().any(|g| g.stage == stage.name);
    Background {
        triangles: dataset.triangles,
        beams: match pattern {
            ScanPattern::Grid(_) => size(pattern),
            _ => pattern.to_string(),
        },
        places: dataset.test.iter().map(|pair| pair.place.clone()).collect(),
        stages: stages.iter().filter(was_made).cloned().collect(),
        axes: axes.iter().map(AxisRecord::from).collect(),
        correlated: last.iter().map(|&axis| axes[axis].name.to_owned()).collect(),
        correlations: tuned.correlations.clone(),
        covariance_learned: tuned.covariance_learned,
    }
}

/// A run folder that cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum WriteRunError {
    /// A file cannot be written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The sensor failed on the shown pair.
    #[error(transparent)]
    Sensor(#[from] SensorError),
}

/// Writes tuned configuration, result and the clouds of the shown pair into a run folder.
pub fn write_run(
    folder: &RunFolder,
    prepared: &Prepared,
    tuned: &Parameters,
    result: &RunResult,
) -> Result<(), WriteRunError> {
    folder.write_toml(TUNED, &tuned.as_start_of(&prepared.config))?;
    folder.write_json(RESULT, result)?;
    let index = result.shown_pair();
    let pair = &prepared.dataset.test[index];
    let noise = derive(prepared.config.seed, Purpose::TestNoise, index as u64);
    for (name, parameters) in [(BEFORE, &prepared.start), (AFTER, tuned)] {
        let registered = prepared.bench().register(parameters, index, pair, noise)?;
        folder.write(name, pair_bytes(&registered))?;
    }
    Ok(())
}

/// Both clouds of a pair in the first one's frame, as registered, as PLY.
fn pair_bytes(registered: &Registered) -> Vec<u8> {
    let [first, second] = &registered.clouds;
    let pose = registered.first_from_second.cast::<f32>();
    let laid_on = second.points.iter().map(|p| pose * p);
    let points = first.points.iter().copied().chain(laid_on).collect();
    CloudFormat::Ply.bytes(&Cloud::new(points), &[])
}

/// Characters of a mesh's name in that of its run: a folder's may have 255 bytes.
const MOST_OF_SCENE: usize = 40;

/// Name of a run after its scene, method and protocol.
pub fn run_name(config: &RunConfig) -> String {
    let source = Path::new(&config.scene.source);
    let scene = source
        .file_stem()
        .map_or_else(|| config.scene.source.clone(), |s| s.to_string_lossy().into_owned());
    let scene: String = scene.chars().filter(|c| !c.is_control()).take(MOST_OF_SCENE).collect();
    let method = config.registration.method.name();
    format!("{scene}-{method}-{}", config.tune.protocol.name())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_has_a_name_that_a_folder_can_have() {
        let name = |source: &str| {
            let mut config = RunConfig::default();
            config.scene.source = source.to_owned();
            run_name(&config)
        };
        assert_eq!(name("structured"), "structured-icp-joint");
        assert_eq!(name("a/yard.obj"), "yard-icp-joint");
        assert_eq!(name("a\u{1b}b.ply"), "ab-icp-joint");
        assert!(name(&format!("{}.ply", "\u{1f332}".repeat(60))).len() < 240);
    }
}
