//! A cloud with everything that its file says of each point.

use echoloop_files::attribute::RANGE_SD;
use echoloop_files::{Column, Coordinates, NumberType};
use nalgebra::{Point3, Vector3};

use crate::cloud::retain;
use crate::format::check_growth;
use crate::pose::Pose;
use crate::survey::{Exact, Precision, WELL_NEAR_M, check_range, refuse_shift, shift_m};
use crate::{Cloud, Dropped};

/// Names of normals in files: those of PLY, and those of PCL in PCD.
pub(crate) const NORMALS: [[&str; 3]; 2] =
    [["nx", "ny", "nz"], ["normal_x", "normal_y", "normal_z"]];

/// The part of a file to keep.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Keep {
    /// The fields of a [`Cloud`].
    Points,
    /// Coordinates and every other number of each point.
    All,
}

/// A cloud with everything else that its file says of each point.
///
/// Points that are removed from the cloud are removed from the columns too. Survey coordinates,
/// too far from the origin for `f32`, are near zero in the cloud: `shift_m` is taken from them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Recorded {
    /// The points, with their σ_R if the file has it, in the frame of the file less `shift_m`.
    pub cloud: Cloud,
    /// Origin of the cloud in the frame of the file, whole metres; zero unless the points are more
    /// than 1 km from the origin, and not straight below it.
    pub shift_m: Vector3<f64>,
    /// The coordinates of the same points that `f32` does not hold: those of a cloud with a shift,
    /// and those that a file has as `f64`.
    pub exact: Option<Exact>,
    /// Everything else that has one number per point; each column is as long as the cloud.
    pub columns: Vec<Column>,
    /// Names of the fields with several numbers per point, which are not read.
    pub left_out: Vec<String>,
}

impl Recorded {
    /// A cloud without columns, as its file has it: without a shift.
    pub(crate) fn of(coordinates: Coordinates, range_sd_m: Option<Vec<f32>>) -> Self {
        let wide = |points: Vec<[f64; 3]>, precision| {
            let at_m = points.into_iter().map(Point3::from).collect();
            Some(Exact { at_m, precision })
        };
        let (single, exact) = match coordinates {
            Coordinates::Single(points) => (points.into_iter().map(Point3::from).collect(), None),
            Coordinates::Wide(points) => (Vec::new(), wide(points, Precision::Wide)),
            Coordinates::Double(points) => (Vec::new(), wide(points, Precision::Double)),
        };
        let cloud = Cloud { range_sd_m, ..Cloud::new(single) };
        let mut recorded = Self { cloud, exact, ..Self::default() };
        recorded.narrow();
        recorded
    }

    /// A cloud of coordinates in memory, m, as [`read_points`](crate::read_points) makes it of a
    /// file: without points that are no echo, and with a shift far from the origin.
    ///
    /// # Errors
    ///
    /// The point whose coordinates are too large, or whose σ_R is none.
    pub fn from_coordinates(
        coordinates: Coordinates,
        range_sd_m: Option<Vec<f32>>,
    ) -> Result<(Self, Dropped), String> {
        let mut recorded = Self::of(coordinates, range_sd_m);
        recorded.check_sds()?;
        // As most are: then nothing below has anything to do, at a tenth of the time.
        if recorded.cloud.is_surely_within(WELL_NEAR_M) {
            recorded.keep_exact_of_double();
            return Ok((recorded, Dropped::default()));
        }
        recorded.check_range()?;
        let dropped = recorded.drop_invalid();
        recorded.locate();
        Ok((recorded, dropped))
    }

    /// Computes the points of the cloud from the exact coordinates, if there are any.
    fn narrow(&mut self) {
        if let Some(exact) = &self.exact {
            let near = |p: &Point3<f64>| (p - self.shift_m).cast();
            self.cloud.points.clear(); // in place, to take no more memory
            self.cloud.points.extend(exact.at_m.iter().map(near));
        }
    }

