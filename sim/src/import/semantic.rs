//! Scans with semantic labels: PLY files of CARLA's semantic LiDAR.
//!
//! | property | type | meaning |
//! |---|---|---|
//! | `x`, `y`, `z` | float32 | m, sensor frame, left-handed: x ahead, y right, z up |
//! | `CosAngle` | float32 | cosine between beam and normal |
//! | `ObjIdx` | uint32 | index of the object, unused |
//! | `ObjTag` | uint32 | class of the object |
//!
//! The intensity of CARLA's own sensor does not depend on the surface. Here each class has a
//! measured reflectance, and a point returns what its surface would send back.

use echoloop_files::ply::{self, Body};
use echoloop_frontend::Return;
use ply_rs_bw::ply::{Property, PropertyAccess, PropertyAccessResult};

use super::ply::integer;
use crate::scanner::backscattered;
use crate::scene::{MATERIALS, Material, Surface};

/// Numbering of the classes: CARLA changed it once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tags {
    /// 0.9.14 and later, as in CityScapes.
    Carla0914,
    /// 0.9.11 to 0.9.13.
    Carla0911,
}

/// Name and surface of a class.
type Class = (&'static str, Surface);

/// `carla::rpc::CityObjectLabel` since 0.9.14.
const CARLA_0914: [Class; 29] = [
    ("unlabelled", Surface::Unknown),
    ("road", Surface::Asphalt),
    ("sidewalk", Surface::Paving),
    ("building", Surface::Plaster),
    ("wall", Surface::Concrete),
    ("fence", Surface::Wood),
    ("pole", Surface::Metal),
    ("traffic light", Surface::Metal),
    ("traffic sign", Surface::RetroSign),
    ("vegetation", Surface::Leaf),
    ("terrain", Surface::Grass),
    ("sky", Surface::Unknown),
    ("pedestrian", Surface::Unknown),
    ("rider", Surface::Unknown),
    ("car", Surface::CarPaint),
    ("truck", Surface::CarPaint),
    ("bus", Surface::CarPaint),
    ("train", Surface::Metal),
    ("motorcycle", Surface::DarkPaint),
    ("bicycle", Surface::Metal),
    ("static", Surface::Unknown),
    ("dynamic", Surface::Unknown),
    ("other", Surface::Unknown),
    ("water", Surface::Water),
    ("road line", Surface::RoadPaint),
    ("ground", Surface::Soil),
    ("bridge", Surface::Concrete),
    ("rail track", Surface::Gravel),
    ("guard rail", Surface::Metal),
];

/// Classes of 0.9.11 in its order, as indices into [`CARLA_0914`]; its one class "vehicle" is a
/// car.
const CARLA_0911: [u8; 23] =
    [0, 3, 5, 22, 12, 6, 24, 1, 2, 9, 14, 4, 8, 11, 25, 26, 27, 28, 7, 20, 21, 23, 10];

impl Tags {
    /// Names in the configuration.
    pub const NAMES: [&str; 2] = ["carla-0.9.14", "carla-0.9.11"];

    /// Numbering by its name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        let at = Self::NAMES.iter().position(|known| *known == name)?;
        [Self::Carla0914, Self::Carla0911].get(at).copied()
    }

    fn classes(self) -> usize {
        match self {
            Self::Carla0914 => CARLA_0914.len(),
            Self::Carla0911 => CARLA_0911.len(),
        }
    }

    /// Name and surface of the class with a number.
    #[must_use]
    pub fn class(self, tag: u32) -> Option<(&'static str, Surface)> {
        let tag = usize::try_from(tag).ok()?;
        match self {
            Self::Carla0914 => CARLA_0914.get(tag).copied(),
            Self::Carla0911 => CARLA_0914.get(usize::from(*CARLA_0911.get(tag)?)).copied(),
        }
    }

    fn material(self, tag: u32) -> Result<&'static Material, String> {
        let class = self.class(tag).and_then(|(_, of)| MATERIALS.get(usize::from(of.index())));
        class.ok_or_else(|| {
            let (last, name) = (self.classes() - 1, Self::NAMES[self as usize]);
            let other = Self::NAMES[1 - self as usize];
            format!(
                "ObjTag {tag} is none of 0 to {last}, the classes of {name} (or is it {other}?)"
            )
        })
    }
}

