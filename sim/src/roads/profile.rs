//! Heading, rise and lane drift of a road at a distance s along its reference line, from the
//! records of its file.
//!
//! Equations and names follow ASAM OpenDRIVE 1.8, chapters 9 (geometry), 10 (elevation) and 11
//! (lanes).

use std::collections::BTreeMap;

/// `a + b·x + c·x² + d·x³` from `s` on, x = distance from there.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Cubic {
    pub(super) s: f64,
    pub(super) a: f64,
    pub(super) b: f64,
    pub(super) c: f64,
    pub(super) d: f64,
}

impl Cubic {
    /// Smallest value from its start to `length` metres on.
    pub(super) fn least(&self, length: f64) -> f64 {
        let Self { a, b, c, d, .. } = *self;
        // Zeros of the slope b + 2 c x + 3 d x²; of a parabola x = -b / 2 c.
        let root = (c * c - 3.0 * b * d).sqrt();
        let level = [-0.5 * b / c, (-c - root) / (3.0 * d), (-c + root) / (3.0 * d)];
        let within = level.into_iter().filter(|x| (0.0..=length).contains(x));
        let values = within.chain([0.0, length]).map(|x| a + value_of([b, c, d], x));
        values.fold(f64::INFINITY, f64::min)
    }

    fn slope(&self, s: f64) -> f64 {
        slope_of([self.b, self.c, self.d], s - self.s)
    }
}

/// Index of the last record that starts at or before `s`, else of the first; records are sorted by
/// `start`.
fn last_at<T>(records: &[T], start: impl Fn(&T) -> f64, s: f64) -> usize {
    records.partition_point(|record| start(record) <= s + 1e-9).saturating_sub(1)
}

/// Slope at `s`, from the record that applies there.
fn slope_at(records: &[Cubic], s: f64) -> f64 {
    records.get(last_at(records, |record| record.s, s)).map_or(0.0, |record| record.slope(s))
}

/// Shape of a piece of the reference line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Curve {
    /// A straight line.
    Line,
    /// Curvature at both ends, 1/m: equal for an arc, linear in between for a spiral.
    Spiral([f64; 2]),
    /// v(u) = a + b·u + c·u² + d·u³; b, c, d.
    Poly3([f64; 3]),
    /// u(p) and v(p): b, c, d of each; p runs to `most`.
    ParamPoly3 { u: [f64; 3], v: [f64; 3], most: f64 },
}

/// A piece of the reference line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Geometry {
    pub(super) s: f64,
    /// Start, metres.
    pub(super) at: [f64; 2],
    pub(super) heading_rad: f64,
    pub(super) length_m: f64,
    pub(super) curve: Curve,
}

/// World coordinates of a point `[u, v]` in a frame at `[x, y]`.
pub(super) fn placed([x, y]: [f64; 2], heading_rad: f64, [u, v]: [f64; 2]) -> [f64; 2] {
    let (cos, sin) = (libm::cos(heading_rad), libm::sin(heading_rad));
    [x + cos * u - sin * v, y + sin * u + cos * v]
}

/// Slope of `b·x + c·x² + d·x³`.
pub(super) fn slope_of([b, c, d]: [f64; 3], x: f64) -> f64 {
    b + x * (2.0 * c + x * 3.0 * d)
}

impl Geometry {
    /// Upper bound on the total turn, radians.
    pub(super) fn turn_rad(&self) -> f64 {
        match self.curve {
            Curve::Line => 0.0,
            Curve::Spiral([from, to]) => from.abs().max(to.abs()) * self.length_m,
            // The tangent of a cubic makes one full turn at most.
            Curve::Poly3(_) | Curve::ParamPoly3 { .. } => std::f64::consts::TAU,
        }
    }

    /// End, metres.
    pub(super) fn end(&self) -> [f64; 2] {
        let (u, v) = match self.curve {
            Curve::Line => (self.length_m, 0.0),
            Curve::Spiral(bend) => spiral_end(bend, self.length_m),
            Curve::Poly3(v) => {
                let u = reach_of(v, self.length_m);
                (u, value_of(v, u))
            }
            Curve::ParamPoly3 { u, v, most } => (value_of(u, most), value_of(v, most)),
        };
        placed(self.at, self.heading_rad, [u, v])
    }

    /// Approximate length of a parametric curve, never too long, metres; other shapes have the
    /// length of their record.
    pub(super) fn drawn_m(&self) -> f64 {
        let Curve::ParamPoly3 { u, v, most } = self.curve else { return self.length_m };
        let at = |k: u32| [u, v].map(|of| value_of(of, most * f64::from(k) / 16.0));
        let chord = |[from, to]: [[f64; 2]; 2]| {
            [0, 1].map(|i| (to[i] - from[i]).powi(2)).iter().sum::<f64>().sqrt()
        };
        (0..16).map(|k| chord([at(k), at(k + 1)])).sum()
    }

    /// Heading at its start and at its end, radians.
    pub(super) fn ends_rad(&self) -> [f64; 2] {
        [self.s, self.s + self.length_m].map(|s| self.heading(s))
    }

