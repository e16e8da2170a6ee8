//! Overlapping echoes and the echo finder of records: bit-exact against their models, and their
//! resolution.

use echoloop_dsp::SampleLoops;
use echoloop_dsp::filter::{self, PADDING};
use echoloop_dsp::loops::Portable;
use echoloop_dsp::peak::{self, Peaks};
use echoloop_dsp::split::{Overlapping, Sharpener, Splitter, prominent_peaks};
use echoloop_dsp::template::Template;
use echoloop_instruments::finder::colour::Colour;
use echoloop_instruments::finder::{EchoFinder, FinderConfig, Pulse, RINGS};
use echoloop_tests::bit_true::{self, Peak};
use echoloop_tests::vectors::{self, normal};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

fn reals(y: &[i16]) -> Vec<f64> {
    y.iter().map(|&v| f64::from(v)).collect()
}

fn models(peaks: &[peak::Peak]) -> Vec<Peak> {
    peaks.iter().map(|&p| p.into()).collect()
}

/// Waveform of sin² echoes (time, amplitude) of a width, samples, in noise of σ.
fn waveform(
    rng: &mut ChaCha8Rng,
    samples: usize,
    width: f64,
    echoes: &[(f64, f64)],
    sigma: f64,
) -> Vec<f64> {
    let pulse = |t: f64| {
        if t.abs() < width { (1.0 + (std::f64::consts::PI * t / width).cos()) / 2.0 } else { 0.0 }
    };
    let clean = |n: usize| echoes.iter().map(|&(time, a)| a * pulse(n as f64 - time)).sum::<f64>();
    (0..samples).map(|n| clean(n) + sigma * normal(rng)).collect()
}

#[test]
fn prominent_peaks_equal_their_model() {
    for seed in 0..10_000 {
        let mut rng = vectors::rng(seed);
        let values: Vec<i16> =
            (0..rng.random_range(0..200)).map(|_| rng.random_range(-20..60)).collect();
        let (level, share) = (rng.random_range(1..40), rng.random_range(1..9));
        let mut found = Peaks::new();
        prominent_peaks(values.iter().copied(), 7, level, |h| i32::from(h) / share + 3, &mut found);
        let rise = |h: f64| (h / f64::from(share)).trunc() + 3.0;
        assert_eq!(
            models(&found),
            bit_true::split::prominent_peaks(&reals(&values), 7, level.into(), rise),
            "seed {seed}"
        );
    }
}

#[test]
fn the_sharpener_and_the_overlapping_echoes_it_finds_equal_their_models() {
    for seed in 0..3_000 {
        let mut rng = vectors::rng(seed);
        let narrow = Template::sin_squared(rng.random_range(1_000..30_000), 1_000_000);
        let (lag, strength) = (rng.random_range(0..40), rng.random_range(0..=64));
        let sharpener = Sharpener::new(&narrow, lag, strength);
        let model = bit_true::split::Sharpener::new(&narrow, lag, strength.into());
        assert_eq!(reals(sharpener.taps()), model.taps, "seed {seed}");
        assert_eq!(
            (sharpener.lag, f64::from(sharpener.noise_gain)),
            (model.lag, model.noise_gain),
            "seed {seed}"
        );

        let echoes: Vec<_> = (0..4)
            .map(|_| (rng.random_range(0.0..300.0), rng.random_range(50.0..12_000.0)))
            .collect();
        let x: Vec<i16> =
            waveform(&mut rng, 300, 9.0, &echoes, 20.0).iter().map(|&v| v as i16).collect();
        let y: Vec<i16> = x.iter().map(|v| v / 2).collect();
        let mut coarse = Peaks::new();
        prominent_peaks(y.iter().copied(), 0, 40, |h| i32::from(h >> 2), &mut coarse);
        let mut hidden = Overlapping::new();
        let found = Splitter { sharpener: &sharpener, x: &x, y: &y, sigma: 300, level: 40 }.split(
            &coarse,
            |peak| peak.index % 3 > 0,
            &mut hidden,
        );
        let expected = bit_true::split::split(
            &model,
            &reals(&x),
            &reals(&y),
            300.0,
            40.0,
            &models(&coarse),
            |p| p.index % 3 > 0,
        );
        let hidden = hidden.iter().map(|&index| usize::from(index)).collect();
        assert_eq!((models(&found), hidden), expected, "seed {seed}");
    }
}

