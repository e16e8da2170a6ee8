//! Viewpoint of a single scan: the first of a first pair, or, where no pair fits, any place to
//! stand.

use echoloop_sim::viewpoint::{
    Footing, PairPlan, Split, Standpoint, ViewpointError, find_standpoint, stands_off_ground,
};

use super::{DatasetError, Place, pair_plan, poses, sight};
use crate::config::RunConfig;
use echoloop_clouds::Pose;

/// Finds the pose of the first training scan of a town, world from sensor, with remarks about where
/// the sensor stands. `tried` hears how many places were tried.
///
/// # Errors
///
/// [`DatasetError::Viewpoints`].
pub fn single_viewpoint(
    config: &RunConfig,
    place: &Place,
    town: u64,
    tried: &dyn Fn(usize),
) -> Result<(Pose, Vec<String>), DatasetError> {
    let plan = pair_plan(config, Split::Train, 1, town);
    let sight = sight(place, &config.scanner.beams());
    let first = match poses(config, place, &sight, &plan, &|_, count| tried(count)) {
        Ok(pairs) => pairs.first().map(|pair| pair.poses.world_from_first),
        Err(DatasetError::Viewpoints { source: ViewpointError::NoViewpoint { .. }, .. }) => None,
        Err(error) => return Err(error),
    };
    let (pose, mut remarks) = match first {
        Some(pose) => (pose, Vec::new()),
        None => {
            let (pose, remark) = standpoint(place, &plan)?;
            (pose, vec![remark])
        }
    };
    if stands_off_ground(&place.scene, &place.caster, &pose) {
        remarks.push(
            "the sensor stands on something else than ground (a crown, a roof?); --pose puts it \
             elsewhere"
                .into(),
        );
    }
    Ok((pose, remarks))
}

fn standpoint(place: &Place, plan: &PairPlan) -> Result<(Pose, String), DatasetError> {
    let Place { scene, caster, .. } = place;
    let Standpoint { world_from_sensor, footing, sees_enough } =
        find_standpoint(scene, caster, plan)
            .map_err(|source| DatasetError::Viewpoints { scene: scene.name.clone(), source })?;
    let on = match footing {
        Footing::Open => "on open ground",
        Footing::Covered => "on the ground, below something",
        Footing::Top => "on what lies on top",
    };
    let remark = format!(
        "{}: no place for two sensors {} m apart; one stands {on}{}",
        scene.name,
        plan.baseline_m,
        if sees_enough { "" } else { ", with little to see" }
    );
    Ok((world_from_sensor, remark))
}
