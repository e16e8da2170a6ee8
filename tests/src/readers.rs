//! Properties of every file reader on any bytes: the result is valid, or the refusal is short. Fuzz
//! targets and attacks call these functions.
//!
//! | function | bytes are | property of the result |
//! |---|---|---|
//! | [`obj`] | a mesh; after a zero byte its material library | it can be scanned |
//! | [`mesh_ply`] | a mesh | it can be scanned |
//! | [`semantic`] | a scan of CARLA's semantic LiDAR | finite directions, echoes of some strength |
//! | [`roads`] | a road network | lanes of finite points, waypoints on each that is driven |
//! | [`cloud_ply`], [`pcd`], [`vtk`], [`kitti`], [`xyz`] | a cloud | echoes, fewer than bytes |
//! | [`rows`] | waveforms or a response, CSV, NumPy, HDF5 | finite, no more than 64 × bytes |
//! | [`pose`] | a motion | a rotation |
//! | [`configuration`] | TOML | it reads back as itself |
//! | [`journal`] | lines; also with right checksums | no more generations than lines |
//!
//! Each returns true when the bytes were read.

use std::fmt::Display;
use std::path::Path;

use echoloop_closed_loop::config;
use echoloop_closed_loop::run_folder::journal::{sealed_lines, whole_generations};
use echoloop_clouds::pose::parse_pose;
use echoloop_clouds::{CloudFormat, parse_cloud, parse_recorded, read_formats};
use echoloop_instruments::{Response, Selection, parse_waveforms};
use echoloop_sim::import::{
    Ground, ImportOptions, Tags, library_surfaces, parse_scene, parse_semantic,
};
use echoloop_sim::roads::{Waypoint, parse_network};
use echoloop_sim::scene::MATERIALS;

