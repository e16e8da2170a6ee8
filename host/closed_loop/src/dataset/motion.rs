//! Pose of a moving sensor at each beam.

use nalgebra::{Translation3, UnitQuaternion, Vector3};

use crate::beams::Beams;
use crate::config::{JitterPer, Motion};
use echoloop_clouds::Pose;
use echoloop_frontend::shaking;

/// Path of the sensor through one scan.
///
/// ```text
/// world_from_sensor(b) = world_from_middle · (v·t, exp(ω·t)) · (shift, exp(turn))
/// t = (fraction(b) − ½) · duration
/// ```
///
/// `fraction` is the firing time of a beam as a fraction of the scan. v and ω are in the sensor's
/// frame at the middle. shift and turn are normal, drawn for each column or beam as a pure function
/// of the seed and its number.
pub(super) struct Path<'a> {
    motion: Motion,
    beams: &'a Beams,
    world_from_middle: Pose,
    seed: u64,
}

impl<'a> Path<'a> {
    /// Path through `world_from_middle` in the middle of the scan.
    pub(super) fn new(
        motion: &Motion,
        beams: &'a Beams,
        world_from_middle: Pose,
        seed: u64,
    ) -> Self {
        Self { motion: *motion, beams, world_from_middle, seed }
    }

    /// Pose at a beam.
    pub(super) fn world_from_sensor(&self, beam: usize) -> Pose {
        let Motion { linear_m_s, angular_deg_s, .. } = self.motion;
        let duration_s = self.motion.scan_s(self.beams.pattern());
        let t = match duration_s {
            0.0 => 0.0,
            _ => (self.beams.fraction(beam, duration_s) - 0.5) * duration_s,
        };
        let moved = rigid(
            Vector3::from(linear_m_s) * t,
            Vector3::from(angular_deg_s.map(f64::to_radians)) * t,
        );
        self.world_from_middle * moved * self.jitter(beam)
    }

    fn jitter(&self, beam: usize) -> Pose {
        let Motion { jitter_mrad, jitter_mm, jitter_per, .. } = self.motion;
        if jitter_mrad == 0.0 && jitter_mm == 0.0 {
            return Pose::identity();
        }
        let number = match jitter_per {
            JitterPer::Column => self.beams.together(beam as u32).into(),
            JitterPer::Beam => beam as u64,
        };
        let stream = shaking(self.seed, number);
        let draw = |first: u64, sigma: f64| {
            Vector3::from([0, 2, 4].map(|i| 1e-3 * sigma * stream.normal(first + i)))
        };
        rigid(draw(0, jitter_mm), draw(6, jitter_mrad))
    }
}

fn rigid(shift_m: Vector3<f64>, turn_rad: Vector3<f64>) -> Pose {
    Pose::from_parts(Translation3::from(shift_m), UnitQuaternion::from_scaled_axis(turn_rad))
}

#[cfg(test)]
mod tests {
    use std::sync::LazyLock;

    use echoloop_dsp::{Grid, ScanPattern, Spinning, SpinningModel};

    use super::*;
    use crate::beams::list::BeamList;

    const PATTERN: ScanPattern = ScanPattern::Grid(Grid {
        columns: 100,
        rows: 20,
        azimuth_cdeg: 18_000,
        elevation_cdeg: 9_000,
    });

    static BEAMS: LazyLock<Beams> = LazyLock::new(|| Beams::new(PATTERN));

    fn path(motion: Motion) -> Path<'static> {
        Path::new(&motion, &BEAMS, Pose::translation(1.0, 2.0, 3.0), 5)
    }

    #[test]
    fn a_steady_sensor_goes_straight_through_its_pose() {
        let path = path(Motion {
            duration_s: 0.1,
            linear_m_s: [20.0, -1.0, 0.0],
            angular_deg_s: [0.0, 0.0, 90.0],
            ..Motion::default()
        });
        let (first, last) = (path.world_from_sensor(0), path.world_from_sensor(1999));
        let way = last.translation.vector - first.translation.vector;
        assert!((way - Vector3::new(2.0, -0.1, 0.0) * (1999.0 / 2000.0)).norm() < 1e-9, "{way}");
        assert!(
            ((first.translation.vector + last.translation.vector) / 2.0
                - Vector3::new(1.0, 2.0, 3.0))
            .norm()
                < 1e-9
        );
        let turn = first.rotation.inverse() * last.rotation;
        assert!((turn.scaled_axis().z - 9_f64.to_radians() * 1999.0 / 2000.0).abs() < 1e-9);
    }

    /// At 10 m/s for 0.1 s: 1 m from the first instant to the last, 0 in the middle.
    #[test]
    fn a_beam_is_where_the_sensor_is_when_the_pattern_fires_it() {
        let motion = Motion { duration_s: 0.1, linear_m_s: [10.0, 0.0, 0.0], ..Motion::default() };
        let x = |beams: &Beams, beam: usize| {
            let path = Path::new(&motion, beams, Pose::identity(), 5);
            path.world_from_sensor(beam).translation.x
        };
        let near = |got: f64, expected: f64| {
            assert!((got - expected).abs() < 1e-12, "{got} for {expected}");
        };
        // The first and the last laser of a VLP-16's column: slots 0 and 15 of 24.
        let head = Spinning { model: SpinningModel::Vlp16, columns: 10 };
        let vlp = Beams::new(ScanPattern::Spinning(head));
        near(x(&vlp, 3 * 16), (3.0 + 0.5 / 24.0) / 10.0 - 0.5);
        near(x(&vlp, 3 * 16 + 15), (3.0 + 15.5 / 24.0) / 10.0 - 0.5);
        // All lasers of a column of an OS1 fire at once.
        let head = Spinning { model: SpinningModel::Os1x64, columns: 10 };
        let os1 = Beams::new(ScanPattern::Spinning(head));
        near(x(&os1, 9 * 64), 0.45);
        near(x(&os1, 9 * 64 + 63), 0.45);
        // Times of a table, in any order.
        let rows = "azimuth_deg,elevation_deg,time_s,channel\n0,0,0.1,0\n0,0,0,0\n0,0,0.03,0\n";
        let table = Beams::of_list(BeamList::from_csv(rows.as_bytes()).unwrap().into());
        [0.5, -0.5, -0.2].iter().enumerate().for_each(|(beam, at)| near(x(&table, beam), *at));
    }

    #[test]
    fn jitter_has_the_configured_spread_and_moves_a_column_or_each_beam() {
        for (jitter_per, count, same) in
            [(JitterPer::Column, 100_usize, true), (JitterPer::Beam, 2_000, false)]
        {
            let path =
                path(Motion { jitter_mrad: 2.0, jitter_mm: 5.0, jitter_per, ..Motion::default() });
            let shift = |beam: usize| {
                path.world_from_sensor(beam).translation.vector - Vector3::new(1.0, 2.0, 3.0)
            };
            let turn = |beam: usize| path.world_from_sensor(beam).rotation.scaled_axis();
            assert_eq!(shift(40) == shift(41), same);
            assert_ne!(shift(39), shift(40));
            let step = 2_000 / count;
            let rms = |of: &dyn Fn(usize) -> Vector3<f64>| {
                let sum: f64 = (0..count).map(|i| of(i * step).norm_squared()).sum();
                (sum / (3 * count) as f64).sqrt()
            };
            let confidence = 4.0 / (6.0 * count as f64).sqrt();
            assert!((rms(&shift) / 5e-3 - 1.0).abs() < confidence, "{}", rms(&shift));
            assert!((rms(&turn) / 2e-3 - 1.0).abs() < confidence, "{}", rms(&turn));
        }
    }
}