    fn heading(&self, s: f64) -> f64 {
        let along = (s - self.s).clamp(0.0, self.length_m);
        self.heading_rad
            + match self.curve {
                Curve::Line => 0.0,
                Curve::Spiral([from, to]) => {
                    along * (from + 0.5 * (to - from) * along / self.length_m)
                }
                Curve::Poly3(v) => libm::atan(slope_of(v, reach_of(v, along))),
                Curve::ParamPoly3 { u, v, most } => {
                    let p = most * along / self.length_m;
                    libm::atan2(slope_of(v, p), slope_of(u, p))
                }
            }
    }
}

/// `b·x + c·x² + d·x³`.
fn value_of([b, c, d]: [f64; 3], x: f64) -> f64 {
    x * (b + x * (c + x * d))
}

/// End of a piece of linear curvature in the frame of its start: Simpson's rule with steps that
/// turn by at most a quarter radian.
fn spiral_end([from, to]: [f64; 2], length: f64) -> (f64, f64) {
    let turn = from.abs().max(to.abs()) * length;
    let steps = (4.0 * turn).ceil().clamp(2.0, 1e5) as u32;
    let step = length / f64::from(steps);
    let angle = |s: f64| s * (from + 0.5 * (to - from) * s / length);
    (0..steps).fold((0.0, 0.0), |(u, v), k| {
        let at = [0.0, 0.5, 1.0].map(|part| angle((f64::from(k) + part) * step));
        let mean = |[a, b, c]: [f64; 3]| step * (a + 4.0 * b + c) / 6.0;
        (u + mean(at.map(libm::cos)), v + mean(at.map(libm::sin)))
    })
}

/// u at which the curve v(u) is `along` metres long.
fn reach_of(v: [f64; 3], along: f64) -> f64 {
    const STEPS: usize = 64;
    let step = along / STEPS as f64;
    (0..STEPS).fold(0.0, |u, _| {
        // Midpoint rule: a step along the curve is shorter in u.
        let rate = |u: f64| 1.0 / (1.0 + slope_of(v, u) * slope_of(v, u)).sqrt();
        u + step * rate(u + 0.5 * step * rate(u))
    })
}

/// Widths of the lanes of a lane section that begins at `s`.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Section {
    pub(super) s: f64,
    /// Width records by the id of the lane.
    pub(super) widths: BTreeMap<i32, Vec<Cubic>>,
}

/// Records of one road.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Profile {
    pub(super) id: String,
    pub(super) length_m: f64,
    pub(super) in_junction: bool,
    /// This list and those below are sorted by s.
    pub(super) geometries: Vec<Geometry>,
    pub(super) elevations: Vec<Cubic>,
    pub(super) lane_offsets: Vec<Cubic>,
    pub(super) sections: Vec<Section>,
}

impl Profile {
    /// Heading of the reference line, radians counter-clockwise from x.
    pub(super) fn heading(&self, s: f64) -> f64 {
        let pieces = &self.geometries;
        pieces.get(last_at(pieces, |piece| piece.s, s)).map_or(0.0, |piece| piece.heading(s))
    }

    /// Rise of the reference line, metres a metre.
    pub(super) fn rise(&self, s: f64) -> f64 {
        slope_at(&self.elevations, s)
    }

    /// First and last s of a section.
    pub(super) fn span(&self, section: usize) -> [f64; 2] {
        let start = |k: usize| self.sections.get(k).map(|section| section.s);
        [start(section).unwrap_or(0.0), start(section + 1).unwrap_or(self.length_m)]
    }

    /// Index of the section at `s`.
    pub(super) fn section_at(&self, s: f64) -> usize {
        last_at(&self.sections, |section| section.s, s)
    }

