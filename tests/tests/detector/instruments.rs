//! Recordings of random instruments: detection with the response estimated from the recording,
//! without it, and by local maxima.
//!
//! ```sh
//! ECHOLOOP_INSTRUMENTS=3000..3040 cargo test -p echoloop-tests --release --test detector \
//!     instruments:: -- --nocapture
//! ```
//!
//! prints the tables of benches/record/waveforms.md. Seeds below 100 were used to choose the
//! constants.

use std::ops::Range;
use std::path::Path;

use echoloop_instruments::response::LEAST_ECHOES;
use echoloop_instruments::{
    Echo, Finder, Noise, Options, POSSIBLE_REPEAT, Response, Selection, parse_waveforms,
};
use echoloop_random::Generator;
use echoloop_tests::instruments::{
    Instrument, KINDS, Kind, LocalMaxima, PROMINENT, Record, Score, VISIBLE,
};

/// Records per instrument, in the test and in the long version.
const RECORDS: [u64; 2] = [80, 200];

/// Seeds of the test's instruments.
const SEEDS: Range<u64> = 600..604;

fn options(max_echoes: usize) -> Options {
    Options { sample_ns: 1.0, snr: 5.0, floor: 0.05, max_echoes, min_separation_ns: 0.0 }
}

/// Settings with the best harmonic mean of recall and precision on the seeds below 12.
fn local_maxima(kind: Kind) -> LocalMaxima {
    match kind {
        Kind::Airborne => LocalMaxima { smoothing: 0.0, share: 0.15 },
        Kind::Slopes => LocalMaxima { smoothing: 1.0, share: 0.1 },
        Kind::Spaceborne => LocalMaxima { smoothing: 3.0, share: 0.05 },
    }
}

/// An instrument's records and their rows.
struct Recording {
    records: Vec<Record>,
    rows: Vec<Vec<f64>>,
}

impl Recording {
    fn of(kind: Kind, seed: u64, records: u64) -> Self {
        let instrument = Instrument::drawn(kind, seed);
        let records: Vec<Record> = (0..records).map(|n| instrument.record(n)).collect();
        let rows = records.iter().map(|record| record.samples.clone()).collect();
        Self { records, rows }
    }

    fn score(&self, found: impl Iterator<Item = Vec<f64>>) -> Score {
        let mut score = Score::default();
        for (record, times) in self.records.iter().zip(found) {
            score.add(&record.echoes, &times);
        }
        score
    }

    fn ours(&self, response: Option<Response>) -> Score {
        let found = Finder::new(options(32)).with_response(response).find(&self.rows, &[]);
        self.score(found.iter().map(|w| w.echoes.iter().map(|echo| echo.time_ns).collect()))
    }

    /// Scores with the estimated response, without it, and of local maxima.
    fn scores(&self, kind: Kind) -> [Score; 3] {
        let response = Response::of_waveforms(&self.rows, LEAST_ECHOES);
        let response = response.expect("strong echoes enough");
        let maxima = local_maxima(kind);
        let plain = self.rows.iter().map(|row| maxima.find(row));
        [self.ours(Some(response)), self.ours(None), self.score(plain)]
    }
}

/// Mean over instruments, and half of its 95 % interval.
fn mean(scores: &[Score], of: impl Fn(&Score) -> f64) -> (f64, f64) {
    let values: Vec<f64> = scores.iter().map(of).collect();
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (mean, 1.96 * (variance / n).sqrt())
}

fn row(name: &str, scores: &[Score]) {
    let percent = |(mean, off): (f64, f64)| format!("{:.1} ± {:.1} %", 100.0 * mean, 100.0 * off);
    let (extras, off) = mean(scores, Score::extras);
    println!(
        "| {name} | {} | {extras:.3} ± {off:.3} | {} |",
        percent(mean(scores, Score::recall)),
        percent(mean(scores, Score::single))
    );
}

/// Seeds of the instruments asked for, and records per instrument.
fn asked() -> (Range<u64>, u64) {
    let range = std::env::var("ECHOLOOP_INSTRUMENTS").ok().map(|text| {
        let (first, end) = text.split_once("..").expect("two seeds, as 1000..1040");
        first.parse().expect("a seed")..end.parse().expect("a seed")
    });
    range.map_or((SEEDS, RECORDS[0]), |seeds| (seeds, RECORDS[1]))
}