/// Draws a record of any kind, and a configuration of the finder.
fn record(seed: u64) -> (Vec<u16>, FinderConfig) {
    let mut rng = vectors::rng(seed);
    let shift = rng.random_range(1..=7);
    let top = f64::from(0x7fffu16 >> shift);
    let samples = rng.random_range(1..260);
    let width = rng.random_range(2.0..25.0);
    let echoes: Vec<_> = (0..rng.random_range(0..6))
        .map(|_| {
            (
                rng.random_range(-5.0..samples as f64 + 5.0),
                top * rng.random_range(0.02f64..1.2).powi(2),
            )
        })
        .collect();
    let sigma = [0.0, 0.3, top / 500.0, top / 40.0][rng.random_range(0..4)];
    let ambient = top * rng.random_range(0.0..0.2);
    let codes = waveform(&mut rng, samples, width, &echoes, sigma);
    // A converter's last steps waver in every fourth record.
    let waver = if seed % 4 == 1 { 5 } else { 1 };
    let code = |v: &f64| match (v + ambient).round().clamp(0.0, top) {
        clipped if clipped == top => clipped as u16 - rng.random_range(0..waver),
        code => code as u16,
    };
    let codes = codes.iter().map(code).collect();
    let mut ring = || (rng.random_range(0..40 << 16), rng.random_range(0..1 << 14));
    let mut ringing = [(0, 0); RINGS];
    ringing[..2].copy_from_slice(&[ring(), ring()]);
    let width = (width * 65_536.0) as i64;
    let skew = rng.random_range(-(4 << 16)..4 << 16);
    let pulse = seed.is_multiple_of(3).then_some(Pulse { time: 0, width, skew, ringing });
    let search = FinderConfig {
        code_shift: shift,
        snr_threshold: rng.random_range(256..2_000),
        floor: rng.random_range(0..4_000),
        min_separation: rng.random_range(0..9),
        echoes: if seed.is_multiple_of(5) { 2 } else { FinderConfig::DEFAULT.echoes },
        pulse,
        sigma: seed.is_multiple_of(11).then(|| rng.random_range(0..4_000)),
        best_fit: seed.is_multiple_of(7),
        colour: seed.is_multiple_of(4).then(|| colour(&mut rng)),
    };
    (codes, search)
}

/// Noise whose correlation falls with the distance, up or down.
fn colour(rng: &mut ChaCha8Rng) -> Colour {
    let neighbours: f64 = rng.random_range(-0.9..0.9);
    let correlation: Vec<f64> = (0..12).map(|lag| neighbours.powi(lag)).collect();
    Colour::new(rng.random_range(0.1..6.0), &correlation)
}

#[test]
fn the_echoes_of_a_record_equal_their_model() {
    let mut finder = Box::new(EchoFinder::new());
    let mut total = 0;
    for seed in 0..2_000 {
        let (codes, search) = record(seed);
        let found: Vec<bit_true::finder::Echo> =
            finder.echoes(&codes, &search).into_iter().map(Into::into).collect();
        assert_eq!(found, bit_true::finder::echoes(&codes, &search), "seed {seed}: {search:?}");
        total += found.len();
    }
    assert!(total > 2_500, "{total} echoes");
}

/// Times of the echoes found in a record of Gaussian pulses (time, amplitude), 6 samples wide, that
/// ring as a damped sine.
fn of_ringing(
    seed: u64,
    samples: u32,
    echoes: &[(f64, f64)],
    [share, period, decay]: [f64; 3],
) -> Vec<f64> {
    let rng = &mut vectors::rng(seed);
    let value = |t: f64| {
        let late = t - 6.0;
        let ring = if late < 0.0 {
            0.0
        } else {
            (-late / decay).exp() * (late / period * std::f64::consts::TAU).sin()
        };
        (-4.0 * 2f64.ln() * (t / 6.0).powi(2)).exp() - share * ring
    };
    let clean = |n: u32| echoes.iter().map(|&(at, a)| a * value(f64::from(n) - at)).sum::<f64>();
    let codes: Vec<u16> =
        (0..samples).map(|n| (600.0 + clean(n) + 2.0 * normal(rng)).round() as u16).collect();
    let search = FinderConfig { code_shift: 4, ..FinderConfig::DEFAULT };
    let found = EchoFinder::new().echoes(&codes, &search);
    found.iter().map(|echo| echo.time as f64 / 65_536.0).collect()
}

#[test]
fn ringing_of_a_short_record_is_no_echo() {
    for shape in [[0.15, 10.0, 30.0], [0.25, 18.0, 30.0], [0.4, 30.0, 30.0], [0.25, 18.0, 15.0]] {
        for seed in 0..40 {
            let at = 60.0 + 0.37 * seed as f64;
            let found = of_ringing(seed, 160, &[(at, 900.0)], shape);
            assert!(found.len() == 1 && (found[0] - at).abs() < 0.2, "{shape:?}, {at}: {found:?}");
        }
    }
}

