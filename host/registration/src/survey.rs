//! Motions of clouds in survey coordinates: registered in frames near the points, told in those of
//! the files.

use std::fmt::{Display, Formatter, Result};

use echoloop_clouds::survey::shifted;
use echoloop_clouds::{Pose, Recorded};
use nalgebra::{Point3, Vector3};

use crate::{Covariance, OpenDirection, Outcome};

/// The shifts of two clouds, and the centre of the source.
#[derive(Clone, Debug)]
pub struct Frames {
    target_shift_m: Vector3<f64>,
    source_shift_m: Vector3<f64>,
    /// Centre of the source in the frame of its file, m.
    centre_m: Point3<f64>,
}

impl Frames {
    /// Frames of a pair.
    pub fn new(target: &Recorded, source: &Recorded) -> Self {
        let (target_shift_m, source_shift_m) = (target.shift_m, source.shift_m);
        Self { target_shift_m, source_shift_m, centre_m: source.centre_m() }
    }

    /// True when a cloud has a shift.
    pub fn are_shifted(&self) -> bool {
        self.target_shift_m != Vector3::zeros() || self.source_shift_m != Vector3::zeros()
    }

    /// The motion of the clouds that is this one of the files.
    pub fn inside(&self, target_from_source: &Pose) -> Pose {
        shifted(target_from_source, &self.target_shift_m, &self.source_shift_m)
    }

    /// The motion of the files that is this one of the clouds.
    pub fn outside(&self, target_from_source: &Pose) -> Pose {
        shifted(target_from_source, &-self.target_shift_m, &-self.source_shift_m)
    }

    /// Centre of the source in the frame of the target cloud, m; None without a shift.
    fn centre_inside_m(&self, outcome: &Outcome) -> Option<Point3<f64>> {
        let centre_m = || outcome.target_from_source * (self.centre_m - self.source_shift_m);
        self.are_shifted().then(centre_m)
    }

    /// Covariance of the motion: about the centre of the source, where the target has it, if a
    /// cloud has a shift; else about the target's origin.
    pub fn covariance(&self, outcome: &Outcome) -> Option<Covariance> {
        let centre_m = self.centre_inside_m(outcome);
        outcome.covariance.map(|c| centre_m.map_or(c, |centre_m| c.about(&centre_m)))
    }

    /// Directions that the scans leave open, about the same point as the covariance.
    pub fn open(&self, outcome: &Outcome) -> Vec<OpenDirection> {
        let centre_m = self.centre_inside_m(outcome);
        let about = |open: &OpenDirection| centre_m.map_or(*open, |centre_m| open.about(&centre_m));
        outcome.open.iter().map(about).collect()
    }

    /// A motion of the files about the centre of the source; None without a shift.
    pub fn about_centre(&self, target_from_source: &Pose) -> Option<AboutCentre> {
        let to_m = target_from_source * self.centre_m;
        let turn = target_from_source.rotation.scaled_axis();
        self.are_shifted().then(|| AboutCentre {
            from_m: self.centre_m.into(),
            to_m: to_m.into(),
            shift_m: (to_m - self.centre_m).into(),
            turn_deg: turn.map(f64::to_degrees).into(),
        })
    }
}

/// A motion as a turn about the centre of the source, and the shift of that centre.
#[derive(Clone, Copy, Debug)]
pub struct AboutCentre {
    /// The centre in the frame of the source, m.
    pub from_m: [f64; 3],
    /// The centre in the frame of the target, m.
    pub to_m: [f64; 3],
    /// Shift of the centre, m.
    pub shift_m: [f64; 3],
    /// Axis times angle, degrees.
    pub turn_deg: [f64; 3],
}

impl Display for AboutCentre {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        let ([x, y, z], [a, b, c], [u, v, w]) = (self.from_m, self.turn_deg, self.shift_m);
        writeln!(
            f,
            "about the source's centre, {x:.3} {y:.3} {z:.3} m: shift {u:.6} {v:.6} {w:.6} m,"
        )?;
        writeln!(f, "turn {a:.6} {b:.6} {c:.6}° (axis times angle)")
    }
}
