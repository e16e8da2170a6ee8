//! Background that changes within a record: a drift, or steps as of a lamp or the sun.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use super::codes::Codes;
use super::finder::colour::Colour;
use super::finder::{EchoFinder, FinderConfig, samples};
use super::response::at_rest;

/// Least length of a piece at rest, samples and pulse widths.
const LEAST_SAMPLES: f64 = 16.0;
const LEAST_WIDTHS: f64 = 3.0;

/// Length of a record over the greatest width of an unknown pulse.
const WIDEST: f64 = 30.0;

/// Least length of a record that is looked at, pieces.
const PIECES: usize = 5;

/// Greatest variance of a piece about its line, over that of noise: one in a thousand of 16 samples
/// has more.
const AT_REST: f64 = 2.4;

/// Least change of the background that is taken out, in σ of a sample; and, between two pieces, in
/// standard errors of their means.
const CHANGE: f64 = 1.0;
const SIGNIFICANT: f64 = 5.0;

/// Least length of a plateau, pulse widths and samples: broad echoes are shorter.
const PLATEAU: f64 = 10.0;
const SHORTEST: f64 = 48.0;

/// Highest order of a drift, and rounds of its fit.
const ORDER: usize = 7;
const ROUNDS: usize = 12;

/// Longest stretch between two pieces in which a ramp is looked for, which bounds the time.
const LONGEST: usize = 1000;

/// Least share of the pieces on the curve of a drift, before and after plateaus are looked for; and
/// of those that are level where nothing else explains the others.
const ALL: f64 = 0.9;
const MOST: f64 = 0.75;
const SOME: f64 = 0.4;

/// Greatest distance of a sample from its level, in σ.
const NEAR: f64 = 4.0;

/// A piece at rest: a line through its samples.
#[derive(Clone, Debug, PartialEq)]
struct Piece {
    at: Range<usize>,
    /// Level in its middle, codes.
    level: f64,
}

/// A record without the change of its background, and that change in the file's units; `None`
/// where the background is level.
///
/// ```text
/// piece       L = max(16, 3 widths) samples, L/2 apart, that vary about a line as noise does
/// background  the polynomial of least order, 7 at most, on which 90 % of the pieces lie; else
///             where plateaus of 10 widths differ, through their pieces; else, where less than 40 %
///             of the pieces are level, the polynomial on which 75 % lie
/// step        between two levels that differ, where samples only rise or only fall: nothing is
///             looked for there; with an echo between, the ramp that explains most samples
/// ```
///
/// `sigma` is the noise of a sample, codes; `width` that of the pulse, samples.
fn without_change(codes: &Codes, sigma: f64, width: f64) -> Option<(Codes, f64)> {
    let length = LEAST_SAMPLES.max((LEAST_WIDTHS * width).round()) as usize;
    let sigma = sigma.max(1.0 / 12f64.sqrt());
    if codes.codes.len() / PIECES < length {
        return None;
    }
    let width = width.max(LEAST_SAMPLES / LEAST_WIDTHS);
    let pieces = background(&pieces(codes, length, sigma), sigma, width, codes.codes.len())?;
    let levels = || pieces.iter().map(|piece| piece.level);
    let (least, most) = (levels().reduce(f64::min)?, levels().reduce(f64::max)?);
    if most - least < CHANGE * sigma {
        return None;
    }
    let mut level = vec![0.0; codes.codes.len()];
    let (first, last) = (&pieces[0], &pieces[pieces.len() - 1]);
    level[..middle(&first.at)].fill(first.level);
    level[middle(&last.at)..].fill(last.level);
    let mut gaps = codes.gaps.clone();
    for pair in pieces.windows(2) {
        let [a, b] = pair else { continue };
        let whole = middle(&a.at)..middle(&b.at);
        match between(codes, a, b, sigma, width) {
            Between::Step(flank) => {
                level[whole.start..flank.start].fill(a.level);
                level[flank.end.min(whole.end)..whole.end].fill(b.level);
                for n in flank.clone() {
                    level[n] = f64::from(codes.codes[n]);
                }
                gaps.push(flank);
            }
            Between::Ramp(ramp) => {
                level[whole.start..ramp.start].fill(a.level);
                level[ramp.end..whole.end].fill(b.level);
                for (k, level) in level[ramp.clone()].iter_mut().enumerate() {
                    *level = a.level + (b.level - a.level) * k as f64 / ramp.len() as f64;
                }
            }
        }
    }
    gaps.sort_by_key(|gap| gap.start);
    let rest = most.round() - levels().fold(f64::INFINITY, f64::min).floor();
    let moved = |(&code, level): (&u16, &f64)| {
        (f64::from(code) - level + rest).round().clamp(0.0, 16_383.0) as u16
    };
    let moved: Vec<u16> = codes.codes.iter().zip(&level).map(moved).collect();
    let bits = 16 - moved.iter().max().map_or(0, |most| most.leading_zeros());
    let shift = 15u32.saturating_sub(bits).clamp(1, 7);
    Some((Codes { codes: moved, shift, unit: codes.unit, gaps }, (most - least) * codes.unit))
}

