//! One stage, run once under two clocks.

use std::time::Instant;

use cpu_time::ProcessTime;
use echoloop_host::cloud::{Cloud, normals, voxel};
use echoloop_host::pose::{Pose, to_rows};
use echoloop_host::registration::features::{Described, matching};
use echoloop_host::registration::{Fgr, Gicp, Icp, Mac, Outcome, Registration};
use serde::{Serialize, Serializer};

use crate::Result;
use crate::pair::Pair;

/// Parts first, then whole methods from the clouds as they were read to the pose.
pub(crate) const STAGES: [&str; 12] = [
    "voxel",
    "tree",
    "normals",
    "describe",
    "match",
    "icp_align",
    "icp",
    "gicp",
    "fgr",
    "mac",
    "fgr_refined",
    "mac_refined",
];

/// How long a stage took, and what came of it.
#[derive(Serialize)]
pub(crate) struct Measured {
    pub(crate) stage: String,
    pub(crate) cpu_ms: f64,
    pub(crate) wall_ms: f64,
    pub(crate) n_in: usize,
    /// Points, matches, or the pairs that agree.
    pub(crate) n_out: usize,
    #[serde(serialize_with = "rows", skip_serializing_if = "Option::is_none")]
    pub(crate) target_from_source: Option<Pose>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) stop: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) iterations: Option<usize>,
}

fn rows<S: Serializer>(pose: &Option<Pose>, serializer: S) -> std::result::Result<S::Ok, S::Error> {
    pose.as_ref().map(to_rows).serialize(serializer)
}

/// Runs a stage once; what it starts from is worked out before.
pub(crate) fn run(pair: &mut Pair, name: &str) -> Result<Measured> {
    match name {
        "voxel" => {
            let (cloud, voxel_m) = (&pair.source, pair.voxel_m());
            counted(name, cloud.points.len(), || Ok(voxel::downsample(cloud, voxel_m)?.points.len()))
        }
        "tree" => {
            let n = pair.thinned()?.points.len();
            counted(name, n, || Ok(pair.tree()?.len()))
        }
        "normals" => {
            let config = pair.features();
            let mut cloud = pair.thinned()?.clone();
            counted(name, cloud.points.len(), || {
                normals::estimate(&mut cloud, config.normal_radius_m, config.normal_neighbours);
                Ok(cloud.points.len())
            })
        }
        "describe" => {
            let (cloud, config) = (&pair.source, pair.features());
            counted(name, cloud.points.len(), || Ok(Described::prepare(cloud, &config)?.points.len()))
        }
        "match" => {
            let [source, target] = pair.described()?;
            counted(name, source.points.len(), || Ok(matching::mutual(&source.features, &target.features).len()))
        }
        "icp_align" => {
            let (icp, initial) = (Icp::new(pair.icp())?, pair.initial);
            let (target, source) = pair.prepared()?;
            posed(name, source.len(), || icp.align(target, source, &initial))
        }
        "icp" => whole(name, pair, &Icp::new(pair.icp())?),
        "gicp" => whole(name, pair, &Gicp::new(pair.gicp())?),
        "fgr" => whole(name, pair, &Fgr::new(pair.fgr())?),
        "mac" => whole(name, pair, &Mac::new(pair.mac())?),
        "fgr_refined" => whole(name, pair, &Refined(Fgr::new(pair.fgr())?, Icp::new(pair.icp())?)),
        "mac_refined" => whole(name, pair, &Refined(Mac::new(pair.mac())?, Icp::new(pair.icp())?)),
        _ => Err(format!("there is no stage {name:?}").into()),
    }
}

/// A global method, then a local one from there.
struct Refined<G>(G, Icp);

impl<G: Registration> Registration for Refined<G> {
    fn register(&self, target: &Cloud, source: &Cloud, initial: &Pose) -> Outcome {
        let found = self.0.register(target, source, initial);
        self.1.register(target, source, &found.target_from_source)
    }
}

fn whole(name: &str, pair: &Pair, method: &dyn Registration) -> Result<Measured> {
    posed(name, pair.source.points.len(), || method.register(&pair.target, &pair.source, &pair.initial))
}

fn counted(name: &str, n_in: usize, work: impl FnOnce() -> Result<usize>) -> Result<Measured> {
    let (n_out, cpu_ms, wall_ms) = timed(work)?;
    let n_out = n_out?;
    let stage = name.to_owned();
    Ok(Measured { stage, cpu_ms, wall_ms, n_in, n_out, target_from_source: None, stop: None, iterations: None })
}

fn posed(name: &str, n_in: usize, work: impl FnOnce() -> Outcome) -> Result<Measured> {
    let (outcome, cpu_ms, wall_ms) = timed(work)?;
    Ok(Measured {
        stage: name.to_owned(),
        cpu_ms,
        wall_ms,
        n_in,
        n_out: outcome.pairs,
        target_from_source: Some(outcome.target_from_source),
        stop: Some(format!("{:?}", outcome.stop)),
        iterations: Some(outcome.iterations),
    })
}

/// The result, CPU time of the process and wall time, ms.
fn timed<T>(work: impl FnOnce() -> T) -> Result<(T, f64, f64)> {
    let (wall, cpu) = (Instant::now(), ProcessTime::try_now()?);
    let result = work();
    let cpu_ms = 1e3 * cpu.try_elapsed()?.as_secs_f64();
    Ok((result, cpu_ms, 1e3 * wall.elapsed().as_secs_f64()))
}
