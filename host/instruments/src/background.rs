//! Background that changes within a record: a drift, or steps as of a lamp or the sun.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use super::codes::Codes;
use super::finder::colour::Colour;
use super::finder::{EchoFinder, FinderConfig, samples};

/// Least length of a piece at rest, samples and pulse widths.
const LEAST_SAMPLES: f64 = 16.0;
const LEAST_WIDTHS: f64 = 3.0;

/// Width up to which pulses count as equally narrow, samples: the least length is that of theirs.
const NARROWEST: f64 = LEAST_SAMPLES / LEAST_WIDTHS;

/// Length of a record over the greatest width of an unknown pulse.
const WIDEST: f64 = 30.0;

/// Times that an unknown pulse is measured again without the background, and by how much narrower
/// it has to be than before.
const NARROWER: usize = 3;
const MUCH: f64 = 0.8;

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

/// A piece at rest.
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
    let width = width.max(NARROWEST);
    let pieces = background(&pieces(codes, length, sigma), sigma, width, codes.codes.len())?;
    let (least, most) = levels(&pieces)?;
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
        let Between { flank, is_step } = between(codes, a, b, sigma, width);
        let whole = middle(&a.at)..middle(&b.at);
        level[whole.start..flank.start].fill(a.level);
        level[flank.end.min(whole.end)..whole.end].fill(b.level);
        for (k, n) in flank.clone().enumerate() {
            level[n] = match is_step {
                true => f64::from(codes.codes[n]),
                false => a.level + (b.level - a.level) * k as f64 / flank.len() as f64,
            };
        }
        gaps.extend(is_step.then_some(flank));
    }
    gaps.sort_by_key(|gap| gap.start);
    let rest = most.round() - least.floor();
    let moved = |(&code, level): (&u16, &f64)| {
        (f64::from(code) - level + rest).round().clamp(0.0, 16_383.0) as u16
    };
    let moved = codes.codes.iter().zip(&level).map(moved).collect();
    Some((Codes::of_codes(moved, codes.unit, gaps), (most - least) * codes.unit))
}

/// Least and highest level; `None` of no pieces.
fn levels(pieces: &[Piece]) -> Option<(f64, f64)> {
    let levels = pieces.iter().map(|piece| piece.level);
    levels.clone().reduce(f64::min).zip(levels.reduce(f64::max))
}

/// As [`without_change`], of a pulse of unknown width, too: that is as wide as the narrowest of the
/// strong echoes, which steps may hide at first.
pub(crate) fn levelled(
    finder: &mut EchoFinder,
    codes: &Codes,
    sigma: f64,
    width: Option<f64>,
    colour: Option<Colour>,
) -> Option<(Codes, f64)> {
    if let Some(width) = width {
        return without_change(codes, sigma, width);
    }
    let mut width = narrowest(finder, codes, colour).unwrap_or_default();
    let mut level = without_change(codes, sigma, width);
    for _ in 0..NARROWER {
        if width <= NARROWEST {
            break; // a narrower one changes nothing
        }
        // Where a wide pulse hides what changes, as if it were as narrow as can be.
        let seen = level.clone().or_else(|| without_change(codes, sigma, NARROWEST));
        match narrowest(finder, &seen?.0, colour) {
            Some(narrower) if narrower < MUCH * width => width = narrower,
            _ => break,
        }
        level = without_change(codes, sigma, width);
    }
    level
}

/// Width of the narrowest of the strong echoes, samples; `None` where it makes no difference, and
/// without an echo.
fn narrowest(finder: &mut EchoFinder, codes: &Codes, colour: Option<Colour>) -> Option<f64> {
    // A drift looks like a broad echo.
    let widest = codes.codes.len() as f64 / WIDEST;
    if widest <= NARROWEST {
        return None; // as wide as the narrowest that is told apart
    }
    let echoes = finder.echoes(&codes.codes, &FinderConfig::of_record(codes, colour));
    let highest = echoes.iter().map(|echo| echo.amplitude).max()?;
    let strong = echoes.iter().filter(|echo| 5 * echo.amplitude > highest);
    strong.map(|echo| samples(echo.width).min(widest)).reduce(f64::min)
}

fn middle(at: &Range<usize>) -> usize {
    (at.start + at.end) / 2
}

/// Pieces at rest, without clipped samples.
fn pieces(codes: &Codes, length: usize, sigma: f64) -> Vec<Piece> {
    let last = codes.codes.len().saturating_sub(length);
    let starts = (0..last).step_by(length / 2).chain([last]);
    let piece = |at: Range<usize>| {
        let (level, variance) = line(&codes.codes[at.clone()]);
        (variance <= AT_REST * sigma * sigma).then_some(Piece { at, level })
    };
    codes.undisturbed(starts.map(|start| start..start + length)).filter_map(piece).collect()
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
    // By order, up to the first on which all lie: the curve, and how many pieces lie on it; none on
    // one that too few pieces give.
    let mut curves: Vec<(Vec<f64>, usize)> = Vec::new();
    let lie = |share: f64, on_curve: usize| on_curve as f64 >= share * pieces.len() as f64;
    for order in 0..=ORDER {
        let curve = lower_curve(pieces, order, change).unwrap_or_default();
        let is_on = |(piece, at): &(&Piece, &f64)| (piece.level - **at).abs() <= change;
        let on_curve = pieces.iter().zip(&curve).filter(is_on).count();
        curves.push((curve, on_curve));
        if lie(ALL, on_curve) {
            break;
        }
    }
    let first = |level: f64, most: f64| {
        let least = |order: usize| if order == 0 { level } else { most };
        (0..curves.len()).find(|&order| lie(least(order), curves[order].1))
    };
    let order = match first(ALL, ALL) {
        Some(order) => order,
        None => {
            let length = (PLATEAU * width).max(SHORTEST);
            let plateaus = plateaus(pieces, change, length, samples);
            if levels(&plateaus).is_some_and(|(least, most)| most - least > change) {
                return Some(plateaus);
            }
            first(SOME, MOST)?
        }
    };
    let on_curve = |(piece, &level): (&Piece, &f64)| Piece { level, ..piece.clone() };
    (order > 0).then(|| pieces.iter().zip(&curves[order].0).map(on_curve).collect())
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
struct Between {
    flank: Range<usize>,
    /// True of a step without an echo on it, where nothing is looked for; else it is a line.
    is_step: bool,
}

/// Between two pieces: a step where the samples only rise or only fall; else, as for an echo over a
/// change, the ramp that explains most samples, of the echo only those below it.
fn between(codes: &Codes, a: &Piece, b: &Piece, sigma: f64, width: f64) -> Between {
    let whole = middle(&a.at)..middle(&b.at);
    let ramp = |flank: Range<usize>| Between { flank, is_step: false };
    let error = sigma * (2.0 / a.at.len() as f64).sqrt();
    let touch = b.at.start <= a.at.start + a.at.len() / 2;
    let change = b.level - a.level;
    if touch || change.abs() < SIGNIFICANT * error {
        return ramp(whole);
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
        return Between { flank, is_step: true };
    }
    if whole.len() > LONGEST {
        return ramp(whole);
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
    ramp(best.map_or(whole.clone(), |(_, flank)| flank))
}
