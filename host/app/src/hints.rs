//! Hints for clouds that are not registered: what is odd about a cloud, and the cure.

use std::path::Path;

use echoloop_clouds::Cloud;
use echoloop_registration::suggest::radius_m;
use nalgebra::{Matrix3, Vector3};

/// Least number of points of a scene: of three real pairs, 2,000 random points register with each
/// other and with the whole clouds, 1,000 do not always.
const LEAST_POINTS: usize = 2_000;

/// Least number of points whose shape says anything.
const LEAST_SHAPE: usize = 50;

/// Least number of points per m², seen from above. Of hills with 0.03, a motion right to 2 cm is
/// refused: 1 % of the points lie on the other cloud.
const LEAST_PER_M2: f64 = 0.5;

/// Radii of scenes, m: a point's noise is less, a survey of 2 km by 2 km no more.
const LEAST_RADIUS_M: f64 = 0.1;
const MOST_RADIUS_M: f64 = 2_000.0;

/// Units that clouds come in, metres in each, and the largest factor between it and the clouds'
/// relative size: a map three times as large as a scan is no rarity, of thirty times it is.
const UNITS: [(&str, f64, f64); 4] = [
    ("millimetres", 0.001, 1.25),
    ("centimetres", 0.01, 1.25),
    ("inches", 0.0254, 1.25),
    ("feet", 0.3048, 1.1),
];

/// Largest thickness of a line or of a plane, over its length, as standard deviations.
const THIN: f64 = 0.01;

/// Largest standard deviation of the elevation of one ring, rad: 0.3°.
const RING_RAD: f64 = 0.005;

/// Least standard deviation across a ring, rad: directions of a narrow view are in a plane, too.
const ROUND_RAD: f64 = 0.2;

/// Hints for target and source, which were read with some `--scale`, one line each; none for two
/// ordinary clouds.
pub(super) fn hints(clouds: [(&Path, &Cloud); 2], scales: [f64; 2]) -> Vec<String> {
    let radii_m = clouds.map(|(_, cloud)| radius_m(cloud));
    let names = clouds.map(|(path, _)| path.display().to_string());
    let shape = |i: usize| shape(&names[i], clouds[i].1, radii_m[i]);
    let mut hints: Vec<String> = [0, 1].into_iter().filter_map(shape).collect();
    if clouds.iter().all(|(_, cloud)| cloud.points.len() >= LEAST_POINTS) {
        let unit = unit(&names, radii_m, scales);
        let sparse = |i: usize| sparse(&names[i], clouds[i].1).filter(|_| unit.is_none());
        hints.extend([0, 1].into_iter().filter_map(sparse));
        hints.extend(unit);
    }
    hints
}

/// A cloud of points that are no surfaces, or of too few.
fn shape(name: &str, cloud: &Cloud, radius_m: f64) -> Option<String> {
    let count = cloud.points.len();
    let points = || cloud.points.iter().map(|p| p.coords.cast::<f64>());
    let [length, width, thickness] = spread(points());
    let [_, round_rad, off_ring_rad] =
        spread(points().map(|p| p.try_normalize(0.0).unwrap_or_default()));
    let shape = match () {
        () if count < LEAST_SHAPE => None,
        () if radius_m == 0.0 => Some("lie on one another"),
        () if width < THIN * length => Some("lie on a line"),
        () if off_ring_rad < RING_RAD && round_rad > ROUND_RAD => Some("are one ring of a scan"),
        () if thickness < THIN * length => Some("lie in a plane"),
        () => None,
    };
    let few = || format!("{name} has {count} points, expected {LEAST_POINTS} or more for a scene");
    match shape {
        Some(shape) => {
            Some(format!("the points of {name} {shape}, expected surfaces that face several ways"))
        }
        None => (count < LEAST_POINTS).then(few),
    }
}

/// A cloud so thin that its points lie on none of the other's surfaces, whatever the motion.
fn sparse(name: &str, cloud: &Cloud) -> Option<String> {
    let [length, width, _] = spread(cloud.points.iter().map(|p| p.coords.cast::<f64>()));
    // A disc's area, and nearly a rectangle's.
    let a_m2 = cloud.points.len() as f64 / (4.0 * std::f64::consts::PI * length * width);
    (a_m2 < LEAST_PER_M2).then(|| {
        format!(
            "{name} has about {a_m2:.2} points per m², expected {LEAST_PER_M2} or more: if it is \
             not in metres, give --scale"
        )
    })
}