/// A reader: the name of its fuzz target and corpus, and the function that checks it.
pub type Reader = (&'static str, fn(&[u8]) -> bool);

/// All readers.
pub const READERS: [Reader; 15] = [
    ("obj", obj),
    ("gltf", gltf),
    ("stl", stl),
    ("semantic", semantic),
    ("mesh_ply", mesh_ply),
    ("roads", roads),
    ("cloud_ply", cloud_ply),
    ("pcd", pcd),
    ("vtk", vtk),
    ("kitti", kitti),
    ("xyz", xyz),
    ("rows", rows),
    ("pose", pose),
    ("configuration", configuration),
    ("journal", journal),
];

/// The result of a reader; `None` for a refusal, which must be short and without control
/// characters.
fn checked<T>(read: Result<T, impl Display>) -> Option<T> {
    match read {
        Ok(read) => Some(read),
        Err(error) => {
            let message = error.to_string();
            assert!(message.len() < 3_000, "{} bytes: {message}", message.len());
            let hidden = message.chars().find(|c| c.is_control() && *c != '\n');
            assert_eq!(hidden, None, "{message}");
            None
        }
    }
}

/// A mesh of at most `most` triangles.
fn mesh_within(name: &str, bytes: &[u8], most: usize) -> bool {
    let options = ImportOptions { ground: Ground::None, ..ImportOptions::default() };
    let Some(scene) = checked(parse_scene(Path::new(name), bytes, &options)) else { return false };
    assert_eq!(scene.mesh.check(MATERIALS.len(), options.max_reach_m), Ok(()));
    assert!(scene.mesh.triangles.len() <= most, "{} bytes", bytes.len());
    true
}

fn mesh(name: &str, bytes: &[u8]) -> bool {
    mesh_within(name, bytes, bytes.len())
}

/// A glTF mesh, as text or as chunks; nodes may show it more than once.
pub fn gltf(bytes: &[u8]) -> bool {
    mesh_within("any.gltf", bytes, bytes.len() + (1 << 21))
}

/// An STL mesh, as text or as records.
pub fn stl(bytes: &[u8]) -> bool {
    mesh("any.stl", bytes)
}

/// A scan of CARLA's semantic LiDAR.
pub fn semantic(bytes: &[u8]) -> bool {
    let Some(seen) = checked(parse_semantic(bytes, Tags::Carla0914)) else { return false };
    assert!(seen.len() < bytes.len());
    for one in &seen {
        assert!(one.direction.iter().all(|x| x.is_finite()), "{one:?}");
        if let Some(echo) = &one.echo {
            let sound = (0.0..f32::INFINITY).contains(&echo.range_m) && echo.strength_per_m2 > 0.0;
            assert!(sound && echo.strength_per_m2.is_finite(), "{one:?}");
        }
    }
    // A scan without points is refused later, when pairs are made of it.
    !seen.is_empty()
}

/// An OBJ mesh; what follows its first zero byte is a material library.
pub fn obj(bytes: &[u8]) -> bool {
    let (mesh_bytes, library) = match bytes.iter().position(|&byte| byte == 0) {
        Some(end) => (&bytes[..end], &bytes[end + 1..]),
        None => (bytes, &[][..]),
    };
    let surfaces = library_surfaces(&String::from_utf8_lossy(library));
    assert!(surfaces.len() <= library.len());
    mesh("any.obj", mesh_bytes)
}

/// A PLY mesh.
pub fn mesh_ply(bytes: &[u8]) -> bool {
    mesh("any.ply", bytes)
}

/// A road network.
pub fn roads(bytes: &[u8]) -> bool {
    let Some(network) = checked(parse_network(Path::new("any.xodr"), bytes)) else { return false };
    assert!(!network.lanes.is_empty());
    for lane in &network.lanes {
        assert!(
            lane.ribs.len() > 1
                && lane.ribs.as_flattened().as_flattened().iter().all(|x| x.is_finite())
        );
        assert!(lane.successors.iter().all(|next| *next < network.lanes.len()));
    }
    let finite = |at: &Waypoint| at.at.iter().all(|x| x.is_finite()) && at.heading_rad.is_finite();
    assert!(network.waypoints(100.0).iter().all(finite));
    assert!(network.topology().as_flattened().iter().all(finite));
    true
}

fn cloud(name: &str, bytes: &[u8], most: usize) -> bool {
    let Some((cloud, _)) = checked(parse_cloud(Path::new(name), bytes)) else { return false };
    assert!(cloud.points.iter().all(|p| p.coords.iter().all(|v| v.is_finite())));
    assert!(cloud.points.iter().all(|p| p.coords.iter().any(|v| *v != 0.0)));
    assert!((1..=most).contains(&cloud.points.len()), "{} of {most}", cloud.points.len());
    whole_cloud(name, bytes, cloud.points.len());
    true
}

/// Checks all columns of a cloud: each is as long as the cloud, and every format reads back as it
/// was written.
fn whole_cloud(name: &str, bytes: &[u8], points: usize) {
    let (read, _) = parse_recorded(Path::new(name), bytes).expect("the same points");
    assert_eq!(read.cloud.points.len(), points);
    assert!(read.columns.iter().all(|column| column.len() == points));
    for format in CloudFormat::ALL {
        let again = format.recorded(&read);
        let path = Path::new("again").with_extension(format.name());
        let (again, dropped) = parse_recorded(&path, &again).expect("our own file");
        assert_eq!((&again.cloud.points, dropped.total()), (&read.cloud.points, 0), "{format:?}");
        if !format.keeps_columns() {
            continue;
        }
        assert_eq!((&again.cloud, again.shift_m), (&read.cloud, read.shift_m), "{format:?}");
        let is_kept = again.columns.iter().zip(&read.columns).all(|(a, b)| a.len() == b.len());
        assert!(is_kept && again.columns.len() == read.columns.len(), "{format:?}");
    }
}

/// A PLY cloud.
pub fn cloud_ply(bytes: &[u8]) -> bool {
    cloud("any.ply", bytes, bytes.len())
}

/// A PCD cloud; its points may be compressed.
pub fn pcd(bytes: &[u8]) -> bool {
    cloud("any.pcd", bytes, 88 * bytes.len())
}

/// A VTK cloud.
pub fn vtk(bytes: &[u8]) -> bool {
    cloud("any.vtk", bytes, bytes.len())
}

/// A KITTI cloud.
pub fn kitti(bytes: &[u8]) -> bool {
    cloud("any.bin", bytes, bytes.len())
}

/// A cloud of XYZ lines, or of any format without a reader of its own above.
pub fn xyz(bytes: &[u8]) -> bool {
    let others = read_formats().filter(|name| !["ply", "pcd", "vtk", "bin"].contains(name));
    others.fold(false, |read, name| read | cloud(&format!("any.{name}"), bytes, bytes.len()))
}

/// Waveforms, and the same rows as an instrument's response.
pub fn rows(bytes: &[u8]) -> bool {
    let Some(rows) =
        checked(parse_waveforms(Path::new("any"), bytes.to_vec(), &Selection::default()))
    else {
        return false;
    };
    let numbers: usize = (0..rows.len())
        .map(|row| {
            let row = rows.row(row);
            // NaN is a missing sample.
            assert!(row.iter().all(|v| v.is_finite() || v.is_nan()));
            row.len()
        })
        .sum();
    let most = match bytes.starts_with(b"\x89HDF") {
        true => 2 * (64 * bytes.len() + (1 << 20)),
        false => 2 * bytes.len(),
    };
    assert!(rows.len() + numbers <= most, "{} bytes", bytes.len());
    if let Some(response) = checked(Response::of_points(Path::new("any"), &rows, 1.0)) {
        assert!(response.width() >= 1.0 && response.points().all(|(_, level, _)| level <= 1.0));
    }
    true
}

/// A motion.
pub fn pose(bytes: &[u8]) -> bool {
    let text = String::from_utf8_lossy(bytes);
    let Some(pose) = checked(parse_pose(Path::new("any"), &text)) else { return false };
    let rotation = pose.rotation.to_rotation_matrix();
    assert!((rotation.matrix().determinant() - 1.0).abs() < 1e-9, "{pose}");
    assert!(pose.translation.vector.iter().all(|v| v.is_finite()));
    true
}

/// A configuration; one that its checks accept reads back as it was written.
pub fn configuration(bytes: &[u8]) -> bool {
    let text = String::from_utf8_lossy(bytes);
    let Some(config) = checked(config::parse(&text)) else { return false };
    if checked(config.check()).is_none() {
        return false;
    }
    let written = config::written(&config).expect("TOML has its numbers");
    assert_eq!(config::parse(&written).as_ref(), Ok(&config), "{written}");
    true
}

/// A journal as it is, and its lines with right checksums.
pub fn journal(bytes: &[u8]) -> bool {
    let lines = || bytes.split(|&byte| byte == b'\n').filter(|line| !line.is_empty());
    let mut whole = false;
    for journal in [bytes.to_vec(), sealed_lines(lines())] {
        if let Some(generations) = checked(whole_generations(&journal)) {
            assert!(generations < lines().count());
            whole |= generations > 0;
        }
    }
    whole
}
