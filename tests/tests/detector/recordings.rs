//! Recordings as people's instruments make them: behind a mirror, with a long tail, in a changing
//! background. Drawn at random, with the truth known.

use echoloop_instruments::response::NoResponse;
use echoloop_instruments::{Echo, Finder, Noise, Options, Response};
use echoloop_random::Generator;

const OPTIONS: Options =
    Options { sample_ns: 1.0, snr: 5.0, floor: 0.05, max_echoes: 32, min_separation_ns: 0.0 };

/// Full width at half maximum over σ.
const WIDTH: f64 = 2.354_82;

/// A Gaussian echo of `width` around `time`.
fn pulse(n: usize, time: f64, width: f64) -> f64 {
    (-0.5 * ((n as f64 - time) * WIDTH / width).powi(2)).exp()
}

/// Echoes of records of `samples` codes around 200, with noise of σ 2.
fn found(
    options: Options,
    seed: u64,
    samples: usize,
    signals: &[&dyn Fn(usize) -> f64],
) -> Vec<Vec<Echo>> {
    let record = |(row, signal): (usize, &&dyn Fn(usize) -> f64)| {
        let noise = Generator::new(seed, row as u64).normals(samples);
        let value =
            |(n, noise): (usize, f64)| (200.0 + signal(n) + 2.0 * noise).round().clamp(0.0, 4095.0);
        noise.into_iter().enumerate().map(value).collect()
    };
    let rows: Vec<Vec<f64>> = signals.iter().enumerate().map(record).collect();
    let finder = Finder::new(options).with_noise(Noise::of_waveforms(&rows));
    finder.find(&rows, &[]).into_iter().map(|waveform| waveform.echoes).collect()
}

#[test]
fn a_weak_wall_behind_a_mirror_is_found() {
    for (seed, height) in [(1, 30.0), (2, 60.0), (3, 100.0), (4, 230.0)] {
        let draw = &mut Generator::new(seed, 77);
        for _ in 0..10 {
            let (long, apart) = (draw.range(20.0, 250.0), draw.range(25.0, 150.0));
            let at = 120.0 + long + apart;
            let signal = |n: usize| {
                let saturated = (120.0..120.0 + long).contains(&(n as f64));
                if saturated { 4000.0 } else { height * pulse(n, at, 7.0) }
            };
            let echoes =
                found(Options { floor: 0.005, ..OPTIONS }, seed, 600, &[&signal]).remove(0);
            assert_eq!(echoes.len(), 2, "{height} at {at} behind {long}: {echoes:?}");
            assert!((echoes[1].time_ns - at).abs() < 1.0, "{at}: {echoes:?}");
        }
    }
}

#[test]
fn the_time_of_an_echo_with_a_long_tail_is_that_of_its_peak() {
    for (seed, tail) in [(2, 40.0), (3, 80.0)] {
        let draw = &mut Generator::new(seed, 78);
        for _ in 0..10 {
            let (begin, rise) = (80.0 + draw.unit(), draw.range(2.0, 4.0));
            let signal = |n: usize| {
                let t = (n as f64 - begin).max(0.0);
                1500.0 * ((-t / tail).exp() - (-t / rise).exp())
            };
            let peak = begin + (tail / rise).ln() * rise * tail / (tail - rise);
            let echoes = found(OPTIONS, seed, 400, &[&signal]).remove(0);
            assert_eq!(echoes.len(), 1, "{tail}: {echoes:?}");
            assert!((echoes[0].time_ns - peak).abs() < 1.5, "{tail}: {peak}, {echoes:?}");
        }
    }
}

/// Times of one or two echoes of σ 2.6 samples, at least 60 apart, and their sum.
fn echoes_of(draw: &mut Generator, samples: usize) -> (Vec<f64>, impl Fn(usize) -> f64 + use<>) {
    let first = draw.range(70.0, 0.4 * samples as f64);
    let mut placed = vec![(first, draw.range(100.0, 1000.0))];
    if draw.chance(0.5) {
        placed.push((first + draw.range(60.0, 120.0), draw.range(100.0, 1000.0)));
    }
    let times = placed.iter().map(|echo| echo.0).collect();
    (times, move |n| placed.iter().map(|&(at, height)| height * pulse(n, at, 6.0)).sum())
}