    /// Coordinates in the frame of the file, m.
    fn coordinates(&self) -> Box<dyn ExactSizeIterator<Item = Point3<f64>> + '_> {
        match &self.exact {
            Some(exact) => Box::new(exact.at_m.iter().copied()),
            None => Box::new(self.cloud.points.iter().map(|p| p.cast() + self.shift_m)),
        }
    }

    /// Chooses the shift for the points where they are. Exact coordinates are kept where they are
    /// needed.
    pub(crate) fn locate(&mut self) {
        let shift_m = shift_m(self.coordinates());
        if self.exact.is_none() && shift_m != Vector3::zeros() {
            let at_m = self.coordinates().collect();
            self.exact = Some(Exact { at_m, precision: Precision::Single });
        }
        self.shift_by(shift_m);
        if shift_m == Vector3::zeros() {
            self.keep_exact_of_double();
        }
    }

    /// Without a shift, only coordinates that a file has as `f64` are kept as such.
    fn keep_exact_of_double(&mut self) {
        self.exact.take_if(|exact| exact.precision != Precision::Double);
    }

    /// Brings a cloud to metres, whose file has its lengths in another unit.
    pub fn scale(&mut self, m_per_unit: f64) {
        if m_per_unit == 1.0 {
            return;
        }
        match &mut self.exact {
            Some(exact) => exact.at_m.iter_mut().for_each(|p| *p *= m_per_unit),
            None => {
                let scaled = |p: &mut Point3<f32>| *p = (p.cast::<f64>() * m_per_unit).cast();
                self.cloud.points.iter_mut().for_each(scaled);
            }
        }
        let sds = self.cloud.range_sd_m.iter_mut().flatten();
        sds.for_each(|sd| *sd = (f64::from(*sd) * m_per_unit) as f32);
        self.shift_m = Vector3::zeros();
        self.narrow();
        self.locate();
    }

    /// Refuses a cloud that takes too much for the size of its file once it is
    /// [located](Self::locate) far from the origin, where `f64` are kept beside its `f32`.
    pub(crate) fn check_growth(&self, file: u64) -> Result<(), String> {
        if self.exact.is_some() {
            return Ok(()); // its f64 counted when it was read
        }
        let columns: usize = self.columns.iter().map(|column| column.kind().size()).sum();
        let sd = self.cloud.range_sd_m.as_ref().map_or(0, |_| size_of::<f32>());
        let each = size_of::<Point3<f32>>() + sd + columns;
        // Points that were no echo are gone, their room is not.
        let room = self.cloud.points.capacity() * each;
        let located = room + self.cloud.points.len() * size_of::<Point3<f64>>();
        let is_far = || shift_m(self.coordinates()) != Vector3::zeros();
        match check_growth(located as u64, file) {
            Err(error) if is_far() => Err(error),
            _ => Ok(()),
        }
    }

    /// Sets the shift, whole metres, of a cloud that has one, so that it is near another's frame.
    pub fn shift_by(&mut self, shift_m: Vector3<f64>) {
        if self.shift_m != shift_m && self.exact.is_some() {
            self.shift_m = shift_m;
            self.narrow();
        }
    }

    /// The centre of the points in the frame of the file, m; the origin without points.
    #[must_use]
    pub fn centre_m(&self) -> Point3<f64> {
        let sum: Vector3<f64> = self.cloud.points.iter().map(|p| p.coords.cast::<f64>()).sum();
        Point3::from(self.shift_m + sum / self.cloud.points.len().max(1) as f64)
    }

    /// The cloud alone, in the frame of the file; refuses coordinates that `f32` does not hold.
    pub(crate) fn into_cloud(self) -> Result<Cloud, String> {
        if self.exact.is_some() {
            refuse_shift(&shift_m(self.coordinates()))?;
        }
        Ok(self.cloud)
    }

    /// Refuses coordinates that are too large. Single points far off, as some sensors mark what
    /// they did not see, are no matter where `f32` holds the cloud.
    pub(crate) fn check_range(&self) -> Result<(), String> {
        if self.exact.is_none() {
            return Ok(());
        }
        check_range(self.coordinates())
    }

    /// Removes points that are no echo, and counts them.
    pub fn drop_invalid(&mut self) -> Dropped {
        if self.cloud.is_surely_valid() {
            return Dropped::default();
        }
        let keep = self.cloud.valid();
        let dropped = self.cloud.drop_invalid();
        if dropped.total() > 0 {
            self.columns.iter_mut().for_each(|column| column.retain(&keep));
            self.exact.iter_mut().for_each(|exact| retain(&mut exact.at_m, &keep));
        }
        dropped
    }

    /// Moves the points from the frame of their file to a new one and turns their normals, those
    /// among the columns too. Other columns stay: σ_R is along the beam, and the beam moves with
    /// the points. Points that come to lie far from the origin get a shift.
    pub fn transform(&mut self, new_from_old: &Pose) {
        match &mut self.exact {
            Some(exact) => exact.at_m.iter_mut().for_each(|p| *p = new_from_old * *p),
            None => {
                let at_m = self.cloud.points.iter().map(|p| new_from_old * p.cast::<f64>());
                self.exact = Some(Exact { at_m: at_m.collect(), precision: Precision::Wide });
            }
        }
        let before_m = self.shift_m.amax();
        self.shift_m = Vector3::zeros();
        self.narrow();
        self.locate();
        let is_farther = self.shift_m.amax() > 2.0 * before_m;
        for exact in
            self.exact.iter_mut().filter(|e| is_farther && e.precision == Precision::Single)
        {
            exact.precision = Precision::Wide; // f32 would lose what it held before
        }
        let cloud = &mut self.cloud;
        let turned = |n: Vector3<f64>| new_from_old.rotation * n;
        for normal in cloud.normals.iter_mut().flatten() {
            *normal = turned(normal.cast()).cast();
        }
        for names in NORMALS {
            turn(&mut self.columns, names, turned);
        }
    }

    /// Refuses a σ_R that is negative or not finite, at a point that is an echo.
    pub(crate) fn check_sds(&self) -> Result<(), String> {
        if self.cloud.range_sd_m.is_none() {
            return Ok(());
        }
        let sds = self.cloud.range_sd_m.iter().flatten().enumerate();
        let wrong = sds.zip(self.cloud.valid()).find(|((_, sd), is_valid)| {
            *is_valid && !(sd.is_finite() && **sd >= 0.0) // -0 is allowed
        });
        match wrong {
            Some(((point, sd), _)) => Err(format!(
                "the {} of point {point}, counted from 0, is {sd}, expected 0 m or more, finite",
                RANGE_SD.name
            )),
            None => Ok(()),
        }
    }
}

