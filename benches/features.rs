//! Features and normals of given points as raw little-endian `f32`, for
//! `benches/peers/oracles/fpfh.py`.
//!
//! usage: features POINTS.f32 NORMALS.f32 RADIUS_M MAX FEATURES.f32 NORMALS_AS_OPEN3D.f32; prints
//! the CPU time of search, normals and features on one thread, ms.

use std::error::Error;

use cpu_time::ProcessTime;
use echoloop_registration::features::fpfh;
use echoloop_registration::geometry::neighbours::Neighbours;
use echoloop_registration::geometry::normals;
use nalgebra::{Point3, Vector3};

/// Number of timed runs, of which the fastest counts.
const REPEATS: usize = 9;

fn triples(path: &str) -> Result<Vec<[f32; 3]>, Box<dyn Error>> {
    let bytes = std::fs::read(path)?;
    let values: Vec<f32> =
        bytes.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect();
    Ok(values.as_chunks::<3>().0.to_vec())
}

fn write(path: &str, values: impl Iterator<Item = f32>) -> std::io::Result<()> {
    std::fs::write(path, values.flat_map(f32::to_le_bytes).collect::<Vec<u8>>())
}

fn timed<T>(least_ms: &mut f64, work: impl FnOnce() -> T) -> T {
    let start = ProcessTime::now();
    let done = work();
    *least_ms = least_ms.min(start.elapsed().as_secs_f64() * 1e3);
    done
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [points, given, radius_m, max, features_out, normals_out] = arguments.as_slice() else {
        return Err("expected POINTS NORMALS RADIUS_M MAX FEATURES NORMALS_AS_OPEN3D".into());
    };
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global()?;
    let points: Vec<Point3<f32>> = triples(points)?.into_iter().map(Point3::from).collect();
    let given: Vec<Vector3<f32>> = triples(given)?.into_iter().map(Vector3::from).collect();
    let (radius_m, max) = (radius_m.parse::<f64>()?, max.parse::<usize>()?);
    let (normal_radius_m, normal_max) = (0.6 * radius_m, max.min(30));
    let mut least_ms = [f64::INFINITY; 3];
    for _ in 0..REPEATS {
        let neighbours = timed(&mut least_ms[0], || Neighbours::within(&points, radius_m, max));
        timed(&mut least_ms[1], || {
            normals::from_neighbours(&points, &neighbours, normal_radius_m, normal_max)
        });
        timed(&mut least_ms[2], || fpfh::describe(&points, &given, &neighbours));
    }
    let [search, normals, features] = least_ms;
    println!(
        "search {search:.1} normals {normals:.1} features {features:.1} ms of {} points",
        points.len()
    );
    let neighbours = Neighbours::within(&points, radius_m, max);
    write(features_out, fpfh::describe(&points, &given, &neighbours).rows.into_iter().flatten())?;
    let signs = normals::from_neighbours_open3d(&points, &neighbours, normal_radius_m, normal_max);
    write(normals_out, signs.iter().flat_map(|n| [n.x, n.y, n.z]))?;
    Ok(())
}
