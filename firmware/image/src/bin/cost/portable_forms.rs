//! Comparison of the fastest kernel with its portable form, on allowed and on extreme inputs.

use echoloop_dsp::loops::{Portable, Scalar};
use echoloop_dsp::peak::Peaks;
use echoloop_dsp::statistics::Statistics;
use echoloop_dsp::{Hardware, MAX_TAPS, Pipeline, SampleLoops, Scratch, Settings};
use echoloop_kernels::FASTEST;

use crate::waveforms::{CASES, Case, Random};

const LOOPS: u32 = 4_000;
const PIPELINES: u32 = 60;

/// Number of comparisons when all were equal, else the loop that differed.
pub(crate) fn agree() -> Result<u32, &'static str> {
    for seed in 0..LOOPS {
        let mut random = Random::new(seed);
        baselines_agree(&mut random).then_some(()).ok_or("remove_baseline differs")?;
        filters_agree(&mut random).then_some(()).ok_or("correlate differs")?;
        thresholds_agree(&mut random).then_some(()).ok_or("reaches differs")?;
        peaks_agree(&mut random).then_some(()).ok_or("peaks differ")?;
        counts_agree(&mut random).then_some(()).ok_or("count differs")?;
        order_statistics_agree(&mut random).then_some(()).ok_or("order statistics differ")?;
    }
    let mut waveforms = 0;
    for seed in 0..PIPELINES {
        waveforms += pipelines_agree(&mut Random::new(seed))?;
    }
    for case in &CASES {
        waveforms += echoes_agree(case)?;
    }
    Ok(6 * LOOPS + waveforms)
}

/// Fills codes with one kind: any, all extreme, 12 bits, narrow, or narrow with a few wild ones.
fn fill(codes: &mut [u16], random: &mut Random) {
    let kind = random.below(5);
    let base = random.below(0x10000);
    let width = 1 << random.below(10);
    for code in codes {
        let near = (base + random.below(width)) as u16;
        *code = match kind {
            0 => random.next() as u16,
            1 => [0, 1, 0x7fff, 0x8000, 0xffff][random.below(5) as usize],
            2 => (random.next() & 0xfff) as u16,
            3 if random.below(16) == 0 => random.next() as u16,
            _ => near,
        };
    }
}

/// Fills Q1.15 values with one kind: all extreme, small, or any.
fn fill_q15(values: &mut [i16], random: &mut Random) {
    let kind = random.below(3);
    for value in values {
        *value = match kind {
            0 => [i16::MIN, i16::MAX][random.below(2) as usize],
            1 => (random.below(41) as i16) - 20,
            _ => random.next() as i16,
        };
    }
}

fn baselines_agree(random: &mut Random) -> bool {
    let mut codes = [0; 90];
    fill(&mut codes, random);
    let start = random.below(4) as usize;
    let codes = &codes[start..start + random.below(80) as usize];
    let shift = random.below(16);
    let clip = if random.below(2) == 0 {
        random.next() as u16
    } else {
        ((1u32 << (15 - shift)) - 1) as u16
    };
    let ambient = if random.below(2) == 0 {
        random.next() as i16
    } else {
        [i16::MIN, i16::MAX][random.below(2) as usize]
    };
    let (from, to) = (random.below(4) as usize, 80 + random.below(10) as usize);
    let (mut ours, mut portable) = ([99; 90], [99; 90]);
    FASTEST.remove_baseline(codes, clip, shift, ambient, &mut ours[from..to]);
    Portable.remove_baseline(codes, clip, shift, ambient, &mut portable[from..to]);
    ours == portable
}

fn filters_agree(random: &mut Random) -> bool {
    let mut around = [0x5555; MAX_TAPS + 2]; // no taps
    let start = random.below(2) as usize;
    let most = [20, MAX_TAPS as u32 + 2][random.below(2) as usize];
    let count = random.below(most) as usize;
    let taps = &mut around[start..(start + count).min(MAX_TAPS + 2)];
    taps.fill(0);
    fill_taps(taps, random);
    let mut padded = [0; 300];
    fill_q15(&mut padded, random);
    let padded = &padded[random.below(2) as usize..150 + random.below(150) as usize];
    let (from, to) = (random.below(4) as usize, 10 + random.below(90) as usize);
    let (mut ours, mut portable) = ([99; 100], [99; 100]);
    FASTEST.correlate(taps, padded, &mut ours[from..to]);
    Portable.correlate(taps, padded, &mut portable[from..to]);
    ours == portable
}

/// Fills taps with Σ|h| ≤ 1: spread out, or all in one.
fn fill_taps(taps: &mut [i16], random: &mut Random) {
    let mut left = 0x7fff;
    let share = if random.below(4) == 0 { 0x8000 } else { 0x10000 / (taps.len() as u32 + 1) };
    for _ in 0..taps.len() {
        let size = random.below(share.min(left + 1)) as i16;
        let tap = random.below(taps.len() as u32) as usize;
        left += u32::from(taps[tap].unsigned_abs());
        taps[tap] = if random.below(2) == 0 { size } else { -size };
        left -= u32::from(taps[tap].unsigned_abs()).min(left);
    }
    if random.below(4) == 0 && !taps.is_empty() {
        taps.fill(0);
        taps[random.below(taps.len() as u32) as usize] =
            [i16::MAX, -i16::MAX, i16::MIN][random.below(3) as usize];
    }
}

