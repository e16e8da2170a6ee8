//! Checks for gaps in a road: reference-line pieces that do not meet, a reference line shorter than
//! the road, lanes that begin late or have a negative width.

use std::f64::consts::PI;

use super::fault::of_road;
use super::profile::{Cubic, Geometry, Profile};

/// Largest gap between two pieces, in place and along the road, and largest difference between the
/// road's length and its reference line's, metres. In CARLA's Town01, Town07 and Town10HD places
/// differ by at most 1.7 mm, lengths by 10⁻¹³ m.
const MAX_GAP_M: f64 = 0.5;
/// Largest change of heading between two pieces, radians: 5°. In those towns it is at most 0.018°.
const MAX_TURN_RAD: f64 = 5.0 * PI / 180.0;
/// Least length of a piece whose heading is checked, metres: editors leave shorter pieces, which
/// make no gap. Town07 has one of 10⁻⁷ m.
const MIN_PIECE_M: f64 = 0.1;
/// Most negative width that is accepted and taken as 0, metres. In those towns it is 10⁻¹⁴ m.
const MAX_NEGATIVE_WIDTH_M: f64 = 0.05;

/// Refuses a road with a gap.
pub(super) fn check(road: &Profile) -> Result<(), String> {
    let found = plan(road).or_else(|| sections(road)).or_else(|| widths(road));
    found.map_or(Ok(()), |what| Err(of_road(&road.id, what)))
}

fn plan(road: &Profile) -> Option<String> {
    let (first, last) = (road.geometries.first()?, road.geometries.last()?);
    if first.s.abs() > MAX_GAP_M {
        return Some(format!("its first <geometry> begins at s = {}, expected 0", first.s));
    }
    let pairs = road.geometries.iter().zip(road.geometries.iter().skip(1));
    if let Some(found) = pairs.into_iter().find_map(|(piece, next)| joint(piece, next)) {
        return Some(found);
    }
    let collapsed = |piece: &&Geometry| piece.drawn_m() < 0.5 * piece.length_m - MAX_GAP_M;
    if let Some(piece) = road.geometries.iter().find(collapsed) {
        let (s, length_m, drawn_m) = (piece.s, piece.length_m, piece.drawn_m());
        return Some(format!(
            "the <geometry> at s = {s} has a length of {length_m} m, but its curve of \
             {drawn_m:.2} m"
        ));
    }
    let end_m = last.s + last.length_m;
    ((end_m - road.length_m).abs() > MAX_GAP_M).then(|| {
        format!("its length is {} m, but its <planView> ends at s = {end_m:.3}", road.length_m)
    })
}

/// Fault at the joint of a piece and the next.
fn joint(piece: &Geometry, next: &Geometry) -> Option<String> {
    let end_m = piece.s + piece.length_m;
    if (end_m - next.s).abs() > MAX_GAP_M {
        return Some(format!(
            "the <geometry> at s = {} ends at s = {end_m:.3}, but the next begins at s = {}",
            piece.s, next.s
        ));
    }
    let (from, to) = (piece.end(), next.at);
    let apart_m = [0, 1].map(|i| (to[i] - from[i]).powi(2)).iter().sum::<f64>().sqrt();
    if apart_m > MAX_GAP_M {
        return Some(format!(
            "the <geometry> at s = {} begins at ({:.2}, {:.2}), {apart_m:.2} m from the end of the \
             one before, expected ({:.2}, {:.2})",
            next.s, to[0], to[1], from[0], from[1]
        ));
    }
    let turn_rad = next.ends_rad()[0] - piece.ends_rad()[1];
    let turn_rad = (turn_rad + PI).rem_euclid(2.0 * PI) - PI;
    let is_long = piece.length_m.min(next.length_m) >= MIN_PIECE_M;
    (is_long && turn_rad.abs() > MAX_TURN_RAD).then(|| {
        format!(
            "the <geometry> at s = {} heads {:.1}° away from the end of the one before",
            next.s,
            turn_rad.abs().to_degrees()
        )
    })
}

fn sections(road: &Profile) -> Option<String> {
    let first = road.sections.first()?;
    (first.s > MAX_GAP_M)
        .then(|| format!("its first <laneSection> begins at s = {}, expected 0", first.s))
}

fn widths(road: &Profile) -> Option<String> {
    road.sections.iter().enumerate().find_map(|(k, section)| {
        let [first, last] = road.span(k);
        let lanes = section.widths.iter().filter(|(lane, _)| **lane != 0);
        lanes.into_iter().find_map(|(lane, records)| {
            let ends = records.iter().skip(1).map(|next| next.s).chain([f64::INFINITY]);
            let of_record = |(record, end): (&Cubic, f64)| {
                let length_m = end.min(last - first) - record.s;
                (length_m > 0.0).then(|| record.least(length_m))
            };
            let least_m = records.iter().zip(ends).filter_map(of_record).fold(0.0, f64::min);
            (least_m < -MAX_NEGATIVE_WIDTH_M).then(|| {
                format!(
                    "lane {lane} of the section at s = {} has a width of {least_m:.2} m, expected \
                     0 or more",
                    section.s
                )
            })
        })
    })
}
