//! The pipeline for vector units against the plain one, bit for bit, on a million waveforms.
//!
//! Every 64th is drawn by [`vectors::case`] with its own settings; the others are mostly short
//! pieces of it, distorted: reversed, noisy, at other levels, rotated, random. The comparison
//! covers echoes, statistics and `y`.

use echoloop_dsp::SampleLoops;
use echoloop_dsp::detect;
use echoloop_dsp::loops::Portable;
use echoloop_dsp::peak::Peaks;
use echoloop_dsp::{MAX_SAMPLES, Pipeline, Scratch};
use echoloop_tests::vectors;
use rand::{Rng, RngExt};
use rayon::iter::{IntoParallelIterator, ParallelIterator};

const WAVEFORMS: u64 = 1_000_000;

/// Waveforms per drawn one, which is the first of them.
const PIECES: u64 = 64;

/// Draws a distorted piece of a waveform; one in 32 may be as long as the waveform.
fn piece(codes: &[u16], rng: &mut impl Rng, out: &mut Vec<u16>) {
    let longest = if rng.random_range(0..32) == 0 { MAX_SAMPLES } else { 160 };
    let length = rng.random_range(0..=longest.min(codes.len()));
    let start = rng.random_range(0..=codes.len() - length);
    out.clear();
    out.extend(&codes[start..start + length]);
    let shift: u32 = rng.random_range(0..16);
    match rng.random_range(0..8) {
        0 => out.reverse(),
        1 => out.iter_mut().for_each(|code| {
            *code = code.wrapping_add(u16::from(rng.random::<u8>()) >> (shift / 2))
        }),
        2 => {
            out.iter_mut().for_each(|code| *code = (*code >> (shift / 4)).wrapping_add(1 << shift))
        }
        3 => out.iter_mut().for_each(|code| *code = rng.random::<u16>() >> shift),
        4 => out.rotate_left(length / 3),
        5 => out.iter_mut().step_by(1 + shift as usize).for_each(|code| *code = !*code),
        _ => {}
    }
}

/// Memory of both builds, kept between waveforms because its contents must not matter.
#[derive(Default)]
struct Both {
    fast: Scratch,
    plain: Scratch,
}

impl Both {
    fn compare(&mut self, pipeline: &Pipeline, codes: &[u16], seed: u64, piece: u64) {
        let fast = echoloop_kernels::process(pipeline, codes, &mut self.fast);
        let plain = echoloop_kernels::process_baseline(pipeline, codes, &mut self.plain);
        let place = || format!("seed {seed}, piece {piece}, {} codes", codes.len());
        assert_eq!(fast, plain, "{}", place());
        assert_eq!(self.fast.statistics(), self.plain.statistics(), "{}", place());
        assert!(
            self.fast.filtered(codes.len()) == self.plain.filtered(codes.len()),
            "y, {}",
            place()
        );
    }
}

#[test]
fn a_million_waveforms_give_the_same_bytes_from_the_vector_unit_and_from_plain_code() {
    if !echoloop_needs::avx2(echoloop_dispatch::has_v3()) {
        return;
    }
    (0..WAVEFORMS / PIECES).into_par_iter().for_each_init(Both::default, |both, seed| {
        let case = vectors::case(seed);
        let pipeline = Pipeline::new(&case.settings, &case.hardware).unwrap();
        both.compare(&pipeline, &case.codes, seed, 0);
        let mut rng = vectors::rng(!seed);
        let mut codes = Vec::with_capacity(MAX_SAMPLES);
        for number in 1..PIECES {
            piece(&case.codes, &mut rng, &mut codes);
            both.compare(&pipeline, &codes, seed, number);
        }
    });
}

#[test]
fn peaks_found_hill_by_hill_are_those_found_sample_by_sample() {
    let (mut by_sample, mut by_hill) = (Peaks::new(), Peaks::new());
    for seed in 0..20_000 {
        let (y, threshold) = vectors::output(seed);
        Portable.peaks(&y, threshold, &mut by_sample);
        let first_reaching = |values: &[i16]| values.iter().position(|&value| value >= threshold);
        detect::peaks_of_hills(first_reaching, &y, threshold, &mut by_hill);
        assert_eq!(by_sample, by_hill, "seed {seed}");
    }
}