#[test]
fn the_response_halves_extra_echoes_keeps_single_ones_single_and_loses_none() {
    let (seeds, records) = asked();
    println!("| instruments | recall | extra a record | single ones kept |\n|---|---|---|---|");
    for (name, kind) in KINDS {
        let scores: Vec<[Score; 3]> =
            seeds.clone().map(|s| Recording::of(kind, s, records).scores(kind)).collect();
        let of = |i: usize| scores.iter().map(|s| s[i]).collect::<Vec<_>>();
        let (ours, before, plain) = (of(0), of(1), of(2));
        for (who, scores) in [("plain", &plain), ("without", &before), ("with", &ours)] {
            row(&format!("{name}: {who}"), scores);
        }
        let value = |scores: &[Score], of: fn(&Score) -> f64| mean(scores, of).0;
        let recall = |scores| value(scores, Score::recall);
        let extras = |scores| value(scores, Score::extras);
        let all = together(&ours);
        let Score { unseen, echoes, prominent, .. } = all;
        println!(
            "{name}: of {} echoes a matched filter sees {echoes} at {VISIBLE} σ; {prominent} have \
             a top of {PROMINENT} σ without noise: recall of these {:.1} %",
            unseen + echoes,
            100.0 * all.prominent_recall()
        );
        assert!(extras(&ours) < 0.5 * extras(&before), "{name}: extra echoes");
        assert!(recall(&ours) > recall(&before).max(recall(&plain)), "{name}: recall");
        assert!(recall(&ours) > 0.94, "{name}: recall");
        assert!(all.prominent_recall() > 0.97, "{name}: echoes with a top of their own");
        assert!(value(&ours, Score::single) > 0.92, "{name}: single echoes");
    }
}

#[test]
fn records_are_rows_of_rising_echoes_and_nothing_is_missing() {
    for (name, kind) in KINDS {
        for seed in SEEDS.start..SEEDS.start + 12 {
            let rows = Recording::of(kind, seed, 20).rows;
            let line = |row: &Vec<f64>| {
                row.iter().map(f64::to_string).collect::<Vec<_>>().join(",") + "\n"
            };
            let of_file = |turned: &dyn Fn(f64) -> f64| {
                let turned: Vec<Vec<f64>> =
                    rows.iter().map(|row| row.iter().map(|&v| turned(v)).collect()).collect();
                let text: String = turned.iter().map(line).collect();
                parse_waveforms(Path::new("waves.csv"), text.into(), &Selection::default())
                    .expect("rows")
            };
            let rising = of_file(&|value| value).with_polarity(None);
            assert_eq!((rising.len(), rising.remarks().len()), (20, 0), "{name} {seed}");
            // As of an instrument whose receiver inverts.
            let falling = of_file(&|value| 16_000.0 - value).with_polarity(None);
            assert_eq!(falling.remarks().len(), 1, "{name} {seed}: {:?}", falling.remarks());
        }
    }
}

/// Numbers of rows of short recordings.
const SHORT: [u64; 3] = [20, 28, 36];

/// Sum of several scores.
fn together(scores: &[Score]) -> Score {
    let mut sum = Score::default();
    for score in scores {
        sum.echoes += score.echoes;
        sum.unseen += score.unseen;
        sum.found += score.found;
        sum.prominent += score.prominent;
        sum.prominent_found += score.prominent_found;
        sum.extra += score.extra;
        sum.records += score.records;
        sum.singles += score.singles;
        sum.kept += score.kept;
    }
    sum
}