/// Turns the three columns of a vector; None when one is missing.
fn turn(
    columns: &mut [Column],
    names: [&str; 3],
    turned: impl Fn(Vector3<f64>) -> Vector3<f64>,
) -> Option<()> {
    let place = |name: &str| {
        let is_it =
            |c: &Column| c.name == name && matches!(c.kind(), NumberType::F32 | NumberType::F64);
        columns.iter().position(is_it)
    };
    let places = [place(names[0])?, place(names[1])?, place(names[2])?];
    let old = places.map(|at| columns[at].values().collect::<Vec<_>>());
    for (axis, at) in places.into_iter().enumerate() {
        let mut column = Column::new(names[axis], columns[at].kind(), old[axis].len());
        for ((x, y), z) in old[0].iter().zip(&old[1]).zip(&old[2]) {
            column.push(turned(Vector3::new(*x, *y, *z))[axis]);
        }
        columns[at] = column;
    }
    Some(())
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use echoloop_files::attribute::RING;

    use super::*;

    fn column(name: &str, values: &[f64]) -> Column {
        let mut column = Column::new(name, NumberType::F32, values.len());
        values.iter().for_each(|value| column.push(*value));
        column
    }

    #[test]
    fn columns_lose_the_points_of_the_cloud_and_a_bad_sd_counts_only_on_an_echo() {
        let points = vec![[f32::NAN; 3].into(), [1.0, 2.0, 3.0].into(), [0.0; 3].into()];
        let range_sd_m = Some(vec![f32::NAN, 0.1, -1.0]);
        let ring = RING.column([4.0, 5.0, 6.0].into_iter());
        let mut recorded = Recorded {
            cloud: Cloud { range_sd_m, ..Cloud::new(points) },
            columns: vec![ring],
            ..Recorded::default()
        };
        assert_eq!(recorded.check_sds(), Ok(()));
        assert_eq!(recorded.drop_invalid().total(), 2);
        assert_eq!(recorded.cloud.range_sd_m, Some(vec![0.1]));
        assert_eq!(recorded.columns[0].values().collect::<Vec<_>>(), [5.0]);
        recorded.cloud.range_sd_m = Some(vec![f32::INFINITY]);
        assert!(recorded.check_sds().unwrap_err().contains("range_sd of point 0, counted from 0"));
    }

    #[test]
    fn transform_moves_points_and_turns_normals_and_leaves_the_rest() {
        let mut recorded = Recorded::of(Coordinates::Single(vec![[1.0, 0.0, 0.0]]), None);
        recorded.columns = vec![
            column("normal_x", &[1.0]),
            column("ring", &[7.0]),
            column("normal_y", &[0.0]),
            column("normal_z", &[0.0]),
            column("nx", &[1.0]),
        ];
        let quarter = Vector3::z() * std::f64::consts::FRAC_PI_2;
        recorded.transform(&Pose::new(Vector3::new(0.0, 0.0, 5.0), quarter));
        let values = |at: usize| recorded.columns[at].values().next().unwrap();
        assert!((recorded.cloud.points[0].coords - Vector3::new(0.0, 1.0, 5.0)).norm() < 1e-6);
        assert!(values(0).abs() < 1e-6 && (values(2) - 1.0).abs() < 1e-6, "the normal turned");
        assert_eq!((values(1), values(3), values(4)), (7.0, 0.0, 1.0), "one of three is no vector");
    }

    #[test]
    fn points_that_come_to_lie_far_off_get_a_shift_and_lose_it_on_their_way_back() {
        let near = Coordinates::Single(vec![[1.0, 0.25, 0.0], [0.1, -2.0, 3.0]]);
        let mut recorded = Recorded::of(near, None);
        let ordinary = recorded.clone();
        let there = Pose::new(Vector3::new(7e5, 5e6, 400.0), Vector3::new(0.1, 0.2, 0.3));
        recorded.transform(&there);
        let exact = recorded.exact.as_ref().unwrap();
        assert_eq!(exact.written(), NumberType::F64);
        for (exact, point) in exact.at_m.iter().zip(&ordinary.cloud.points) {
            assert!((exact - there * point.cast::<f64>()).norm() < 1e-9);
        }
        let centre = there * ordinary.centre_m();
        assert!((recorded.centre_m() - centre).norm() < 1e-6);
        recorded.transform(&there.inverse());
        assert_eq!((recorded.shift_m, &recorded.exact), (Vector3::zeros(), &None));
        let pairs = recorded.cloud.points.iter().zip(&ordinary.cloud.points);
        assert!(pairs.into_iter().all(|(found, point)| (found - point).norm() < 1e-6));
    }

    #[test]
    fn coordinates_in_memory_make_the_cloud_that_their_file_makes() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.ply");
        let double = [[1.25, 2.0, 0.1], [400.0, 99.0, 3.0], [1.0, 2.0, 3.0]];
        let far = double.map(|[x, y, z]| [x + 5e5, y + 5e6, z]);
        let mixed = [double[0], [0.0; 3], [f64::NAN, 1.0, 1.0], [900.0, 600.0, 0.1]];
        for points in [&double[..], &far, &mixed] {
            for kind in ["float", "double"] {
                let axes: String = ["x", "y", "z"]
                    .iter()
                    .map(|axis| format!("property {kind} {axis}\n"))
                    .collect();
                let count = points.len();
                let head =
                    format!("ply\nformat binary_little_endian 1.0\nelement vertex {count}\n");
                let mut file = format!("{head}{axes}end_header\n").into_bytes();
                let single = points.iter().map(|point| point.map(|v| v as f32));
                let coordinates = match kind {
                    "float" => Coordinates::Single(single.clone().collect()),
                    _ => Coordinates::Double(points.to_vec()),
                };
                match kind {
                    "float" => file.extend(single.flatten().flat_map(f32::to_le_bytes)),
                    _ => file.extend(points.as_flattened().iter().flat_map(|v| v.to_le_bytes())),
                }
                std::fs::write(&path, file).unwrap();
                let read = crate::read_points(&path).unwrap();
                let made = Recorded::from_coordinates(coordinates, None).unwrap();
                assert_eq!(made, read, "{kind} {points:?}");
            }
        }
        let beyond = Coordinates::Double(vec![[1e8, 0.0, 0.0]]);
        let said = Recorded::from_coordinates(beyond, None).unwrap_err();
        assert!(said.contains("x = 1e8 m"), "{said}");
    }

    #[test]
    fn a_cloud_in_feet_becomes_one_in_metres_wherever_it_lies() {
        let foot = 0.3048;
        let near = Coordinates::Single(vec![[10.0, -20.0, 30.0]]);
        let mut recorded = Recorded::of(near, Some(vec![0.5]));
        recorded.scale(foot);
        let expected = Cloud {
            range_sd_m: Some(vec![0.1524]),
            ..Cloud::new(vec![[3.048, -6.096, 9.144].into()])
        };
        assert_eq!((recorded.cloud, recorded.exact), (expected, None));
        let far = [[2.1e6, 7e5, 40.5], [2.1e6, 7e5, 41.5]];
        let mut recorded = Recorded::of(Coordinates::Double(far.to_vec()), None);
        recorded.locate();
        recorded.scale(foot);
        assert_eq!(recorded.shift_m, Vector3::new(640_080.0, 213_360.0, 14.0));
        let found = recorded.exact.unwrap().at_m.into_iter().zip(far);
        found.for_each(|(p, far)| assert!((p - Point3::from(far) * foot).norm() < 1e-9));
    }

    #[test]
    fn removing_points_removes_their_exact_coordinates() {
        let far = vec![[f64::NAN; 3], [7e5, 5e6, 4.0], [0.0; 3], [7e5, 5e6, 5.5]];
        let mut recorded = Recorded::of(Coordinates::Double(far), None);
        assert_eq!(recorded.drop_invalid().total(), 2);
        recorded.locate();
        assert_eq!(recorded.exact.unwrap().at_m[1], Point3::new(7e5, 5e6, 5.5));
        assert_eq!(recorded.cloud.points, [[0.0, 0.0, -2.0].into(), [0.0, 0.0, -0.5].into()]);
    }
}