/// As [`without_change`], with the noise measured; a pulse of unknown width is as wide as the
/// narrowest of the strong echoes.
pub(crate) fn levelled(
    finder: &mut EchoFinder,
    codes: &Codes,
    width: Option<f64>,
    colour: Option<Colour>,
) -> Option<(Codes, f64)> {
    let found = || {
        let search = FinderConfig { code_shift: codes.shift, colour, ..FinderConfig::DEFAULT };
        let echoes = finder.echoes(&codes.codes, &search);
        let highest = echoes.iter().map(|echo| echo.amplitude).max()?;
        let strong = echoes.iter().filter(|echo| 5 * echo.amplitude > highest);
        // A drift looks like a broad echo.
        let widest = codes.codes.len() as f64 / WIDEST;
        strong.map(|echo| samples(echo.width).min(widest)).reduce(f64::min)
    };
    let (_, sigma) = at_rest(codes, colour);
    without_change(codes, sigma, width.or_else(found).unwrap_or_default())
}

fn middle(at: &Range<usize>) -> usize {
    (at.start + at.end) / 2
}

/// Pieces at rest, without clipped samples.
fn pieces(codes: &Codes, length: usize, sigma: f64) -> Vec<Piece> {
    let last = codes.codes.len().saturating_sub(length);
    let highest = codes.codes.iter().max();
    let mut starts: Vec<usize> = (0..last).step_by(length / 2).collect();
    starts.push(last);
    let piece = |start: usize| {
        let at = start..start + length;
        let x = &codes.codes[at.clone()];
        let in_gap = codes.gaps.iter().any(|gap| gap.start < at.end && at.start < gap.end);
        let clipped = x.iter().filter(|code| Some(*code) == highest).count() > 2;
        if in_gap || clipped {
            return None;
        }
        let (level, variance) = line(x);
        (variance <= AT_REST * sigma * sigma).then_some(Piece { at, level })
    };
    starts.into_iter().filter_map(piece).collect()
}

/// Mean, and variance about the line of least squares.
fn line(x: &[u16]) -> (f64, f64) {
    let n = x.len() as f64;
    let mean = x.iter().map(|&v| f64::from(v)).sum::<f64>() / n;
    let from_middle = |k: usize| k as f64 - (n - 1.0) / 2.0;
    let pairs = || x.iter().enumerate().map(|(k, &v)| (from_middle(k), f64::from(v) - mean));
    let slope = pairs().map(|(t, v)| t * v).sum::<f64>() * 12.0 / (n * (n * n - 1.0));
    let variance = pairs().map(|(t, v)| (v - slope * t).powi(2)).sum::<f64>() / (n - 2.0);
    (mean, variance)
}

/// Pieces of a background that changes: of its plateaus, where it steps; else along the curve of
/// least order that explains them. `None` where it is level, or nothing explains it.
fn background(pieces: &[Piece], sigma: f64, width: f64, samples: usize) -> Option<Vec<Piece>> {
    let change = CHANGE * sigma;
    let of_order = |order: usize, share: f64| {
        let curve = lower_curve(pieces, order, change)?;
        let on_curve = |(piece, at): &(&Piece, &f64)| (piece.level - **at).abs() <= change;
        let count = pieces.iter().zip(&curve).filter(on_curve).count();
        (count as f64 >= share * pieces.len() as f64).then_some(curve)
    };
    let along = |curve: Vec<f64>| -> Vec<Piece> {
        let on_curve = |(piece, level): (&Piece, f64)| Piece { level, ..piece.clone() };
        pieces.iter().zip(curve).map(on_curve).collect()
    };
    if of_order(0, ALL).is_some() {
        return None;
    }
    if let Some(curve) = (1..=ORDER).find_map(|order| of_order(order, ALL)) {
        return Some(along(curve));
    }
    let plateaus = plateaus(pieces, change, (PLATEAU * width).max(SHORTEST), samples);
    let levels = plateaus.iter().map(|piece| piece.level);
    let (least, most) = (levels.clone().reduce(f64::min), levels.reduce(f64::max));
    if most.zip(least).is_some_and(|(most, least)| most - least > change) {
        return Some(plateaus);
    }
    if of_order(0, SOME).is_some() {
        return None;
    }
    (1..=ORDER).find_map(|order| of_order(order, MOST)).map(along)
}