/// 1 from a step on.
fn after(share: f64, step: f64) -> f64 {
    f64::from(u8::from(share > step))
}

#[test]
fn a_background_that_drifts_or_steps_makes_and_hides_no_echo() {
    type Change = fn(f64, f64) -> f64;
    let kinds: [(&str, Change); 6] = [
        ("ramp", |share, _| share),
        ("decay", |share, at| (-share / at).exp()),
        ("swing", |share, at| (7.0 * (share + at)).sin() / 2.0),
        ("step", |share, at| 1.0 / (1.0 + (-400.0 * (share - 0.6 - 0.3 * at)).exp())),
        ("two steps", |share, at| {
            (after(share, 0.1 + 0.3 * at) + after(share, 0.6 + 0.2 * at)) / 2.0
        }),
        ("there and back", |share, at| {
            after(share, 0.05 + 0.3 * at) - after(share, 0.6 + 0.2 * at)
        }),
    ];
    for (kind, (name, change)) in kinds.into_iter().enumerate() {
        let draw = &mut Generator::new(91, kind as u64);
        let (mut lost, mut extra, mut total) = (0, 0, 0);
        for seed in 0..40 {
            let samples = 300 + 100 * draw.index(6);
            let (times, echoes) = echoes_of(draw, samples);
            let (most, at) = (draw.range(50.0, 400.0), draw.range(0.3, 1.0));
            let signal =
                |n: usize| 300.0 + echoes(n) + most * change(n as f64 / samples as f64, at);
            let found = found(OPTIONS, seed, samples, &[&signal]).remove(0);
            let is_near = |time: &&f64| found.iter().any(|e| (e.time_ns - **time).abs() < 2.0);
            let hits = times.iter().filter(is_near).count();
            (lost, extra) = (lost + times.len() - hits, extra + found.len() - hits);
            total += times.len();
        }
        assert!(lost <= 1 && extra <= 6, "{name}: {lost} of {total} lost, {extra} extra");
    }
}

#[test]
fn a_level_background_changes_nothing() {
    let draw = &mut Generator::new(92, 0);
    for seed in 0..30 {
        let (times, echoes) = echoes_of(draw, 500);
        let rows: Vec<f64> = Generator::new(seed, 0)
            .normals(500)
            .into_iter()
            .enumerate()
            .map(|(n, noise)| (200.0 + echoes(n) + 2.0 * noise).round())
            .collect();
        let found = Finder::new(OPTIONS).find(&[rows], &[]).remove(0);
        assert_eq!((found.background, found.echoes.len()), (0.0, times.len()), "{seed}");
    }
}

/// Count of a Poisson process, by Knuth's product.
fn count(draw: &mut Generator, mean: f64) -> f64 {
    let (least, mut product, mut count) = ((-mean).exp(), draw.unit(), 0.0);
    while product > least {
        product *= draw.unit();
        count += 1.0;
    }
    count
}

#[test]
fn counts_of_photons_have_no_response() {
    let draw = &mut Generator::new(93, 0);
    for (ambient, most) in [(0.2, 12.0), (0.5, 18.0), (1.0, 25.0)] {
        let row = |_| {
            let (at, high) = (draw.range(60.0, 200.0), most * (-draw.unit()).exp());
            let mean = |n| ambient + high * pulse(n, at, 6.0);
            (0..300).map(|n| count(draw, mean(n))).collect()
        };
        let rows: Vec<Vec<f64>> = (0..120).map(row).collect();
        let response = Response::of_waveforms(&rows, 16);
        let refused = matches!(response, Err(NoResponse::Different { spread }) if spread > 0.1);
        assert!(refused, "{most} photons: {:?}", response.map(|response| response.width()));
    }
}