fn thresholds_agree(random: &mut Random) -> bool {
    let mut values = [0; 70];
    fill_q15(&mut values, random);
    let start = random.below(4) as usize;
    let values = &values[start..start + random.below(66) as usize];
    let highest = values.iter().copied().max().unwrap_or(0);
    [highest, highest.saturating_add(1), random.next() as i16, i16::MIN, i16::MAX]
        .into_iter()
        .all(|threshold| FASTEST.reaches(values, threshold) == Portable.reaches(values, threshold))
}

/// Compares peaks of hills of any steepness: noise that is held for some samples.
fn peaks_agree(random: &mut Random) -> bool {
    let mut values = [0; 150];
    fill_q15(&mut values, random);
    let (held, start) = (1 + random.below(9) as usize, random.below(4) as usize);
    for i in 0..values.len() {
        values[i] = values[i - i % held];
    }
    let values = &values[start..start + random.below(146) as usize];
    let some = values.first().copied().unwrap_or(0);
    [some, some / 2, random.next() as i16, i16::MIN, 1, i16::MAX].into_iter().all(|threshold| {
        let (mut ours, mut portable) = (Peaks::new(), Peaks::new());
        FASTEST.peaks(values, threshold, &mut ours);
        Portable.peaks(values, threshold, &mut portable);
        ours == portable
    })
}

/// Compares the bins, and checks that memory behind them is not changed.
fn counts_agree(random: &mut Random) -> bool {
    use echoloop_dsp::statistics::{self, BINS};
    let first = random.below(0x10000 - BINS as u32) as u16;
    let mut codes = [0; 104];
    for code in &mut codes {
        let near = first.wrapping_add(random.below(BINS as u32) as u16);
        let edges = [0, 1, BINS as u16 - 1, BINS as u16, u16::MAX, 0u16.wrapping_sub(first)];
        let edge = first.wrapping_add(edges[random.below(6) as usize]);
        *code = if random.below(4) == 0 { edge } else { near };
    }
    let start = random.below(4) as usize;
    let codes = &codes[start..start + random.below(100) as usize];
    let (mut ours, mut portable) = ([7; BINS + 8], [7; BINS + 8]);
    let (Some(our_bins), Some(portable_bins)) =
        (ours.first_chunk_mut(), portable.first_chunk_mut())
    else {
        return false;
    };
    let (our_below, portable_below) = (
        echoloop_kernels::count(codes, first, our_bins),
        statistics::count(codes, first, portable_bins),
    );
    our_below == portable_below && ours == portable
}

fn order_statistics_agree(random: &mut Random) -> bool {
    let mut codes = [0; 104];
    fill(&mut codes, random);
    let start = random.below(4) as usize;
    let codes = &codes[start..start + 1 + random.below(100) as usize];
    let near = codes[0].wrapping_add(random.below(100) as u16);
    let median = if random.below(2) == 0 { near } else { random.next() as u16 };
    let any = random.next() as u16;
    let deviation = [random.below(100) as u16, any, u16::MAX][random.below(3) as usize];
    let guess = Statistics { median, deviation, ..Statistics::default() };
    let portable = Portable.order_statistics(codes, 0xfff, &guess);
    FASTEST.order_statistics(codes, 0xfff, &guess) == portable
        && Scalar.order_statistics(codes, 0xfff, &guess) == portable
}

/// Compares whole pipelines; returns the number of waveforms compared.
fn pipelines_agree(random: &mut Random) -> Result<u32, &'static str> {
    let settings = Settings {
        power_uw: 5_000_000,
        pulse_width_ps: 2_000 + random.below(18_001) as i32,
        bins: 200 + random.below(600) as i32,
        saturation_ppm: 250_000 + random.below(750_001) as i32,
        snr_threshold_milli: 2_500 + random.below(5_501) as i32,
        upsampling: 1 << random.below(4),
        echoes: 1 + random.below(4) as i32,
        echo_choice: random.below(3) as i32,
        ..Settings::default()
    };
    let hardware = Hardware { adc_bits: 8 + random.below(7), ..Hardware::REFERENCE };
    let Ok(pipeline) = Pipeline::new(&settings, &hardware) else { return Ok(0) };
    let (mut ours, mut portable) = (Scratch::new(), Scratch::new());
    let mut codes = [0; 800];
    for _ in 0..8 {
        fill(&mut codes, random);
        let codes = &codes[..random.below(801) as usize];
        let same = pipeline.process(FASTEST, codes, &mut ours)
            == pipeline.process(Portable, codes, &mut portable)
            && ours.statistics() == portable.statistics()
            && ours.filtered(codes.len()) == portable.filtered(codes.len());
        if !same {
            return Err("pipelines differ");
        }
    }
    Ok(8)
}

/// Compares the echoes of a realistic waveform; returns 1, the number of waveforms compared.
fn echoes_agree(case: &Case) -> Result<u32, &'static str> {
    let pipeline =
        Pipeline::new(&case.settings(), &case.hardware()).map_err(|_| "settings refused")?;
    let waveform = case.waveform(pipeline.config().template.half());
    let codes = &waveform[..case.samples];
    let ours = pipeline.process(FASTEST, codes, &mut Scratch::new());
    let portable = pipeline.process(Portable, codes, &mut Scratch::new());
    if ours == portable && ours.len() == case.echoes.len() { Ok(1) } else { Err("echoes differ") }
}
