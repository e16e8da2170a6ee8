//! How much of what one sensor of a pair sees the other sees, too.

use nalgebra::{Isometry3, Vector3};

use super::PosePair;
use crate::raycast::{Raycaster, difference, dot};

/// Beams that are looked along: enough for a share within 2 %.
const MOST_BEAMS: usize = 1000;
/// Width of a sector of the field.
const SECTOR_DEG: f64 = 3.0;
/// So many sectors without a beam, between such that have one, are a gap of a coarse pattern.
const MOST_GAP: usize = 3;
/// The outermost beams have a width.
const EDGE_DEG: f64 = 0.1;
/// What lies so much before a point hides it, metres and share of the range: a surface does not
/// hide itself.
const BEFORE_M: f32 = 0.05;
const BEFORE_SHARE: f32 = 0.01;

/// What a scanner can see of a place.
pub struct Sight<'a> {
    caster: &'a Raycaster,
    /// Unit vectors, sensor frame; some of the scanner's.
    beams: Vec<[f32; 3]>,
    field: Field,
}

impl<'a> Sight<'a> {
    /// Of a scanner whose beams point along `directions`: unit vectors, x forward, y left, z up.
    #[must_use]
    pub fn new(caster: &'a Raycaster, directions: &[[f32; 3]]) -> Self {
        let step = directions.len().div_ceil(MOST_BEAMS).max(1);
        let beams = directions.iter().step_by(step).copied().collect();
        Self { caster, beams, field: Field::new(directions) }
    }

    /// The share of what either sensor sees that the other sees, too, 0 to 1: it lies in its field,
    /// and nothing is before it. Of points of the scene, so it does not hang on how densely either
    /// scans.
    #[must_use]
    pub fn overlap(&self, pair: &PosePair) -> f64 {
        let PosePair { world_from_first, world_from_second } = pair;
        let forth = self.shared(world_from_first, world_from_second);
        let back = self.shared(world_from_second, world_from_first);
        let seen = forth.1 + back.1;
        (forth.0 + back.0) as f64 / seen.max(1) as f64
    }

    /// How many points that a sensor sees another sees, too, and how many it sees.
    fn shared(&self, from: &Isometry3<f64>, to: &Isometry3<f64>) -> (usize, usize) {
        let points = self.beams.iter().filter_map(|beam| self.seen_along(from, beam));
        points.fold((0, 0), |(shared, seen), point| {
            (shared + usize::from(self.sees(to, point)), seen + 1)
        })
    }

    /// The first surface along a beam.
    fn seen_along(&self, from: &Isometry3<f64>, beam: &[f32; 3]) -> Option<[f32; 3]> {
        let origin: [f32; 3] = from.translation.vector.cast::<f32>().into();
        let way = (from.rotation * Vector3::from(beam.map(f64::from))).cast::<f32>();
        let hit = self.caster.cast(origin, way.into())?;
        Some(std::array::from_fn(|i| origin[i] + hit.range_m * way[i]))
    }

    fn sees(&self, world_from_sensor: &Isometry3<f64>, point: [f32; 3]) -> bool {
        let eye: [f32; 3] = world_from_sensor.translation.vector.cast::<f32>().into();
        let way = difference(point, eye);
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

/// From where to where beams point up and down in each sector of the azimuth, degrees; turned round
/// where none does.
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
        let found = |from: usize, steps: [usize; MOST_GAP]| {
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

/// The sector of a direction, and its elevation, degrees.
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

    /// Squares at x = `at.0`, from y = `at.1` to `at.2`, 40 m high.
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

    /// Ahead and to both sides by 60°, level and a little up and down.
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
    fn from_one_place_with_one_heading_everything_is_shared_and_with_opposite_ones_nothing() {
        let caster = walls(&[(20.0, -90.0, 90.0), (-20.0, -90.0, 90.0)]);
        let sight = Sight::new(&caster, &fan());
        assert_eq!(sight.overlap(&pair([0.0; 3], [0.0; 3], 0.0)), 1.0);
        assert_eq!(sight.overlap(&pair([0.0; 3], [0.0; 3], 180.0)), 0.0);
    }

    #[test]
    fn turned_by_half_the_field_half_is_shared() {
        // A ring of walls: every beam meets one.
        let caster = walls(&[(20.0, -900.0, 900.0), (-20.0, -900.0, 900.0)]);
        let sight = Sight::new(&caster, &fan());
        let shared = sight.overlap(&pair([0.0; 3], [0.0; 3], 60.0));
        assert!((0.45..0.6).contains(&shared), "{shared}");
    }

    #[test]
    fn between_the_columns_of_a_coarse_pattern_is_field_and_beside_the_outermost_is_none() {
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
    fn what_stands_between_hides_what_lies_behind() {
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
    fn a_place_in_which_nothing_is_seen_shares_nothing() {
        let caster = Raycaster::from_mesh(&Mesh::default());
        assert_eq!(Sight::new(&caster, &fan()).overlap(&pair([0.0; 3], [0.0; 3], 0.0)), 0.0);
        assert_eq!(Sight::new(&caster, &[]).overlap(&pair([0.0; 3], [0.0; 3], 0.0)), 0.0);
    }
}