#[test]
fn two_walls_of_any_height_at_a_steady_distance_are_two_echoes() {
    let draw = &mut Generator::new(94, 0);
    for spacing in [1.35, 1.6, 2.0, 3.0, 6.0] {
        for wavers in [0.0, 0.15, 0.33] {
            for level in [0.5, 0.8, 1.0, 1.6] {
                let row = |k: usize| {
                    let first = 80.0 + k as f64 / 60.0;
                    let second = first + 6.0 * (spacing + wavers * (2.0 * draw.unit() - 1.0));
                    let noise = Generator::new(95, k as u64).normals(300);
                    let value = |(n, noise): (usize, f64)| {
                        let walls = pulse(n, first, 6.0) + level * pulse(n, second, 6.0);
                        (200.0 + 1000.0 * walls + 2.0 * noise).round()
                    };
                    noise.into_iter().enumerate().map(value).collect()
                };
                let rows: Vec<Vec<f64>> = (0..60).map(row).collect();
                let response = Response::of_waveforms(&rows, 40).ok();
                let found = Finder::new(OPTIONS).with_response(response).find(&rows, &[]);
                let echoes: usize = found.iter().map(|waveform| waveform.echoes.len()).sum();
                // A spacing that varies by a third of a width makes the lobes themselves differ.
                let range = if wavers < 0.2 { 118..=122 } else { 106..=128 };
                assert!(range.contains(&echoes), "{level} at {spacing} ± {wavers}: {echoes}");
            }
        }
    }
}

#[test]
fn a_shoulder_behind_an_echo_is_an_echo_flagged_and_a_single_one_stays_single() {
    for (seed, spacing) in [(1, 1.0), (2, 1.15), (3, 1.3)] {
        for level in [0.2, 0.5, 1.0] {
            let draw = &mut Generator::new(96, seed);
            let mut doubles = Vec::new();
            let row = |k: usize| {
                let (first, high) = (80.0 + draw.unit(), draw.range(200.0, 1500.0));
                let second = first + 6.0 * spacing + draw.spread(0.3);
                let is_double = draw.chance(0.25);
                doubles.push(is_double);
                let level = if is_double { level } else { 0.0 };
                let noise = Generator::new(97 + seed, k as u64).normals(300);
                let value = |(n, noise): (usize, f64)| {
                    let echoes = pulse(n, first, 6.0) + level * pulse(n, second, 6.0);
                    (200.0 + high * echoes + 2.0 * noise).round()
                };
                noise.into_iter().enumerate().map(value).collect()
            };
            let rows: Vec<Vec<f64>> = (0..150).map(row).collect();
            let response = Response::of_waveforms(&rows, 40).expect("strong echoes");
            let found = Finder::new(OPTIONS).with_response(Some(response)).find(&rows, &[]);
            let (mut wrong, mut unflagged) = (0, 0);
            for (waveform, is_double) in found.iter().zip(&doubles) {
                wrong += usize::from(waveform.echoes.len() != 1 + usize::from(*is_double));
                let flagged = waveform.echoes.iter().filter(|e| e.flags.contains(&"merged"));
                unflagged += usize::from(*is_double && flagged.count() == 0 && spacing < 1.2);
            }
            assert!(wrong <= 3, "{level} at {spacing} widths: {wrong} of 150 records wrong");
            assert!(unflagged <= 2, "{level} at {spacing} widths: {unflagged} not flagged");
        }
    }
}

/// A fast rise and a slower fall, 8 samples wide: of the height of an echo around `time`.
fn skewed(n: usize, time: f64) -> f64 {
    let t = n as f64 - time;
    if t < 0.0 { (-0.5 * (t / 2.5).powi(2)).exp() } else { 1.0 / (t / 4.0).cosh() }
}

/// Numbers of echoes in records of some echoes, by the response estimated from them.
fn counted(records: &[Vec<(f64, f64)>], shape: impl Fn(usize, f64) -> f64) -> Vec<usize> {
    counted_with(OPTIONS, records, shape)
}

