//! Two clouds registered in ten lines.
//!
//! ```sh
//! cargo run --release -p echoloop-examples --example register_two_clouds -- target.ply source.ply
//! ```
//!
//! PLY, PCD, VTK, KITTI .bin or XYZ, in metres. Without files, a yard seen from two places.

use std::error::Error;
use std::path::Path;

use echoloop_clouds::Pose;
use echoloop_clouds::read_cloud;
use echoloop_registration::{Icp, Registration, suggest};

#[path = "common/yard.rs"]
mod yard;

fn main() -> Result<(), Box<dyn Error>> {
    let files: Vec<String> = std::env::args().skip(1).collect();
    let (target, source) = match &files[..] {
        [target, source] => (read_cloud(Path::new(target))?.0, read_cloud(Path::new(source))?.0),
        [] => (yard::seen_from(1, &Pose::identity()), yard::seen_from(2, &yard::second_place())),
        _ => return Err("usage: register_two_clouds [TARGET SOURCE]".into()),
    };
    // From a nearby start: point-to-plane ICP, with voxel, radii and distances chosen for these
    // clouds. From any start: `Fgr` with `suggest_features`, as `echoloop register --method fgr`.
    let icp = Icp::new(suggest(&target, &source))?;
    let outcome = icp.register(&target, &source, &Pose::identity());
    println!("{}, {} pairs, {:.3} m rms", outcome.stop, outcome.pairs, outcome.rmse_m);
    println!("target_from_source = {:.5}", outcome.target_from_source.to_homogeneous());
    Ok(())
}