/// Standard deviations of points along their principal axes, largest first.
fn spread(points: impl ExactSizeIterator<Item = Vector3<f64>> + Clone) -> [f64; 3] {
    let count = points.len() as f64;
    let mean = points.clone().sum::<Vector3<f64>>() / count;
    let square = |p: Vector3<f64>| (p - mean) * (p - mean).transpose();
    let variances = points.map(square).sum::<Matrix3<f64>>().symmetric_eigenvalues() / count;
    let mut spread: [f64; 3] = variances.map(|v| v.max(0.0).sqrt()).into();
    spread.sort_by(|a, b| b.total_cmp(a));
    spread
}

/// Two clouds that differ in size as units do, or one of a size that no scene has.
fn unit(names: &[String; 2], radii_m: [f64; 2], mut scales: [f64; 2]) -> Option<String> {
    let is_needless = |i: &usize| {
        let radius_m = radii_m[*i] / scales[*i];
        let is_scene = (LEAST_RADIUS_M..=MOST_RADIUS_M).contains(&radius_m);
        scales[*i] != 1.0 && is_scene && is_about(radius_m / radii_m[1 - i], UNITS[0].2)
    };
    if let Some(i) = [0, 1].into_iter().find(is_needless) {
        let (scale, name, other) = (scales[i], &names[i], &names[1 - i]);
        scales[i] = 1.0;
        return Some(format!(
            "without its --scale of {scale}, {name} would be as large as {other}: {}",
            give(scales)
        ));
    }
    let larger = usize::from(radii_m[1] > radii_m[0]);
    let [large, small] = [larger, 1 - larger].map(|cloud| (&names[cloud], radii_m[cloud]));
    let ratio = large.1 / small.1;
    let is_near = |(_, scale, most): &&(&str, f64, f64)| {
        is_about(ratio * scale, *most) && small.1 >= LEAST_RADIUS_M
    };
    if let Some((unit, scale, _)) = UNITS.iter().find(is_near) {
        scales[larger] *= scale;
        return Some(format!(
            "{} is {ratio:.1} times as large as {}: if it is in {unit}, {}",
            large.0,
            small.0,
            give(scales)
        ));
    }
    let (cloud, example) = match () {
        () if large.1 > MOST_RADIUS_M => (larger, "0.001 for millimetres"),
        () if small.1 < LEAST_RADIUS_M => (1 - larger, "1000 for kilometres"),
        () => return None,
    };
    let (name, radius_m) = (&names[cloud], radii_m[cloud]);
    let cure = match scales[cloud] {
        1.0 => format!("give --scale, as {example}"),
        scale => format!("give another --scale than {scale}"),
    };
    let digits = if radius_m < 1.0 { 3 } else { 0 };
    Some(format!(
        "9 of 10 points of {name} lie within {radius_m:.digits$} m of their middle, expected \
         {LEAST_RADIUS_M} to {MOST_RADIUS_M} m: if they are not in metres, {cure}"
    ))
}

/// True when a ratio is 1 within a factor of `most`.
fn is_about(ratio: f64, most: f64) -> bool {
    ratio.max(1.0 / ratio) < most
}