/// Beam of a labelled point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    /// Unit vector, sensor frame: x ahead, y left, z up.
    pub direction: [f32; 3],
    /// Return of the surface; `None` for a surface along the beam.
    pub echo: Option<Return>,
}

/// Reads the points of a file.
///
/// # Errors
///
/// A message with the fault and the index of the point.
pub fn parse_semantic(bytes: &[u8], tags: Tags) -> Result<Vec<Seen>, String> {
    let (header, reader) = ply::header(bytes)?;
    let vertex = ply::vertex(&header)?;
    if let Some(name) = ["CosAngle", "ObjTag"].iter().find(|&&n| !vertex.properties.contains_key(n))
    {
        return Err(format!(
            "expected the properties x, y, z, CosAngle and ObjTag of a semantic LiDAR, found no \
             {name}"
        ));
    }
    let mut body = Body::new(&header, reader, None)?;
    let mut seen = Vec::new();
    for element in header.elements.values() {
        if element.name != vertex.name {
            body.skip(element)?;
            continue;
        }
        body.read(element, |point: LabelledPoint| {
            let of_point = |what| format!("point {}: {what}", seen.len());
            seen.push(point.seen(tags).map_err(of_point)?);
            Ok::<_, String>(())
        })?;
    }
    Ok(seen)
}

/// Point as in the file.
#[derive(Debug, Default)]
struct LabelledPoint {
    at: [f32; 3],
    cos_angle: f32,
    tag: Option<u32>,
}

impl PropertyAccess for LabelledPoint {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, value: Property) -> PropertyAccessResult {
        let axis = ["x", "y", "z"].iter().position(|axis| *axis == name);
        match (axis, name) {
            (None, "ObjTag") => self.tag = integer(&value).and_then(|tag| tag.try_into().ok()),
            (None, "CosAngle") => self.cos_angle = value.to_f32_lossy().unwrap_or(f32::NAN),
            (Some(axis), _) => self.at[axis] = value.to_f32_lossy().unwrap_or(f32::NAN),
            _ => return PropertyAccessResult::Ignored,
        }
        PropertyAccessResult::Set
    }
}

