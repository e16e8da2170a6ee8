//! One stage, timed once in CPU time and wall time.

use std::time::Instant;

use cpu_time::ProcessTime;
use echoloop_benches::Result;
use echoloop_clouds::pose::{Pose, to_rows};
use echoloop_registration::features::{Described, fpfh, matching};
use echoloop_registration::geometry::neighbours::Neighbours;
use echoloop_registration::geometry::{normals, voxel};
use echoloop_registration::{
    Fgr, FgrMode, Gicp, Icp, IcpConfig, Mac, Method, MethodConfig, Outcome, Refined, Registration,
    StopReason, Suggestions, build,
};
use serde::{Serialize, Serializer};

use crate::pair::Pair;

/// A stage: parts first, then whole methods from the clouds as read to the pose.
pub(crate) const STAGES: [&str; 20] = [
    "voxel",
    "normals",
    "fpfh",
    "describe",
    "match",
    "icp_align",
    "icp",
    "gicp_align",
    "gicp",
    "fgr_solve",
    "mac_solve",
    "fgr",
    "mac",
    "fgr_refined",
    "mac_refined",
    "fgr_gicp",
    "mac_gicp",
    "fgr_suggested",
    "mac_suggested",
    "auto_suggested",
];

/// Times and results of a stage.
#[derive(Default, Serialize)]
pub(crate) struct Measured {
    pub(crate) stage: String,
    pub(crate) cpu_ms: f64,
    pub(crate) wall_ms: f64,
    pub(crate) n_in: usize,
    /// Number of points, matches or agreeing pairs.
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

/// Runs a stage once; its inputs are computed before the clock starts.
pub(crate) fn run(pair: &mut Pair, name: &str) -> Result<Measured> {
    match name {
        "voxel" | "normals" | "fpfh" | "describe" | "match" => part(pair, name),
        "icp_align" | "gicp_align" | "fgr_solve" | "mac_solve" => solve(pair, name),
        "fgr_suggested" => suggested(name, pair, Method::Fgr),
        "mac_suggested" => suggested(name, pair, Method::Mac),
        "auto_suggested" => suggested(name, pair, Method::Auto),
        _ => whole(name, pair, method(name, pair)?.as_ref()),
    }
}

/// Runs a stage from one or both clouds to points or matches.
fn part(pair: &mut Pair, name: &str) -> Result<Measured> {
    let (config, voxel_m) = (pair.features(), pair.voxel_m);
    match name {
        "voxel" => counted(name, pair.source.points.len(), || {
            Ok(voxel::downsample(&pair.source, voxel_m)?.points.len())
        }),
        "describe" => counted(name, pair.source.points.len(), || {
            Ok(Described::prepare(&pair.source, &config)?.points.len())
        }),
        "normals" => {
            let points = &pair.described()?.1.points;
            let (radius_m, most) = (config.normal_radius_m, config.normal_neighbours);
            counted(name, points.len(), || Ok(normals::from_points(points, radius_m, most).len()))
        }
        "fpfh" => {
            let Described { points, normals, .. } = &pair.described()?.1;
            let (radius_m, most) = (config.feature_radius_m, config.feature_neighbours);
            counted(name, points.len(), || {
                let neighbours = Neighbours::within(points, radius_m, most);
                Ok(fpfh::describe(points, normals, &neighbours).rows.len())
            })
        }
        _ => {
            let (target, source) = pair.described()?;
            counted(name, source.points.len(), || {
                Ok(matching::mutual(&source.features, &target.features).len())
            })
        }
    }
}

/// Runs a stage from a method's prepared clouds to the pose.
fn solve(pair: &mut Pair, name: &str) -> Result<Measured> {
    let initial = pair.initial;
    match name {
        "icp_align" => {
            let icp = Icp::new(pair.icp())?;
            let (target, source) = pair.prepared()?;
            posed(name, source.len(), || icp.align(target, source, &initial))
        }
        "gicp_align" => {
            let gicp = Gicp::new(pair.gicp())?;
            let (target, source) = pair.prepared_gicp()?;
            posed(name, source.len(), || gicp.align(target, source, &initial))
        }
        "fgr_solve" => {
            let fgr = Fgr::new(pair.fgr())?;
            let matches = pair.matches()?;
            posed(name, matches.len(), || fgr.solve(matches))
        }
        _ => {
            let mac = Mac::new(pair.mac())?;
            let matches = pair.matches()?;
            posed(name, matches.len(), || mac.solve(matches))
        }
    }
}

/// Runs a whole method from clouds to the pose.
fn method(name: &str, pair: &Pair) -> Result<Box<dyn Registration>> {
    let finish = Some(IcpConfig::refinement(pair.voxel_m));
    Ok(match name {
        "icp" => build(&MethodConfig::Icp(pair.icp()), None)?,
        "gicp" => build(&MethodConfig::Gicp(pair.gicp()), None)?,
        "fgr" => build(&MethodConfig::Fgr(pair.fgr()), None)?,
        "mac" => build(&MethodConfig::Mac(pair.mac()), None)?,
        "fgr_refined" => build(&MethodConfig::Fgr(pair.fgr()), finish)?,
        "mac_refined" => build(&MethodConfig::Mac(pair.mac()), finish)?,
        "fgr_gicp" => Box::new(Refined {
            global: Fgr::new(pair.fgr())?,
            local: Gicp::new(pair.refinement_gicp())?,
        }),
        "mac_gicp" => Box::new(Refined {
            global: Mac::new(pair.mac())?,
            local: Gicp::new(pair.refinement_gicp())?,
        }),
        _ => return Err(format!("there is no stage {name:?}").into()),
    })
}

/// Runs a global method, with ICP after it if it needs that; the time includes the choice of
/// settings from the clouds.
fn suggested(name: &str, pair: &Pair, method: Method) -> Result<Measured> {
    let (target, source) = (&pair.target, &pair.source);
    posed(name, source.points.len(), || {
        let suggestions = Suggestions::new(target, source);
        let config = suggestions.method(method, FgrMode::Annealed, None);
        let voxel_m = config.get("voxel_m").unwrap_or_default();
        let finish = method.is_rough().then(|| suggestions.refinement(voxel_m));
        match build(&config, finish) {
            Ok(method) => method.register(target, source, &pair.initial),
            Err(_) => Outcome::nothing(&pair.initial, StopReason::BadSettings),
        }
    })
}

fn whole(name: &str, pair: &Pair, method: &dyn Registration) -> Result<Measured> {
    posed(name, pair.source.points.len(), || {
        method.register(&pair.target, &pair.source, &pair.initial)
    })
}

fn counted(name: &str, n_in: usize, work: impl FnOnce() -> Result<usize>) -> Result<Measured> {
    let (n_out, cpu_ms, wall_ms) = timed(work)?;
    let (stage, n_out) = (name.to_owned(), n_out?);
    Ok(Measured { stage, cpu_ms, wall_ms, n_in, n_out, ..Measured::default() })
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
        stop: Some(outcome.stop.name().to_owned()),
        iterations: Some(outcome.iterations),
    })
}

/// Result of some work, with the CPU time of the process and wall time, ms.
fn timed<T>(work: impl FnOnce() -> T) -> Result<(T, f64, f64)> {
    let (wall, cpu) = (Instant::now(), ProcessTime::try_now()?);
    let result = work();
    let cpu_ms = 1e3 * cpu.try_elapsed()?.as_secs_f64();
    Ok((result, cpu_ms, 1e3 * wall.elapsed().as_secs_f64()))
}