/// Pieces in runs of one level that are long enough; half as long at an end of the record.
fn plateaus(pieces: &[Piece], change: f64, length: f64, samples: usize) -> Vec<Piece> {
    let mut found = Vec::new();
    let mut run: Vec<Piece> = Vec::new();
    let mut end = |run: &mut Vec<Piece>| {
        let (from, to) = run.last().map_or((0, 0), |last| (run[0].at.start, last.at.end));
        let least = if from == 0 || to == samples { length / 2.0 } else { length };
        if (to - from) as f64 >= least {
            found.append(run);
        }
        run.clear();
    };
    for piece in pieces {
        let mean = run.iter().map(|p| p.level).sum::<f64>() / run.len().max(1) as f64;
        let touches = run.last().is_none_or(|last| piece.at.start <= last.at.end);
        if !(touches && (run.is_empty() || (piece.level - mean).abs() <= change)) {
            end(&mut run);
        }
        run.push(piece.clone());
    }
    end(&mut run);
    found
}

/// A polynomial through the pieces' levels, but for those above it; its values at them. `None` of
/// too few.
fn lower_curve(pieces: &[Piece], order: usize, change: f64) -> Option<Vec<f64>> {
    let (first, last) = (middle(&pieces.first()?.at), middle(&pieces.last()?.at));
    let place = |piece: &Piece| {
        2.0 * (middle(&piece.at) - first) as f64 / (last - first).max(1) as f64 - 1.0
    };
    let powers = |piece: &Piece| (0..=order).map(|power| place(piece).powi(power as i32)).collect();
    let rows: Vec<Vec<f64>> = pieces.iter().map(powers).collect();
    let mut kept = vec![true; pieces.len()];
    let mut curve = Vec::new();
    for _ in 0..ROUNDS {
        let used: Vec<usize> = (0..pieces.len()).filter(|&k| kept[k]).collect();
        if used.len() <= 2 * (order + 1) {
            return None;
        }
        let matrix = DMatrix::from_fn(used.len(), order + 1, |row, power| rows[used[row]][power]);
        let levels = DVector::from_fn(used.len(), |row, _| pieces[used[row]].level);
        let solution = matrix.svd(true, true).solve(&levels, 1e-9).ok()?;
        let value = |row: &Vec<f64>| row.iter().zip(solution.iter()).map(|(a, b)| a * b).sum();
        curve = rows.iter().map(value).collect();
        let next: Vec<bool> =
            pieces.iter().zip(&curve).map(|(piece, at)| piece.level - at <= change).collect();
        if next == kept {
            break;
        }
        kept = next;
    }
    Some(curve)
}

/// Where the background goes from the level of one piece to that of the next.
enum Between {
    /// A step without an echo on it: nothing is looked for there.
    Step(Range<usize>),
    /// A line from the first sample to the last.
    Ramp(Range<usize>),
}

/// Between two pieces: a step where the samples only rise or only fall; else, as for an echo over a
/// change, the ramp that explains most samples, of the echo only those below it.
fn between(codes: &Codes, a: &Piece, b: &Piece, sigma: f64, width: f64) -> Between {
    let whole = middle(&a.at)..middle(&b.at);
    let error = sigma * (2.0 / a.at.len() as f64).sqrt();
    let touch = b.at.start <= a.at.start + a.at.len() / 2;
    let change = b.level - a.level;
    if touch || change.abs() < SIGNIFICANT * error {
        return Between::Ramp(whole);
    }
    let value = |n: usize| f64::from(codes.codes[n]);
    let is_near = |n: &usize, level: f64| (value(*n) - level).abs() < NEAR * sigma;
    let first = whole.clone().find(|n| !is_near(n, a.level)).unwrap_or(whole.start);
    let last = whole.clone().rev().find(|n| !is_near(n, b.level)).unwrap_or(whole.end);
    let flank = first.min(last)..last.max(first) + 1;
    let (low, high) = (a.level.min(b.level), a.level.max(b.level));
    let mut farthest = 0.0f64;
    let goes_on = flank.clone().all(|n| {
        let gone = (value(n) - a.level) * change.signum();
        farthest = farthest.max(gone);
        gone > farthest - NEAR * sigma
            && (low - NEAR * sigma..=high + NEAR * sigma).contains(&value(n))
    });
    if goes_on {
        return Between::Step(flank);
    }
    if whole.len() > LONGEST {
        return Between::Ramp(whole);
    }
    let cost = |ramp: &Range<usize>| {
        let level = |n: usize| {
            let share = (n as f64 - ramp.start as f64) / (ramp.len().max(1)) as f64;
            a.level + change * share.clamp(0.0, 1.0)
        };
        whole.clone().map(|n| (value(n) - level(n)).abs().min(NEAR * sigma)).sum::<f64>()
    };
    let lengths = [1.0, 0.5 * width, width, 2.0 * width, whole.len() as f64];
    let ramps = lengths.into_iter().flat_map(|length| {
        let length = (length.round() as usize).clamp(1, whole.len());
        (whole.start..=whole.end - length).map(move |from| from..from + length)
    });
    let best = ramps.map(|ramp| (cost(&ramp), ramp)).min_by(|a, b| a.0.total_cmp(&b.0));
    Between::Ramp(best.map_or(whole.clone(), |(_, ramp)| ramp))
}
