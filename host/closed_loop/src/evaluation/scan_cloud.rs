//! Conversion of the echoes of a scan to a cloud.

use echoloop_clouds::attribute::{
    Attribute, COLUMN, ECHO, FLAGS, INTENSITY, PULSE_WIDTH, REFLECTIVITY, RING, SNR, TIME,
};
use echoloop_clouds::{Cloud, Recorded};
use echoloop_dsp::{Echo, Echoes};
use nalgebra::{Point3, Vector3};

use crate::beams::Beams;

/// Points of a scan, sensor frame, m, with their σ_R: one for each echo of each beam.
/// `directions` are the beams' unit vectors.
pub fn cloud_from_scan(scan: &[Echoes], directions: &[Vector3<f32>]) -> Cloud {
    let beams = || scan.iter().zip(directions);
    let points = beams().flat_map(|(echoes, d)| echoes.iter().map(move |echo| point_m(d, echo)));
    let range_sd_m = beams().flat_map(|(echoes, _)| echoes.iter().map(range_sd_m)).collect();
    Cloud { range_sd_m: Some(range_sd_m), ..Cloud::new(points.collect()) }
}

/// As [`cloud_from_scan`], with all that the sensor tells of each echo. Ring, column and time
/// follow from the pattern and the configured duration: the link carries no times.
pub fn recorded_from_scan(
    scan: &[Echoes],
    beams: &Beams,
    viewpoint: u32,
    duration_s: f64,
) -> Recorded {
    let directions = &beams.directions(viewpoint);
    let fired = (0..).zip(scan.iter().zip(directions.iter()));
    let told: Vec<Told<'_>> =
        fired.flat_map(|(beam, (echoes, _))| Told::of_beam(beam, echoes)).collect();
    let column = |attribute: &Attribute, value: fn(&Told<'_>) -> f64| {
        attribute.column(told.iter().map(value))
    };
    let of_beam = |attribute: &Attribute, value: &dyn Fn(u32) -> f64| {
        attribute.column(told.iter().map(|told| value(told.beam)))
    };
    let columns = vec![
        column(&INTENSITY, |told| told.echo.amplitude_fraction().to_num()),
        column(&REFLECTIVITY, |told| told.echo.reflectivity_ratio().to_num()),
        column(&SNR, |told| told.echo.snr_ratio().to_num()),
        column(&PULSE_WIDTH, |told| told.echo.width_ns().to_num()),
        column(&FLAGS, |told| told.echo.flags.0.into()),
        of_beam(&RING, &|beam| beams.ring(beam).into()),
        of_beam(&COLUMN, &|beam| beams.column(beam).into()),
        column(&ECHO, |told| told.number as f64),
        of_beam(&TIME, &|beam| beams.time_s(beam, duration_s)),
    ];
    Recorded { cloud: cloud_from_scan(scan, directions), columns, ..Recorded::default() }
}

/// An echo, its beam, and its index within the beam by range, from 0.
struct Told<'a> {
    beam: u32,
    echo: &'a Echo,
    number: usize,
}

impl<'a> Told<'a> {
    /// The echoes of a beam as they were reported, the strongest first as a rule, numbered by
    /// range.
    fn of_beam(beam: u32, echoes: &'a Echoes) -> impl Iterator<Item = Self> {
        let place = |i: usize, echo: &Echo| (echo.range, i);
        let all = move || echoes.iter().enumerate().map(move |(i, echo)| place(i, echo));
        let number = move |own: (u32, usize)| all().filter(|other| *other < own).count();
        let echo = move |(i, echo)| Self { beam, echo, number: number(place(i, echo)) };
        echoes.iter().enumerate().map(echo)
    }
}

/// σ_R of an echo as the sensor tells it, m.
fn range_sd_m(echo: &Echo) -> f32 {
    f32::from(echo.deviation) / 256e3
}