#[test]
fn a_response_of_sixteen_echoes_or_more_is_better_than_none() {
    let seeds = if std::env::var("ECHOLOOP_INSTRUMENTS").is_ok() { asked().0 } else { 600..616 };
    println!("| kind, rows | recall without, with | extra without, with | responses |");
    for (name, kind) in KINDS {
        for rows in SHORT {
            let (mut without, mut with, mut found) = (Vec::new(), Vec::new(), 0);
            for seed in seeds.clone() {
                let recording = Recording::of(kind, seed, rows);
                let response = Response::of_waveforms(&recording.rows, 16).ok();
                found += usize::from(response.is_some());
                with.push(recording.ours(response));
                without.push(recording.ours(None));
            }
            let (without, with) = (together(&without), together(&with));
            let percent = |score: &Score| 100.0 * score.recall();
            println!(
                "| {name}, {rows} | {:.1} %, {:.1} % | {:.3}, {:.3} | {found} |",
                percent(&without),
                percent(&with),
                without.extras(),
                with.extras()
            );
            assert!(with.extras() < 0.6 * without.extras(), "{name}, {rows}: extra echoes");
            assert!(with.recall() > without.recall() - 0.01, "{name}, {rows}: recall");
        }
    }
}

#[test]
fn the_estimated_response_has_the_width_and_bumps_of_the_instrument() {
    let mut bumps = 0;
    for seed in SEEDS.start..SEEDS.start + 12 {
        let instrument = Instrument::drawn(Kind::Airborne, seed);
        let recording = Recording::of(Kind::Airborne, seed, 150);
        let response = Response::of_waveforms(&recording.rows, LEAST_ECHOES);
        let response = response.expect("strong echoes enough");
        let width = instrument.response_width();
        assert!((response.width() / width - 1.0).abs() < 0.15, "{seed}: {width} samples");
        for &(delay, level) in instrument.after.iter().filter(|(_, level)| *level > 0.06) {
            let true_level = instrument.level(delay);
            let nearest = response
                .points()
                .min_by(|a, b| (a.0 - delay).abs().total_cmp(&(b.0 - delay).abs()));
            let found = nearest.expect("points").1;
            assert!((found - true_level).abs() < 0.03, "{seed}: {found} for {true_level}, {level}");
            bumps += 1;
        }
    }
    assert!(bumps >= 5, "{bumps} bumps");
}

/// Records at rest: noise through a Gaussian of σ `correlation` samples; 0 is white.
fn at_rest(seed: u64, records: u64, length: usize, correlation: f64) -> Vec<Vec<f64>> {
    let half = (4.0 * correlation).ceil() as i32;
    let tap = |k: i32| match half {
        0 => 1.0,
        _ => (-0.5 * (f64::from(k) / correlation).powi(2)).exp(),
    };
    let taps: Vec<f64> = (-half..=half).map(tap).collect();
    let energy = taps.iter().map(|tap| tap * tap).sum::<f64>().sqrt();
    let value = |piece: &[f64]| piece.iter().zip(&taps).map(|(x, tap)| x * tap).sum::<f64>();
    let record = |n| {
        let white = Generator::new(seed, n).normals(length + taps.len() - 1);
        white.windows(taps.len()).map(|w| (300.0 + 8.0 / energy * value(w)).round()).collect()
    };
    (0..records).map(record).collect()
}

#[test]
fn noise_of_any_colour_makes_as_many_echoes_as_is_said() {
    for (seed, correlation) in [(1, 0.0), (2, 0.6), (3, 1.0), (4, 2.5)] {
        let rows = at_rest(seed, 600, 800, correlation);
        let noise = Noise::of_waveforms(&rows).expect("rest");
        assert!((noise.sigma / 8.0 - 1.0).abs() < 0.03, "{correlation}: {}", noise.sigma);
        assert_eq!(noise.is_coloured(), correlation > 0.0);
        let search = Options { snr: 3.5, floor: 0.0, ..options(32) };
        let found = Finder::new(search).with_noise(Some(noise)).find(&rows, &[]);
        let echoes: f64 = found.iter().map(|w| w.echoes.len() as f64).sum();
        let said: f64 = found.iter().map(|w| w.false_alarms).sum();
        // Of some 80 echoes; three standard errors are a third.
        assert!((0.67..1.5).contains(&(echoes / said)), "{correlation}: {echoes} for {said}");
    }
}

