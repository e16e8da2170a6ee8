//! Overlap of a pair: the share of the surfaces seen by one sensor that the other sees, too.

use nalgebra::{Isometry3, Vector3};

use super::PosePair;
use crate::raycast::Raycaster;
use crate::vector::{dot, sub};

/// Beams that are traced at most: enough for a share within 2 %.
const MAX_BEAMS: usize = 1000;
/// Width of an azimuth sector of the field of view.
const SECTOR_DEG: f64 = 3.0;
/// Largest number of adjacent sectors without a beam that count as a gap of a coarse pattern.
const MAX_GAP: usize = 3;
/// Width by which the outermost beams extend the field of view.
const EDGE_DEG: f64 = 0.1;
/// Distance in front of a point at which a surface hides it, metres and share of the range: a
/// surface does not hide itself.
const BEFORE_M: f32 = 0.05;
const BEFORE_SHARE: f32 = 0.01;

/// Visibility of a place for a scanner.
pub struct Sight<'a> {
    caster: &'a Raycaster,
    /// Unit vectors in the sensor frame: a subset of the beams of the scanner.
    beams: Vec<[f32; 3]>,
    field: Field,
}

impl<'a> Sight<'a> {
    /// Visibility for a scanner with beams along `directions`: unit vectors, x forward, y left, z
    /// up.
    #[must_use]
    pub fn new(caster: &'a Raycaster, directions: &[[f32; 3]]) -> Self {
        let step = directions.len().div_ceil(MAX_BEAMS).max(1);
        let beams = directions.iter().step_by(step).copied().collect();
        Self { caster, beams, field: Field::new(directions) }
    }

    /// Share of the points seen by either sensor that the other sees, too, 0 to 1: points in its
    /// field of view with nothing in front. Points of the scene count, so it does not depend on the
    /// density of the scans.
    #[must_use]
    pub fn overlap(&self, pair: &PosePair) -> f64 {
        let PosePair { world_from_first, world_from_second } = pair;
        let forth = self.shared(world_from_first, world_from_second);
        let back = self.shared(world_from_second, world_from_first);
        let seen = forth.1 + back.1;
        (forth.0 + back.0) as f64 / seen.max(1) as f64
    }

    /// Number of points seen from one pose that are visible from another, and number of points
    /// seen.
    fn shared(&self, from: &Isometry3<f64>, to: &Isometry3<f64>) -> (usize, usize) {
        let points = self.beams.iter().filter_map(|beam| self.seen_along(from, beam));
        points.fold((0, 0), |(shared, seen), point| {
            (shared + usize::from(self.sees(to, point)), seen + 1)
        })
    }

    /// First surface point along a beam.
    fn seen_along(&self, from: &Isometry3<f64>, beam: &[f32; 3]) -> Option<[f32; 3]> {
        let origin: [f32; 3] = from.translation.vector.cast::<f32>().into();
        let way = (from.rotation * Vector3::from(beam.map(f64::from))).cast::<f32>();
        let hit = self.caster.cast(origin, way.into())?;
        Some(std::array::from_fn(|i| origin[i] + hit.range_m * way[i]))
    }

    fn sees(&self, world_from_sensor: &Isometry3<f64>, point: [f32; 3]) -> bool {
        let eye: [f32; 3] = world_from_sensor.translation.vector.cast::<f32>().into();
        let way = sub(point, eye);
        let range_m = dot(way, way).sqrt();
        let before_m = range_m - BEFORE_M - BEFORE_SHARE * range_m;
        if before_m <= 0.0 {
            return true;
        }
        let unit = way.map(|x| x / range_m);
        let own = world_from_sensor.rotation.inverse() * Vector3::from(unit.map(f64::from));
        self.field.has(&own) && self.caster.cast_within(eye, unit, before_m).is_none()
    }
}

/// Field of view: lowest and highest elevation of the beams in each azimuth sector, degrees;
/// reversed where there is none.
struct Field {
    sectors: Vec<[f64; 2]>,
}

const SECTORS: usize = (360.0 / SECTOR_DEG) as usize;

impl Field {
    fn new(directions: &[[f32; 3]]) -> Self {
        let mut sectors = vec![[f64::INFINITY, f64::NEG_INFINITY]; SECTORS];
        for direction in directions {
            let (sector, elevation_deg) = polar(&Vector3::from(direction.map(f64::from)));
            let [low, high] = &mut sectors[sector];
            (*low, *high) = (low.min(elevation_deg), high.max(elevation_deg));
        }
        let found = |from: usize, steps: [usize; MAX_GAP]| {
            let beside = steps.map(|step| sectors[(from + step) % SECTORS]);
            beside.into_iter().find(|[low, high]| low <= high)
        };
        let filled = (0..SECTORS).map(|i| {
            let after = found(i, std::array::from_fn(|k| k + 1));
            let before = found(i, std::array::from_fn(|k| SECTORS - 1 - k));
            match (sectors[i], before.zip(after)) {
                ([low, high], Some((before, after))) if low > high => {
                    [before[0].min(after[0]), before[1].max(after[1])]
                }
                (own, _) => own,
            }
        });
        Self { sectors: filled.collect() }
    }

    fn has(&self, direction: &Vector3<f64>) -> bool {
        let (sector, elevation_deg) = polar(direction);
        let [low, high] = self.sectors[sector];
        (low - EDGE_DEG..=high + EDGE_DEG).contains(&elevation_deg)
    }
}