impl LabelledPoint {
    fn seen(&self, tags: Tags) -> Result<Seen, String> {
        let [x, y, z] = self.at;
        let range = (f64::from(x).powi(2) + f64::from(y).powi(2) + f64::from(z).powi(2)).sqrt();
        if !range.is_finite() || range == 0.0 {
            return Err(format!("({x}, {y}, {z}) is no point that a sensor sees"));
        }
        let cos = self.cos_angle.abs();
        if cos.is_nan() || cos > 1.001 {
            return Err(format!("CosAngle {} is no cosine", self.cos_angle));
        }
        let tag = self.tag.ok_or("ObjTag is no whole number")?;
        let unit = |v: f32| (f64::from(v) / range) as f32;
        let range_m = range as f32;
        let strength_per_m2 = backscattered(tags.material(tag)?, cos.min(1.0), range_m);
        let echo = (strength_per_m2 > 0.0).then_some(Return { range_m, strength_per_m2 });
        // CARLA's y points right.
        Ok(Seen { direction: [unit(x), -unit(y), unit(z)], echo })
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use nalgebra::Isometry3;

    use super::*;
    use crate::raycast::Raycaster;
    use crate::scanner::{self, BeamOptics};
    use crate::scene::Mesh;

    const HEADER: &str = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float32 x\n\
        property float32 y\nproperty float32 z\nproperty float32 CosAngle\nproperty uint32 ObjIdx\n\
        property uint32 ObjTag\nend_header\n";

    fn message(text: &str) -> String {
        parse_semantic(text.as_bytes(), Tags::Carla0914).unwrap_err()
    }

    #[test]
    fn classes_have_the_numbers_that_each_version_gave_them() {
        let name = |tags: Tags, tag| tags.class(tag).unwrap().0;
        for (old, new, class) in [
            (0, 0, "unlabelled"),
            (1, 3, "building"),
            (6, 24, "road line"),
            (7, 1, "road"),
            (9, 9, "vegetation"),
            (10, 14, "car"),
            (12, 8, "traffic sign"),
            (17, 28, "guard rail"),
            (18, 7, "traffic light"),
            (22, 10, "terrain"),
        ] {
            assert_eq!([name(Tags::Carla0911, old), name(Tags::Carla0914, new)], [class; 2]);
        }
        assert_eq!((Tags::Carla0911.class(23), Tags::Carla0914.class(29)), (None, None));
        assert_eq!(Tags::NAMES.map(Tags::named), [Some(Tags::Carla0914), Some(Tags::Carla0911)]);
    }

    #[test]
    fn a_point_to_the_right_is_a_beam_to_the_right_with_the_reflectance_of_its_class() {
        let file = format!("{HEADER}3 4 0 -0.5 7 1\n");
        let [seen] = parse_semantic(file.as_bytes(), Tags::Carla0914).unwrap()[..] else {
            panic!("one point")
        };
        assert_eq!(seen.direction, [0.6, -0.8, 0.0]);
        let echo = seen.echo.unwrap();
        let expected = 0.168 * 0.5 / std::f32::consts::PI / 25.0; // asphalt
        assert!((echo.strength_per_m2 / expected - 1.0).abs() < 1e-6);
        assert_eq!(echo.range_m, 5.0);
    }

    #[test]
    fn a_file_that_is_no_semantic_scan_is_refused_with_the_missing_or_unknown_item() {
        let whole = format!("{HEADER}3 4 0 0.5 7 1\n");
        let table = [
            (whole.replace("0.5 7 1", "0.5 7 29"), "point 0: ObjTag 29 is none of 0 to 28"),
            (whole.replace("CosAngle", "Intensity"), "found no CosAngle"),
            (whole.replace("ObjTag", "Tag"), "found no ObjTag"),
            (whole.replace("uint32 ObjTag", "float32 ObjTag"), "no whole number"),
            (whole.replace("0.5 7", "1.5 7"), "CosAngle 1.5 is no cosine"),
            (whole.replace("0.5 7", "NaN 7"), "NaN 7"), // ASCII has no word for it
            (whole.replace("3 4 0 0", "0 0 0 0"), "no point that a sensor sees"),
            (whole.replace("vertex 1", "vertex 2"), "promises"),
            (whole.replace("3 4 0 0.5 7 1\n", ""), "promises"),
            ("hello".into(), "magic"),
        ];
        for (file, expected) in table {
            let message = message(&file);
            assert!(message.contains(expected), "{message}");
        }
    }

    #[test]
    fn a_simulated_scan_written_as_a_carla_file_reads_back_as_the_same_response() {
        let wall = Mesh {
            vertices: vec![[9.0, -20.0, -20.0], [12.0, 20.0, -20.0], [10.0, 0.0, 30.0]],
            triangles: vec![[0, 1, 2]],
            materials: vec![Surface::Plaster.index()],
        };
        let caster = Raycaster::from_mesh(&wall);
        let unit = |k: u32| {
            let (y, z) = (f64::from(k % 8) * 0.05 - 0.2, f64::from(k / 8) * 0.05 - 0.2);
            let length = (1.0 + y * y + z * z).sqrt();
            [1.0 / length, y / length, z / length].map(|v| v as f32)
        };
        let directions: Vec<[f32; 3]> = (0..64).map(unit).collect();
        let one = BeamOptics { subrays: 1, ..BeamOptics::default() };
        let pose = Isometry3::identity();
        let response = scanner::scan(&caster, MATERIALS, &pose, &directions, &one);
        let points: String = directions
            .iter()
            .map(|&d| {
                let hit = caster.cast([0.0; 3], d).unwrap();
                let [x, y, z] = d.map(|v| v * hit.range_m);
                format!("{x} {} {z} {} 0 3\n", -y, hit.cos_incidence)
            })
            .collect();
        let file = HEADER.replace("vertex 1", "vertex 64") + &points;
        let seen = parse_semantic(file.as_bytes(), Tags::Carla0914).unwrap();
        assert_eq!(seen.len(), 64);
        for (beam, seen) in seen.iter().enumerate() {
            let ([expected], Some(echo)) = (response.of(beam), seen.echo) else { panic!("{beam}") };
            assert!((echo.range_m / expected.range_m - 1.0).abs() < 1e-6);
            assert!((echo.strength_per_m2 / expected.strength_per_m2 - 1.0).abs() < 1e-5);
            let off = (0..3).map(|i| (seen.direction[i] - directions[beam][i]).abs());
            assert!(off.fold(0.0, f32::max) < 1e-6);
        }
    }
}