fn counted_with(
    options: Options,
    records: &[Vec<(f64, f64)>],
    shape: impl Fn(usize, f64) -> f64,
) -> Vec<usize> {
    let row = |(k, echoes): (usize, &Vec<(f64, f64)>)| {
        let noise = Generator::new(98, k as u64).normals(300);
        let value = |(n, noise): (usize, f64)| {
            let sum: f64 = echoes.iter().map(|(time, height)| height * shape(n, *time)).sum();
            (200.0 + sum + 2.0 * noise).round()
        };
        noise.into_iter().enumerate().map(value).collect()
    };
    let rows: Vec<Vec<f64>> = records.iter().enumerate().map(row).collect();
    let response = Response::of_waveforms(&rows, 40).expect("strong echoes");
    let found = Finder::new(options).with_response(Some(response)).find(&rows, &[]);
    found.iter().map(|waveform| waveform.echoes.len()).collect()
}

#[test]
fn a_weak_wall_on_the_falling_flank_of_a_strong_one_is_found_without_a_top() {
    for level in [0.08, 0.12] {
        let draw = &mut Generator::new(99, 0);
        let record = |_| {
            let (first, high) = (80.0 + draw.unit(), draw.range(500.0, 1500.0));
            let second = (first + draw.range(10.5, 12.0), level * high);
            let is_double = draw.chance(0.25);
            [(first, high)].into_iter().chain(is_double.then_some(second)).collect()
        };
        let records: Vec<Vec<(f64, f64)>> = (0..150).map(record).collect();
        let found = counted(&records, skewed);
        let wrong = found.iter().zip(&records).filter(|(n, echoes)| **n != echoes.len()).count();
        assert!(wrong <= 3, "{level}: {wrong} of 150 records wrong");
        // It passes what tops have to pass.
        let strict = [
            Options { min_separation_ns: 20.0, ..OPTIONS },
            Options { snr: 250.0, ..OPTIONS },
            Options { floor: 0.2, ..OPTIONS },
        ];
        for options in strict {
            let most = counted_with(options, &records, skewed).into_iter().max();
            assert_eq!(most, Some(1), "{options:?}");
        }
    }
}

#[test]
fn a_slope_on_the_falling_flank_of_a_strong_wall_is_found_without_a_top() {
    let draw = &mut Generator::new(100, 0);
    let record = |_| {
        let (first, high) = (80.0 + draw.unit(), draw.range(500.0, 1500.0));
        // A slope ten samples deep: as many weak walls, an echo half as wide again as one of them.
        let depths = if draw.chance(0.25) { 10 } else { 0 };
        let slope = |k: i32| (first + 8.0 + f64::from(k), 0.014 * high);
        [(first, high)].into_iter().chain((0..depths).map(slope)).collect()
    };
    let records: Vec<Vec<(f64, f64)>> = (0..150).map(record).collect();
    let falls = |n| {
        records.iter().all(|echoes| {
            let at = |n| echoes.iter().map(|(time, high)| high * skewed(n, *time)).sum::<f64>();
            at(n + 1) < at(n)
        })
    };
    assert!((82..120).all(falls), "a top: this tests nothing");
    let found = counted(&records, skewed);
    let is_wrong = |(n, echoes): &(&usize, &Vec<_>)| **n != 1 + usize::from(echoes.len() > 1);
    let wrong = found.iter().zip(&records).filter(is_wrong).count();
    assert!(wrong <= 3, "{wrong} of 150 records wrong");
}