/// Azimuth sector of a direction, and its elevation, degrees.
fn polar(direction: &Vector3<f64>) -> (usize, f64) {
    let azimuth_deg = libm::atan2(direction.y, direction.x).to_degrees();
    let sector = ((azimuth_deg + 180.0) / SECTOR_DEG) as usize;
    (sector.min(SECTORS - 1), libm::asin(direction.z.clamp(-1.0, 1.0)).to_degrees())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Mesh;
    use nalgebra::{Translation3, UnitQuaternion};

    /// Walls at x = `at.0`, from y = `at.1` to `at.2`, 40 m high.
    fn walls(list: &[(f32, f32, f32)]) -> Raycaster {
        let mut mesh = Mesh::default();
        for &(x, left, right) in list {
            let n = mesh.vertices.len() as u32;
            let corners = [(left, -20.0), (right, -20.0), (right, 20.0), (left, 20.0)];
            mesh.vertices.extend(corners.map(|(y, z)| [x, y, z]));
            mesh.triangles.extend([[n, n + 1, n + 2], [n, n + 2, n + 3]]);
            mesh.materials.extend([0, 0]);
        }
        Raycaster::from_mesh(&mesh)
    }

    /// Beams within 60° to both sides, level and slightly up and down.
    fn fan() -> Vec<[f32; 3]> {
        let ray = |k: i32| {
            let (turn, rise) = (f64::from(k % 121 - 60), f64::from(k / 121 - 2));
            let [turn, rise] = [turn, rise].map(f64::to_radians);
            let level = libm::cos(rise);
            [level * libm::cos(turn), level * libm::sin(turn), libm::sin(rise)].map(|x| x as f32)
        };
        (0..5 * 121).map(ray).collect()
    }

    fn pair(first: [f64; 3], second: [f64; 3], turn_deg: f64) -> PosePair {
        let at = |[x, y, z]: [f64; 3], turn: f64| {
            let turn = UnitQuaternion::from_euler_angles(0.0, 0.0, turn.to_radians());
            Isometry3::from_parts(Translation3::new(x, y, z), turn)
        };
        PosePair { world_from_first: at(first, 0.0), world_from_second: at(second, turn_deg) }
    }

    #[test]
    fn equal_poses_share_everything_and_opposite_headings_nothing() {
        let caster = walls(&[(20.0, -90.0, 90.0), (-20.0, -90.0, 90.0)]);
        let sight = Sight::new(&caster, &fan());
        assert_eq!(sight.overlap(&pair([0.0; 3], [0.0; 3], 0.0)), 1.0);
        assert_eq!(sight.overlap(&pair([0.0; 3], [0.0; 3], 180.0)), 0.0);
    }

    #[test]
    fn a_turn_by_half_the_field_of_view_shares_half() {
        // Walls all round: every beam hits one.
        let caster = walls(&[(20.0, -900.0, 900.0), (-20.0, -900.0, 900.0)]);
        let sight = Sight::new(&caster, &fan());
        let shared = sight.overlap(&pair([0.0; 3], [0.0; 3], 60.0));
        assert!((0.45..0.6).contains(&shared), "{shared}");
    }

    #[test]
    fn gaps_between_columns_of_a_coarse_pattern_belong_to_the_field_and_its_outside_does_not() {
        let column = |turn_deg: f64| {
            let turn = turn_deg.to_radians();
            let row = |rise: f64| [libm::cos(turn), libm::sin(turn), rise].map(|x| x as f32);
            [row(-0.1), row(0.1)]
        };
        let field = Field::new([-45.0, -37.0, -29.0].map(column).as_flattened());
        let has = |turn_deg: f64, rise: f64| {
            let turn = turn_deg.to_radians();
            field.has(&Vector3::new(libm::cos(turn), libm::sin(turn), rise).normalize())
        };
        assert!([-45.0, -41.0, -37.0, -33.0, -29.0].into_iter().all(|turn| has(turn, 0.0)));
        assert!([-60.0, -49.0, -25.0, 0.0, 180.0].into_iter().all(|turn| !has(turn, 0.0)));
        assert!(!has(-41.0, 0.2) && !has(-41.0, -0.2));
    }

    #[test]
    fn a_wall_in_between_hides_the_surfaces_behind_it() {
        let open = [(30.0, -90.0, 90.0)];
        let screened = [(30.0, -90.0, 90.0), (10.0, 4.0, 90.0)];
        let [open, screened] = [&open[..], &screened[..]].map(|walls_at| {
            let caster = walls(walls_at);
            Sight::new(&caster, &fan()).overlap(&pair([0.0; 3], [0.0, 12.0, 0.0], 0.0))
        });
        assert!(open > 0.7, "{open}");
        assert!(screened < 0.8 * open, "{screened}, without the screen {open}");
    }

    #[test]
    fn a_place_without_surfaces_shares_nothing() {
        let caster = Raycaster::from_mesh(&Mesh::default());
        assert_eq!(Sight::new(&caster, &fan()).overlap(&pair([0.0; 3], [0.0; 3], 0.0)), 0.0);
        assert_eq!(Sight::new(&caster, &[]).overlap(&pair([0.0; 3], [0.0; 3], 0.0)), 0.0);
    }
}