/// Point of an echo along the unit vector of its beam, m.
fn point_m(direction: &Vector3<f32>, echo: &Echo) -> Point3<f32> {
    Point3::from(direction * (echo.range as f32 / 256e3))
}

#[cfg(test)]
mod tests {
    use echoloop_clouds::attribute::ATTRIBUTES;
    use echoloop_dsp::{Flags, Grid, ScanPattern};

    use super::*;

    const PATTERN: ScanPattern = ScanPattern::Grid(Grid {
        columns: 4,
        rows: 2,
        azimuth_cdeg: 18_000,
        elevation_cdeg: 9_000,
    });

    fn beams() -> Beams {
        Beams::new(PATTERN)
    }

    #[test]
    fn beams_are_unit_vectors_and_symmetric_about_the_axis() {
        let beams = beams();
        let directions = beams.directions(1);
        assert!(directions.iter().all(|direction| (direction.norm() - 1.0).abs() < 1e-6));
        let sum: Vector3<f32> = directions.iter().sum();
        assert!(sum.y.abs() < 1e-5 && sum.z.abs() < 1e-5 && sum.x > 0.0);
    }

    #[test]
    fn a_cloud_has_the_deviation_of_each_echo_in_metres() {
        let mut beam = Echoes::new();
        for deviation in [256 * 20, 128] {
            let _ = beam.push(Echo { range: 256_000, deviation, ..Default::default() });
        }
        let scan = [Echoes::new(), beam];
        let cloud = cloud_from_scan(&scan, &beams().directions(1));
        assert_eq!(cloud.range_sd_m, Some(vec![0.02, 0.0005]));
        assert_eq!(cloud_from_scan(&scan, &[]).range_sd_m, Some(vec![]), "no beam, no echo");
    }

    #[test]
    fn every_attribute_is_what_the_sensor_told_in_the_table_s_units() {
        let echo = |range_m: u32| Echo {
            range: 256_000 * range_m,
            amplitude: 1 << 14,
            width: 5 * 16 + 8,
            snr: 40 * 256,
            deviation: 256 * 20,
            reflectivity: 512,
            flags: Flags::SATURATED | Flags::MERGED,
        };
        let mut beam = Echoes::new();
        let _ = [9, 4, 4].map(|range_m| beam.push(echo(range_m))); // the strongest first
        let scan: Vec<Echoes> =
            (0..8).map(|i| if i == 5 { beam.clone() } else { Echoes::new() }).collect();
        let told = recorded_from_scan(&scan, &beams(), 1, 0.16);
        let values = |attribute: &Attribute| -> Vec<f64> {
            let found = told.columns.iter().find(|column| column.name == attribute.name);
            let found = found.map(|column| (column.kind(), column.values().collect()));
            let (kind, values) = found.unwrap_or_else(|| panic!("no {}", attribute.name));
            assert_eq!(kind, attribute.kind, "{}", attribute.name);
            values
        };
        let expected = [
            (INTENSITY, [0.5; 3]),
            (REFLECTIVITY, [0.5; 3]),
            (SNR, [40.0; 3]),
            (PULSE_WIDTH, [5.5; 3]),
            (FLAGS, [3.0; 3]),
            (RING, [1.0; 3]),
            (COLUMN, [2.0; 3]),
            (ECHO, [2.0, 0.0, 1.0]),
            (TIME, [f64::from(0.11_f32); 3]),
        ];
        assert_eq!(told.columns.len() + 1, ATTRIBUTES.len(), "σ_R is the cloud's");
        for (attribute, expected) in expected {
            assert_eq!(values(&attribute), expected, "{}", attribute.name);
        }
        assert_eq!(told.cloud, cloud_from_scan(&scan, &beams().directions(1)));
    }

    #[test]
    fn a_point_lies_at_the_echo_s_range() {
        let echo = Echo { range: 256_000 * 7, ..Default::default() };
        assert!((point_m(&beams().directions(1)[3], &echo).coords.norm() - 7.0).abs() < 1e-5);
    }
}