#[test]
fn a_deep_target_among_flat_ones_is_one_echo() {
    let draw = &mut Generator::new(101, 0);
    // A box of depth: as many walls, a sample apart.
    let record = |_| {
        let (first, high) = (80.0 + draw.unit(), draw.range(500.0, 1500.0));
        let walls = if draw.chance(0.25) { 4 + draw.index(12) } else { 1 };
        (0..walls).map(|k| (first + k as f64, high / walls as f64)).collect()
    };
    let records: Vec<Vec<(f64, f64)>> = (0..150).map(record).collect();
    let found = counted(&records, |n, time| pulse(n, time, 6.0));
    let several: Vec<_> = found.iter().zip(&records).filter(|(n, _)| **n != 1).collect();
    let depths: Vec<usize> = several.iter().map(|(_, walls)| walls.len()).collect();
    // A box of 1.8 widths is as two walls 1.1 apart.
    assert!(several.len() <= 6, "{} of 150, {depths:?} samples deep", several.len());
}

#[test]
fn walls_that_may_be_one_scene_under_changing_light_are_kept() {
    let draw = &mut Generator::new(102, 0);
    type Walls = fn(&mut Generator) -> Vec<(f64, f64)>;
    let kinds: [(&str, Walls); 4] = [
        ("20 % of a changing height", |draw| {
            let high = draw.range(300.0, 1000.0);
            vec![(80.0, high), (110.0, 0.2 * high)]
        }),
        ("any level", |draw| {
            let high = draw.range(300.0, 1000.0);
            vec![(80.0, high), (110.0, high * draw.range(0.1, 0.3))]
        }),
        ("any distance", |draw| {
            let high = draw.range(300.0, 1000.0);
            vec![(80.0, high), (draw.range(108.0, 112.0), 0.2 * high)]
        }),
        ("three", |_| vec![(80.0, 1000.0), (98.0, 400.0), (116.0, 150.0)]),
    ];
    for (name, walls) in kinds {
        let record = |_| {
            let off = draw.unit();
            walls(draw).into_iter().map(|(time, height)| (time + off, height)).collect()
        };
        let records: Vec<Vec<(f64, f64)>> = (0..60).map(record).collect();
        let found = counted(&records, |n, time| pulse(n, time, 6.0));
        let lost = found.iter().zip(&records).filter(|(n, walls)| **n != walls.len()).count();
        assert!(lost <= 1, "{name}: {lost} of 60 records wrong");
    }
}

#[test]
fn a_weak_wall_behind_a_mirror_is_found_in_many_rows_too() {
    let draw = &mut Generator::new(103, 0);
    let mirror = |n: usize, time: f64| pulse(n, time, 6.0);
    let row = |k: usize| {
        let (first, second) = (60.0 + draw.unit(), draw.range(85.0, 180.0));
        let noise = Generator::new(104, k as u64).normals(300);
        let value = |(n, noise): (usize, f64)| {
            let signal = 3000.0 * mirror(n, first) + 60.0 * mirror(n, second);
            (200.0 + signal + 2.0 * noise).round()
        };
        noise.into_iter().enumerate().map(value).collect()
    };
    let rows: Vec<Vec<f64>> = (0..60).map(row).collect();
    let response = Response::of_waveforms(&rows, 40).expect("strong echoes");
    let options = Options { floor: 0.005, ..OPTIONS };
    let found = Finder::new(options).with_response(Some(response)).find(&rows, &[]);
    let both = found.iter().filter(|waveform| waveform.echoes.len() == 2).count();
    assert!(both >= 59, "{both} of 60");
}

#[test]
fn noise_that_forgets_slowly_makes_hardly_an_echo() {
    // Of the first order: each sample has nine tenths of the one before.
    let row = |k: u64| {
        let mut level = 0.0;
        let step = |noise: f64| {
            level = 0.9 * level + noise;
            (200.0 + 4.0 * level).round()
        };
        Generator::new(105, k).normals(500).into_iter().map(step).collect()
    };
    let rows: Vec<Vec<f64>> = (0..300).map(row).collect();
    let noise = Noise::of_waveforms(&rows).expect("rest");
    assert!(noise.is_coloured());
    let found = Finder::new(OPTIONS).with_noise(Some(noise)).find(&rows, &[]);
    let echoes: usize = found.iter().map(|waveform| waveform.echoes.len()).sum();
    assert!(echoes <= 6, "{echoes} echoes of noise");
}
