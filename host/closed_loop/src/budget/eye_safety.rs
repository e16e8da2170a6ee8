//! Class 1 of IEC 60825-1:2014 (edition 3) for a scanned beam of 700 to 1050 nm.
//!
//! Assumptions, each the worst case:
//!
//! - The source is small (α ≤ 1.5 mrad), so C₆ = C₇ = 1 and T₂ = 10 s.
//! - A pupil of 7 mm stands 100 mm before the sensor (condition 3) and takes every pulse whole that
//!   is aimed into it: the beam is narrower than 7 mm there, and all beams leave from one point.
//! - Shots are even in time, more than 5 µs apart. A beam that stands still is a fault that the
//!   sensor must end by itself.
//!
//! The pupil takes k pulses of a scan. With `AEL(t) = 7·10⁻⁴ · C₄ · t^0.75` J for 5 µs to 10 s, and
//! limits as the public calculators have them (benches/record/aim.md), a pulse has at most
//!
//! - `7.7·10⁻⁸ · C₄ · C₅` J, where `C₅ = 5 N^(−¼)`, 0.4 to 1, for N > 600 pulses in T₂, else 1;
//! - `AEL(t)/n` J for the n pulses of any dwell t: the pupil's beams of a column, of several
//!   columns, of several scans;
//! - `3.9·10⁻⁴ · C₄` W of mean power over the pulses a second.

use std::f64::consts::PI;

use echoloop_dsp::{ScanPattern, Settings};

/// Energy of one pulse without C₄, J.
const PULSE_J: f64 = 7.7e-8;
/// Pulses within it count as one, s.
const ONE_PULSE_S: f64 = 5e-6;
/// Energy of a dwell of 1 s without C₄, J.
const DWELL_J: f64 = 7e-4;
/// Mean power without C₄, W.
const MEAN_W: f64 = 3.9e-4;
/// Pulses are counted for as long, s.
const T2_S: f64 = 10.0;
/// Half the angle across which the pupil takes beams, radians: 3.5 mm in 100 mm.
const PUPIL_RAD: f64 = 0.035;

/// C₄ at a wavelength of 700 to 1050 nm.
fn c4(wavelength_nm: f64) -> f64 {
    libm::pow(10.0, 0.002 * (wavelength_nm - 700.0))
}

/// C₅ of short pulses, of which a pupil takes `count` in T₂.
fn c5(count: f64) -> f64 {
    if count > 600.0 { (5.0 * libm::pow(count, -0.25)).clamp(0.4, 1.0) } else { 1.0 }
}

/// Largest energy of a pulse that leaves a scan in class 1, J. `pattern` has the aim of the
/// settings, and a scan takes `frame_s`.
pub fn class_1_pulse_j(
    wavelength_nm: f64,
    pattern: &ScanPattern,
    settings: &Settings,
    frame_s: f64,
) -> f64 {
    let shots = settings.shots.unsigned_abs().max(1);
    let [columns, rows] = beams_in_pupil(pattern);
    let of_column = rows * shots;
    let of_scan = columns.saturating_mul(of_column);
    let shot_s = frame_s / (f64::from(pattern.beams().max(1)) * f64::from(shots));
    let column_s = match pattern.columns_and_rows() {
        Some([_, rows]) => f64::from(rows) * f64::from(shots) * shot_s,
        None => shot_s,
    };
    // The shortest time from the first to the last of `pulses`: those of a column follow one
    // another.
    let span_s = |pulses: u32| {
        let (columns, more) = ((pulses - 1) / of_column, (pulses - 1) % of_column);
        f64::from(columns) * column_s + f64::from(more) * shot_s
    };
    let of_dwell = |pulses: f64, seconds: f64| DWELL_J * libm::pow(seconds, 0.75) / pulses;
    let of_group = |pulses: u32| match span_s(pulses) {
        seconds if seconds < ONE_PULSE_S => PULSE_J / f64::from(pulses),
        seconds => of_dwell(f64::from(pulses), seconds),
    };
    let as_one = (1..=of_scan).take_while(|&pulses| span_s(pulses) < ONE_PULSE_S).count() as f64;
    let of_t2 = f64::from(of_scan) * T2_S / frame_s;
    let limits = [
        PULSE_J * c5(of_t2 / as_one) / as_one,
        (1..=of_scan).map(of_group).fold(f64::INFINITY, f64::min),
        // The more scans, the less of each: the longest dwell decides.
        of_dwell(of_t2, T2_S),
        MEAN_W * frame_s / f64::from(of_scan),
    ];
    c4(wavelength_nm) * limits.into_iter().fold(f64::INFINITY, f64::min)
}