    /// Heading of a lane relative to the reference line, radians: the slope of the offset of its
    /// middle, taken as the angle.
    ///
    /// ```text
    /// right lane   O′ − (w₋₁′ + … + ½ w′)        O: lane offset, w: widths from the middle out
    /// left lane    (w₁′ + … + ½ w′) − O′
    /// ```
    ///
    /// By geometry a left lane should have + O′. This is the convention of CARLA
    /// (`Map::ComputeTransform`), with whose waypoints these are compared.
    pub(super) fn drift(&self, section: usize, lane: i32, s: f64) -> f64 {
        let widths = |id: i32| {
            let section = self.sections.get(section)?;
            let begun = s - section.s;
            section.widths.get(&id).map(|records| slope_at(records, begun))
        };
        let side = lane.signum();
        let inner: f64 = (1..lane.abs()).filter_map(|k| widths(side * k)).sum();
        let across = inner + 0.5 * widths(lane).unwrap_or(0.0);
        let offset = slope_at(&self.lane_offsets, s);
        if side < 0 { offset - across } else { across - offset }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn piece(curve: Curve) -> Geometry {
        Geometry { s: 10.0, at: [0.0; 2], heading_rad: 0.5, length_m: 20.0, curve }
    }

    #[test]
    fn an_arc_turns_by_its_curvature_and_a_spiral_by_its_mean() {
        assert!((piece(Curve::Spiral([0.02; 2])).heading(25.0) - 0.8).abs() < 1e-12);
        assert!((piece(Curve::Spiral([0.0, 0.04])).heading(30.0) - 0.9).abs() < 1e-12);
        assert_eq!(piece(Curve::Line).heading(17.0), 0.5);
    }

    #[test]
    fn cubic_curves_head_along_their_tangent() {
        // v = u: everywhere 45 degrees, and 20 m along it u is 20 / √2.
        let diagonal = piece(Curve::Poly3([1.0, 0.0, 0.0]));
        let quarter = std::f64::consts::FRAC_PI_4;
        assert!((diagonal.heading(30.0) - 0.5 - quarter).abs() < 1e-12);
        // v = u² / 2: the slope is u, and 20 m of curve reach less than 20 m.
        let reach = reach_of([0.0, 0.5, 0.0], 20.0);
        let length = 0.5 * (reach * (1.0 + reach * reach).sqrt() + libm::asinh(reach));
        assert!((length - 20.0).abs() < 0.02, "{length}");
        let param = Curve::ParamPoly3 { u: [20.0, 0.0, 0.0], v: [0.0, 10.0, 0.0], most: 1.0 };
        assert!((piece(param).heading(30.0) - 0.5 - quarter).abs() < 1e-12);
    }

    #[test]
    fn a_piece_ends_where_its_curve_does() {
        let ends = |curve, [u, v]: [f64; 2]| {
            let [x, y] = Geometry { heading_rad: 0.0, ..piece(curve) }.end();
            assert!((x - u).abs() < 1e-3 && (y - v).abs() < 1e-3, "{curve:?}: {x} {y}");
            let (cos, sin) = (libm::cos(0.5), libm::sin(0.5));
            let [p, q] = Geometry { at: [3.0, 4.0], ..piece(curve) }.end();
            let turned = [3.0 + cos * x - sin * y, 4.0 + sin * x + cos * y];
            assert!((p - turned[0]).hypot(q - turned[1]) < 1e-9, "{curve:?}: {p} {q}");
        };
        ends(Curve::Line, [20.0, 0.0]);
        // A circle of 10 m about (0, 10), after two radians; and 20 m of Euler's spiral to 1/10 m,
        // whose C and S at √(2 / π) are 0.7217 and 0.2476 or so.
        ends(Curve::Spiral([0.1; 2]), [10.0 * libm::sin(2.0), 10.0 - 10.0 * libm::cos(2.0)]);
        let [c, s] = fresnel(1.0).map(|part| part * 20.0);
        ends(Curve::Spiral([0.0, 0.1]), [c, s]);
        ends(Curve::Poly3([1.0, 0.0, 0.0]), [20.0 / 2.0_f64.sqrt(); 2]);
        let cubic = Curve::ParamPoly3 { u: [9.0, 1.0, 0.0], v: [0.0, 4.0, 2.0], most: 1.0 };
        ends(cubic, [10.0, 6.0]);
    }

    /// ∫ cos, ∫ sin of a·t² over t from 0 to 1, by their series.
    fn fresnel(a: f64) -> [f64; 2] {
        let mut sums = [0.0; 2];
        let mut term = 1.0;
        for k in 0..30_u32 {
            let sign = if k % 4 < 2 { 1.0 } else { -1.0 };
            sums[(k % 2) as usize] += sign * term / f64::from(2 * k + 1);
            term *= a / f64::from(k + 1);
        }
        sums
    }

    #[test]
    fn the_least_of_a_cubic_is_at_an_end_or_where_it_is_level() {
        let least = |a, b, c, d, length| Cubic { s: 7.0, a, b, c, d }.least(length);
        assert_eq!(least(3.0, 0.0, 0.0, 0.0, 40.0), 3.0);
        assert_eq!(least(3.0, -0.5, 0.0, 0.0, 8.0), -1.0);
        assert_eq!(least(3.0, -4.0, 1.0, 0.0, 8.0), -1.0); // at 2
        assert_eq!(least(3.0, -4.0, 1.0, 0.0, 1.0), 0.0);
        // Up to 1, down to 3: x³ - 6 x² + 9 x.
        assert_eq!(least(1.0, 9.0, -6.0, 1.0, 9.0), 1.0);
        assert!((least(1.0, -9.0, 0.0, 3.0, 9.0) + 5.0).abs() < 1e-12); // at 1
    }

    #[test]
    fn a_lane_drifts_by_what_widens_inside_it() {
        let wide = |b: f64| vec![Cubic { b, ..Cubic::default() }];
        let widths = BTreeMap::from([(-1, wide(0.01)), (-2, wide(0.02)), (1, wide(0.03))]);
        let lane_offsets = wide(0.1);
        let sections = vec![Section { s: 0.0, widths }];
        let profile = Profile { lane_offsets, sections, ..Profile::default() };
        assert!((profile.drift(0, -2, 5.0) - (0.1 - 0.01 - 0.01)).abs() < 1e-12);
        assert!((profile.drift(0, 1, 5.0) - (0.015 - 0.1)).abs() < 1e-12);
    }
}