#[test]
fn short_records_of_noise_alone_have_hardly_more_echoes_than_is_said() {
    let lengths = [30, 60, 120].into_iter();
    for (length, correlation) in lengths.flat_map(|n| [0.0, 1.0, 2.5].map(|c| (n, c))) {
        let rows = at_rest(5, 4_000, length, correlation);
        let noise = Noise::of_waveforms(&rows).expect("rest");
        let search = Options { snr: 4.0, floor: 0.0, ..options(32) };
        let found = Finder::new(search).with_noise(Some(noise)).find(&rows, &[]);
        let echoes: f64 = found.iter().map(|w| w.echoes.len() as f64).sum();
        let said: f64 = found.iter().map(|w| w.false_alarms).sum();
        println!("{length} samples, {correlation}: {echoes} for {said:.1}");
        // By each record's own noise alone 120, 9 and 3 times as many; of coloured noise 110, 23
        // and 3.
        let most = if correlation == 0.0 { 3.5 } else { 8.0 };
        assert!(echoes < most * said, "{length}, {correlation}: {echoes} for {said}");
    }
}

/// Echoes of rows, with the noise of all of them.
fn echoes_of(rows: &[Vec<f64>]) -> usize {
    let finder = Finder::new(options(32)).with_noise(Noise::of_waveforms(rows));
    finder.find(rows, &[]).iter().map(|waveform| waveform.echoes.len()).sum()
}

#[test]
fn channels_and_parts_of_a_record_with_more_noise_keep_their_own() {
    let louder = |value: f64| 300.0 + 4.0 * (value - 300.0);
    let mut channels = at_rest(6, 300, 800, 0.0);
    channels.iter_mut().step_by(2).flatten().for_each(|value| *value = louder(*value));
    let found = echoes_of(&channels);
    assert!(found <= 3, "{found} false echoes of two channels");
    let mut short = at_rest(8, 600, 120, 1.0);
    short.iter_mut().step_by(20).flatten().for_each(|value| *value = louder(*value));
    let found = echoes_of(&short);
    assert!(found <= 3, "{found} false echoes of a short channel");
    // Half of the short records, three times as loud: the echoes of the others are found.
    let mut mixed = at_rest(10, 2_000, 60, 2.0);
    for (k, row) in mixed.iter_mut().enumerate() {
        let louder = if k % 2 == 0 { 3.0 } else { 1.0 };
        for (n, value) in row.iter_mut().enumerate() {
            let pulse = 96.0 * (-(n as f64 - 30.0).powi(2) / 12.5).exp();
            *value = (300.0 + louder * (*value - 300.0) + pulse).round();
        }
    }
    let found = echoes_of(&mixed);
    assert!(found > 1_000, "{found} of 2,000 echoes");
    // Of less than a code, steps count.
    let mut coarse = at_rest(11, 1_000, 100, 1.5);
    coarse
        .iter_mut()
        .flatten()
        .for_each(|value| *value = (300.0 + (*value - 300.0) / 20.0).round());
    let found = echoes_of(&coarse);
    assert!(found <= 2, "{found} false echoes of coarse noise");
    let mut parts = at_rest(7, 60, 5_000, 0.0);
    parts.iter_mut().flat_map(|row| &mut row[2_400..]).for_each(|value| *value = louder(*value));
    let found = echoes_of(&parts);
    // The pieces that hold the change itself; by the first part's noise there are thousands.
    assert!(found <= 100, "{found} false echoes of long records");
}

#[test]
fn an_echo_on_a_background_of_many_more_codes_has_the_snr_of_one_on_none() {
    let mut rows = at_rest(9, 100, 500, 0.0);
    for (k, row) in rows.iter_mut().enumerate() {
        let slope = if k % 20 == 0 { 4.0 } else { 0.0 };
        for (n, value) in row.iter_mut().enumerate() {
            let pulse = 150.0 * (-(n as f64 - 250.0).powi(2) / 18.0).exp();
            *value = (*value + slope * n as f64 + pulse).round();
        }
    }
    let found = Finder::new(options(32)).with_noise(Noise::of_waveforms(&rows)).find(&rows, &[]);
    let mut snr: Vec<f64> = found
        .iter()
        .step_by(20)
        .map(|waveform| waveform.echoes.iter().map(|echo| echo.snr).fold(0.0, f64::max))
        .collect();
    snr.sort_by(f64::total_cmp);
    let usual = found[1].echoes[0].snr;
    assert!(snr[2] > 0.8 * usual, "{snr:?}, others {usual}");
}