/// Columns and rows of a scan that one pupil takes, wherever it is, each bounded from above: as
/// many of its beams at one elevation, the steepest, and as many in one column. Patterns without
/// columns and rows are bounded by all their beams.
fn beams_in_pupil(pattern: &ScanPattern) -> [u32; 2] {
    let Some([columns, rows]) = pattern.columns_and_rows() else { return [pattern.beams(), 1] };
    let rows = u32::from(rows);
    let unit = |beam| pattern.exact_unit(0, beam);
    // The beams of the first column, and the first of each.
    let elevations: Vec<f64> =
        (0..rows).filter_map(unit).map(|[_, _, z]| libm::asin(z.clamp(-1.0, 1.0))).collect();
    let firsts = (0..u32::from(columns)).map(|column| column * rows);
    let azimuths: Vec<f64> = firsts.filter_map(unit).map(|[x, y, _]| libm::atan2(y, x)).collect();
    let steepest = elevations.iter().fold(0.0_f64, |most, angle| most.max(angle.abs()));
    // Two beams at elevation φ are within the pupil where sin(Δ/2) · cos φ ≤ sin of its half.
    let half = libm::sin(PUPIL_RAD) / libm::cos(steepest);
    let window = if half < 1.0 { 2.0 * libm::asin(half) } else { 2.0 * PI };
    // Once more around: the pupil may be where the azimuth goes from 180° to −180°.
    let around = azimuths.iter().map(|azimuth| azimuth + 2.0 * PI).collect::<Vec<_>>();
    let most = most_within([azimuths, around].concat(), window).min(u32::from(columns));
    [most, most_within(elevations, 2.0 * PUPIL_RAD)]
}

/// Most of these angles within a window, 1 at least.
fn most_within(mut angles: Vec<f64>, window: f64) -> u32 {
    angles.sort_by(f64::total_cmp);
    let within = |(i, first): (usize, &f64)| {
        angles[i..].iter().take_while(|angle| **angle - first <= window).count()
    };
    angles.iter().enumerate().map(within).max().unwrap_or(1) as u32
}

#[cfg(test)]
mod tests {
    use echoloop_dsp::{Aim, Grid, Steered};

    use super::*;

    const WIDE: Aim = Aim {
        columns: 192,
        rows: 64,
        elevation_cdeg: 6_000,
        tilt_cdeg: 0,
        ..Steered::REFERENCE.aim
    };

    fn steered(aim: Aim) -> ScanPattern {
        ScanPattern::Steered(Steered { aim, ..Steered::REFERENCE })
    }

    fn limit_nj(aim: Aim, shots: i32, frame_s: f64) -> f64 {
        let settings = Settings { shots, ..Settings::default() };
        1e9 * class_1_pulse_j(905.0, &steered(aim), &settings, frame_s)
    }

    /// Figures worked by hand from the standard's formulas, with C₄ = 10^0.41 = 2.5704.
    #[test]
    fn a_pulse_has_198_nj_alone_and_less_in_a_train() {
        let one = Aim { columns: 1, rows: 1, ..Steered::REFERENCE.aim };
        let close = |found: f64, expected: f64| (found / expected - 1.0).abs() < 1e-3;
        // 10 and 1000 pulses in 10 s: 197.9 nJ, and 5 · 1000^(−¼) = 0.8891 of it.
        assert!(close(limit_nj(one, 1, 1.0), 197.9), "{}", limit_nj(one, 1, 1.0));
        assert!(close(limit_nj(one, 1, 0.01), 176.0), "{}", limit_nj(one, 1, 0.01));
        // 10⁵ pulses in 10 s: 0.4 of it is 79.2 nJ; 1.002 mW of mean power allow 100.2 nJ.
        assert!(close(limit_nj(one, 1, 1e-4), 79.17), "{}", limit_nj(one, 1, 1e-4));
        // 2 · 10⁵: the mean power decides, 50.1 nJ.
        assert!(close(limit_nj(one, 1, 5e-5), 50.12), "{}", limit_nj(one, 1, 5e-5));
    }

    #[test]
    fn pulses_of_neighbouring_beams_share_what_a_dwell_may_have() {
        let aim = WIDE;
        assert_eq!(beams_in_pupil(&steered(aim)), [3, 5]);
        // Two beams of a column, 8.14 µs apart: 7·10⁻⁴ · 2.5704 · (8.14 µs)^0.75 / 2.
        let found = limit_nj(aim, 1, 0.1);
        assert!((found - 137.1).abs() < 0.1, "{found}");
        // Five times slower there are 300 pulses in 10 s, and C₅ is 1.
        let found = limit_nj(aim, 1, 0.5);
        assert!((found - 197.9).abs() < 0.1, "{found}");
        // 4.07 µs apart two count as one, of which there are 1500 in 10 s: C₅ = 0.8034.
        let found = limit_nj(aim, 2, 0.1);
        assert!((found - 79.5).abs() < 0.1, "{found}");
    }

    #[test]
    fn the_pupil_may_be_behind_the_sensor_where_both_ends_of_a_turn_meet() {
        let ends = Aim { columns: 312, azimuth_fovea_milli: -400, ..WIDE };
        // Beams are 0.64° apart there, 1.15° in the mean: 4.01°/cos 30° have eight on either side
        // of it, where the middle of a window within the turn has 14 in all.
        assert_eq!(beams_in_pupil(&steered(ends))[0], 16);
    }

    #[test]
    fn the_pupil_takes_more_beams_of_a_denser_scan() {
        let count = |aim| beams_in_pupil(&steered(aim)).into_iter().product::<u32>();
        let wide = WIDE;
        let dense = Aim { azimuth_cdeg: 6_000, elevation_cdeg: 2_000, ..wide };
        assert!((13 * 12..=14 * 14).contains(&count(dense)), "{}", count(dense));
        let fovea = Aim { elevation_fovea_milli: 700, ..wide };
        assert!(count(fovea) > 2 * count(wide), "{}", count(fovea));
        assert!(limit_nj(dense, 1, 0.1) < 0.7 * limit_nj(wide, 1, 0.1));
        // At the zenith of the paper's grid all columns meet.
        assert_eq!(beams_in_pupil(&ScanPattern::Grid(Grid::default()))[0], 192);
    }
}