#[test]
fn an_echo_after_ringing_is_found() {
    for (seed, later) in (0..40).flat_map(|seed| [40.0, 60.0, 100.0].map(|later| (seed, later))) {
        let at = 80.0 + 0.37 * seed as f64;
        let found = of_ringing(seed, 300, &[(at, 900.0), (at + later, 80.0)], [0.15, 18.0, 20.0]);
        assert!(
            found.iter().any(|time| (time - at - later).abs() < 2.0),
            "{at} + {later}: {found:?}"
        );
    }
}

#[test]
fn used_memory_changes_no_echo() {
    let mut used = Box::new(EchoFinder::new());
    for seed in 0..500 {
        let (codes, search) = record(seed);
        let mut fresh = Box::new(EchoFinder::new());
        assert_eq!(used.echoes(&codes, &search), fresh.echoes(&codes, &search), "seed {seed}");
    }
}

/// Number of the matched filter's peaks in a waveform of 5 ns pulses at 1 GS/s and σ = 100, and
/// their number after splitting.
fn sensor(rng: &mut ChaCha8Rng, clean: &[(f64, f64)]) -> (usize, usize) {
    const SIGMA: f64 = 100.0;
    let template = Template::sin_squared(5_000, 1_000_000);
    let sharpener = Sharpener::for_pulse(5_000, 1_000_000);
    let x: Vec<i16> =
        waveform(rng, 400, 5.0, clean, SIGMA).iter().map(|&v| v.clamp(-3e4, 3e4) as i16).collect();
    let mut padded = vec![0; template.half()];
    padded.extend(&x);
    padded.resize(padded.len() + template.half() + PADDING, 0);
    let mut y = vec![0; x.len()];
    filter::correlate(template.taps_in_pairs(), &padded, &mut y);
    let sigma = (SIGMA * 16.0) as u32;
    let level = (4.7 * SIGMA * f64::from(template.noise_gain) / 32_768.0) as i16;
    let mut coarse = Peaks::new();
    Portable.peaks(&y, level, &mut coarse);
    (
        coarse.len(),
        Splitter { sharpener: &sharpener, x: &x, y: &y, sigma, level }
            .split(&coarse, |_| true, &mut Overlapping::new())
            .len(),
    )
}

/// Samples per metre of range at 1 GS/s.
const SAMPLES_PER_M: f64 = 2.0 / 0.299_792_458;

#[test]
fn two_echoes_of_snr_50_split_at_the_matched_filter_s_limit_and_below() {
    let split = |metres: f64| -> usize {
        let rng = &mut vectors::rng(5);
        let at = |rng: &mut ChaCha8Rng| rng.random_range(200.0..201.0);
        (0..400)
            .filter(|_| {
                let start = at(rng);
                sensor(rng, &[(start, 5_000.0), (start + metres * SAMPLES_PER_M, 5_000.0)]).1 == 2
            })
            .count()
    };
    let limit = 1.14 * 0.299_792_458 * 5.0 / 2.0;
    assert!(split(1.05 * limit) >= 399, "{}", split(1.05 * limit));
    println!(
        "split of 400 at 1.14, 1.05, 1.0, 0.9 cτ/2: {:?}",
        [1.14, 1.05, 1.0, 0.9].map(|c| split(c * limit / 1.14))
    );
    assert!(split(limit) >= 390, "{}", split(limit));
}

#[test]
fn a_broad_echo_of_a_slanted_surface_is_not_split() {
    let rng = &mut vectors::rng(6);
    for broad in [5, 8, 12, 20] {
        let whole = (0..300).filter(|_| {
            let parts: Vec<_> = (0..broad).map(|i| (200.0 + f64::from(i), 2_000.0)).collect();
            sensor(rng, &parts).1 == 1
        });
        let whole = whole.count();
        assert!(whole >= 297, "{broad} samples broad: {whole} of 300 whole");
    }
}

#[test]
fn noise_and_single_echoes_are_not_split() {
    let rng = &mut vectors::rng(7);
    for amplitude in [600.0, 1_500.0, 5_000.0] {
        for _ in 0..300 {
            let start = rng.random_range(200.0..201.0);
            let (coarse, all) = sensor(rng, &[(start, amplitude)]);
            assert_eq!(coarse, all, "{amplitude}");
        }
    }
}