#[test]
fn noise_is_measured_where_no_echo_is() {
    for (name, kind) in KINDS {
        for seed in SEEDS.start..SEEDS.start + 12 {
            let instrument = Instrument::drawn(kind, seed);
            let noise = Noise::of_waveforms(&Recording::of(kind, seed, 100).rows);
            // Rounding to codes is noise of 1/12.
            let sigma = (instrument.sigma.powi(2) + 1.0 / 12.0).sqrt();
            if let Some(noise) = noise {
                let ratio = noise.sigma / sigma;
                assert!((0.8..1.25).contains(&ratio), "{name} {seed}: {ratio}");
            } else {
                assert!(kind != Kind::Spaceborne, "{seed}: its records rest");
            }
        }
    }
}

/// Records of two walls, the second `level` times as bright: Gaussian pulses, `apart` widths from
/// each other.
fn two_walls(
    width: f64,
    snr: f64,
    (apart, level): (f64, f64),
    records: u64,
) -> Vec<(Vec<f64>, [f64; 2])> {
    let sigma = width / (8.0 * std::f64::consts::LN_2).sqrt();
    let record = |seed: u64| {
        let mut random = Generator::new(seed, 0);
        let noise = random.normals(300);
        let first = random.range(80.0, 140.0);
        let walls = [first, first + apart * width];
        let pulse = |n: f64, wall: f64| (-0.5 * ((n - wall) / sigma).powi(2)).exp();
        let sample = |(n, z): (i32, f64)| {
            let n = f64::from(n);
            let echoes = 2.0 * snr * (pulse(n, walls[0]) + level * pulse(n, walls[1]));
            (100.0 + echoes + 2.0 * z).round()
        };
        ((0..).zip(noise).map(sample).collect(), walls)
    };
    (0..records).map(record).collect()
}

#[test]
fn two_equal_walls_with_a_valley_between_them_are_two_echoes() {
    for (width, snr, apart) in [8.0, 14.0].into_iter().flat_map(|width| {
        [20.0, 26.0, 33.0, 60.0]
            .into_iter()
            .flat_map(move |snr| [1.5, 2.0, 2.5].map(|apart| (width, snr, apart)))
    }) {
        for records in [20, 60] {
            let (rows, truth): (Vec<Vec<f64>>, Vec<[f64; 2]>) =
                two_walls(width, snr, (apart, 1.0), records).into_iter().unzip();
            let response = Response::of_waveforms(&rows, LEAST_ECHOES).ok();
            let found = Finder::new(options(32)).with_response(response).find(&rows, &[]);
            let mut extra = 0;
            for (walls, waveform) in truth.iter().zip(&found) {
                let times: Vec<f64> = waveform.echoes.iter().map(|echo| echo.time_ns).collect();
                let is_found = |wall: &f64| times.iter().any(|t| (t - wall).abs() < 0.3 * width);
                let context = format!("{width}, {snr}, {apart}, {records}: {times:?}, {walls:?}");
                assert!(walls.iter().all(is_found), "{context}");
                extra += times.len() - walls.len();
            }
            assert!(extra <= 1, "{width}, {snr}, {apart}, {records}: {extra} extra echoes");
        }
    }
}

#[test]
fn a_dim_second_wall_on_the_flank_of_the_first_in_every_record_is_kept_and_flagged() {
    for level in [0.15, 0.2, 0.25, 0.4] {
        let (rows, truth): (Vec<Vec<f64>>, Vec<[f64; 2]>) =
            two_walls(8.0, 300.0, (1.5, level), 60).into_iter().unzip();
        let response = Response::of_waveforms(&rows, LEAST_ECHOES).ok();
        let found = Finder::new(options(32)).with_response(response).find(&rows, &[]);
        for (walls, waveform) in truth.iter().zip(&found) {
            let is_second = |echo: &&Echo| (echo.time_ns - walls[1]).abs() < 3.0;
            let second = waveform.echoes.iter().find(is_second);
            let flags = second.map(|echo| echo.flags.as_slice()).unwrap_or_default();
            assert!(flags.contains(&POSSIBLE_REPEAT), "{level}: {:?}, {walls:?}", waveform.echoes);
        }
    }
}