fn give(scales: [f64; 2]) -> String {
    let [target, source] = scales.map(|scale| (scale * 1e9).round() / 1e9);
    format!("give --scale {target},{source}")
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::*;

    /// Points of a room of 12 m by 8 m by 3 m, as from its middle, some metres a unit.
    fn room(count: usize, unit: f64) -> Cloud {
        let point = |i: usize| {
            let t = i as f64;
            let way = Vector3::new((t * 2.4).cos(), (t * 2.4).sin(), (t * 0.7).sin());
            let range = [6.0, 4.0, 1.5].into_iter().zip(way.iter()).map(|(d, w)| d / w.abs());
            Point3::from(way * range.fold(f64::MAX, f64::min) * unit).cast()
        };
        Cloud::new((0..count).map(point).collect())
    }

    type Curve = fn(f32) -> [f32; 3];

    fn of(map: Curve) -> Cloud {
        Cloud::new((1..3000).map(|i| Point3::from(map(i as f32 * 0.01))).collect())
    }

    fn hinted(target: &Cloud, source: &Cloud) -> String {
        hinted_as(target, source, [1.0; 2])
    }

    fn hinted_as(target: &Cloud, source: &Cloud, scales: [f64; 2]) -> String {
        hints([(Path::new("a.ply"), target), (Path::new("b.ply"), source)], scales).join("\n")
    }

    #[test]
    fn ordinary_clouds_have_no_hint() {
        let (room, wide, yard) = (room(3000, 1.0), room(9000, 10.0), room(2500, 2.0));
        for (a, b) in [(&room, &room), (&room, &yard), (&yard, &room), (&wide, &wide)] {
            assert_eq!(hinted(a, b), "");
        }
    }

    #[test]
    fn a_narrow_view_is_no_ring() {
        let wall = |i: u16| [40.0, f32::from(i % 70) * 0.05, f32::from(i / 70) * 0.05];
        let steps = |[x, y, z]: [f32; 3]| Point3::new(x + y.floor(), y, z);
        let view = Cloud::new((0..4900).map(wall).map(steps).collect());
        assert_eq!(hinted(&view, &view), "");
    }

    #[test]
    fn a_cloud_in_another_unit_is_named_with_the_scale_that_cures_it() {
        let metres = room(3000, 1.0);
        for (per_metre, scale, unit) in [
            (1000.0, "0.001", "millimetres"),
            (100.0, "0.01", "centimetres"),
            (1.0 / 0.0254, "0.0254", "inches"),
            (1.0 / 0.3048, "0.3048", "feet"),
        ] {
            let other = room(2500, per_metre);
            let (first, second) = (hinted(&other, &metres), hinted(&metres, &other));
            assert!(first.starts_with("a.ply is ") && first.contains(unit), "{first}");
            assert!(first.ends_with(&format!("--scale {scale},1")), "{first}");
            assert!(second.starts_with("b.ply is "), "{second}");
            assert!(second.ends_with(&format!("--scale 1,{scale}")), "{second}");
        }
        // Both are in millimetres, and one was read so.
        let again = hinted_as(&metres, &room(2500, 1e3), [0.001, 1.0]);
        assert!(again.contains("in millimetres") && again.ends_with("0.001,0.001"), "{again}");
        // One of two in metres was read as millimetres, and both were.
        let undone = hinted_as(&metres, &room(2500, 1e-3), [1.0, 0.001]);
        assert!(undone.ends_with("as large as a.ply: give --scale 1,1"), "{undone}");
        let wrong = hinted_as(&room(3000, 1e-3), &room(2500, 1e-3), [0.001; 2]);
        assert!(wrong.ends_with("give another --scale than 0.001"), "{wrong}");
        let both = hinted(&room(3000, 1e3), &room(3000, 1e3));
        assert!(both.contains("of a.ply lie within") && both.contains("--scale"), "{both}");
        let tiny = hinted(&metres, &room(3000, 1e-3));
        assert!(tiny.contains("of b.ply lie within 0.005 m"), "{tiny}");
    }

    #[test]
    fn a_cloud_of_few_points_is_named_with_their_number() {
        let few = hinted(&room(3000, 1.0), &room(199, 1e3));
        assert_eq!(few, "b.ply has 199 points, expected 2000 or more for a scene");
        assert_eq!(hinted(&Cloud::default(), &room(9, 1.0)).lines().count(), 2);
        let sparse = hinted(&room(3000, 60.0), &room(9000, 60.0));
        assert!(sparse.starts_with("a.ply has about 0.01 points per m²"), "{sparse}");
        assert_eq!(sparse.lines().count(), 2, "{sparse}");
    }

    #[test]
    fn points_that_are_no_surfaces_are_named_with_their_shape() {
        let table: [(Curve, &str); 5] = [
            (|_| [0.1, 0.2, 0.3], "lie on one another"),
            (|t| [t, 5.0 - t, 2.0], "lie on a line"),
            (|t| [9.0 * t.cos(), 7.0 * t.sin(), 0.1], "are one ring"),
            (|t| [t * t.cos(), t * t.sin(), t * 0.5], "are one ring"),
            (|t| [t.cos() * t, t.sin() * t, -2.0], "lie in a plane"),
        ];
        for (map, shape) in table {
            let hint = hinted(&room(3000, 1.0), &of(map));
            assert!(hint.starts_with(&format!("the points of b.ply {shape}")), "{shape}: {hint}");
        }
    }
}
