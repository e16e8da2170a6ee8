//! Later tops of a response that the targets may have made: a second surface at a steady distance
//! repeats every echo, as an instrument does.

use super::curve::Curve;
use super::estimate::{LOBE, narrow_limit};
use super::model::{Later, all_turns, turns};
use super::robust::{beyond, densest_half, median};
use super::strong::Strong;

/// Least ratio of the heights of a recording's strong echoes, the tenth highest to the tenth lowest
/// of a hundred: what repeats all of them at the same level is the instrument's, for of two
/// surfaces each has a reflectance of its own. Of less varied ones it is the instrument's where
/// [`OTHERWISE`] of the records have other echoes elsewhere: the targets differ, and it stays.
const VARIED: f64 = 2.0;
const LITTLE_VARIED: f64 = 1.3;
const OTHERWISE: f64 = 0.1;

/// Greatest spread of an instrument's own later top, over its level, and over the echo's height:
/// drift and wide surfaces move a low one by more of its level.
const STEADY: f64 = 0.25;
const STEADY_OF_LOW: f64 = 0.045;

/// Greatest level of an instrument's own later top, where [`OTHERWISE`] of the records have other
/// echoes elsewhere, and where hardly one has: it may then be one scene in changing light.
const HIGHEST: f64 = 0.25;
const HIGHEST_OF_ONE_SCENE: f64 = 0.18;

/// Least level of a top before the strongest that is another surface's; filters ring by less.
const EARLIER: f64 = 0.1;

/// Lag from which on tops are looked at, pulse widths.
const BESIDE: f64 = 0.6;

/// Takes the tops that may be targets out of a response, with the spread that they bring. Returns
/// them.
///
/// ```text
/// an instrument's   where pulses were recorded as long: theirs has at least half the level
///                   else the heights of the echoes differ, and its level does not: σ ≤ level/4
///                   where a tenth of the records has other echoes: 90 % over 10 % of the heights
///                   ≥ 1.3, level ≤ 0.25; else ≥ 2, level ≤ 0.18
/// taken out         h between the valleys on either side of another top: a line, or the rising
///                   flank, turned round, where that is lower; of an earlier top more than a tenth
///                   as high: the flank behind the top, turned round
/// spread            there, and everywhere after the lobe where heights do not differ, at most
///                   its median after the lobe
/// ```
pub(super) fn take_out(
    curve: &mut Curve,
    spread: &mut [f64],
    strong: &[Strong],
    pulses: &[Strong],
) -> Vec<Later> {
    let mut doubtful: Vec<Later> = without_earlier(curve, spread).into_iter().collect();
    let begin = BESIDE * curve.width;
    let point = |point: usize| Later { lag: curve.time(point), level: curve.values[point] };
    let points: Vec<Later> =
        (curve.zero..curve.values.len()).map(point).filter(|at| at.lag > begin).collect();
    let highest = greatest_level(strong, &turns(&points), curve.width);
    let turns = all_turns(&points);
    let after_lobe = |k: &usize| curve.time(*k) > LOBE * curve.width;
    let usual =
        median(&mut (0..spread.len()).filter(after_lobe).map(|k| spread[k]).collect::<Vec<_>>());
    if highest == 0.0 {
        (0..spread.len()).filter(after_lobe).for_each(|k| spread[k] = spread[k].min(usual));
    }
    let is_instrument = |top: &Later| match level_of(pulses, top.lag) {
        Some(level) => level >= top.level / 2.0,
        None => top.level <= highest && is_steady(strong, top.lag),
    };
    for (k, top) in turns.iter().enumerate() {
        let [before, after] = [k.checked_sub(1), Some(k + 1)].map(|k| turns.get(k?));
        let is_top = |beside: Option<&Later>| beside.is_none_or(|turn| turn.level < top.level);
        if top.level <= 0.0 || !is_top(before) || !is_top(after) || is_instrument(top) {
            continue;
        }
        // Spacings that vary make several tops with shallow valleys.
        let is_deep = |turn: &&Later| 2.0 * turn.level < top.level;
        let first = turns[..k].iter().rev().find(is_deep).map_or(begin, |turn| turn.lag);
        let last = turns[k + 1..].iter().find(is_deep).map_or(f64::MAX, |turn| turn.lag);
        let between = first..=last;
        let beside = |at: &&Later| between.contains(&at.lag);
        let (left, right): (Vec<&Later>, Vec<&Later>) =
            points.iter().filter(beside).partition(|at| at.lag <= top.lag);
        let valley = |side: Vec<&Later>| {
            side.into_iter().min_by(|a, b| a.level.total_cmp(&b.level)).copied()
        };
        if let Some((from, to)) = valley(left).zip(valley(right)) {
            level_out(curve, spread, usual, [from, to]);
            doubtful.push(*top);
        }
    }
    doubtful
}

/// Takes out an earlier top: light does not come before the pulse, so the strongest echo is the
/// second of two surfaces. What rises before the valley between them is the falling flank, turned
/// round. Returns the top as the second surface is seen from the first.
fn without_earlier(curve: &mut Curve, spread: &mut [f64]) -> Option<Later> {
    let before = curve.values[..curve.zero].iter().rev();
    let points: Vec<Later> = before
        .zip(1..)
        .map(|(&level, k)| Later { lag: f64::from(k) * curve.step, level })
        .collect();
    let turns = turns(&points);
    let top = turns.iter().zip(turns.get(1..)?).find(|(valley, top)| {
        top.level > EARLIER && top.level > valley.level && valley.lag > BESIDE * curve.width
    });
    let (valley, top) = top.map(|(valley, top)| (*valley, *top))?;
    let falling = &curve.values[curve.zero..];
    let there = curve.zero + falling.iter().position(|level| *level <= valley.level)?;
    let end = curve.zero - (valley.lag / curve.step).round() as usize;
    let usual = spread.first().copied().unwrap_or_default();
    let flank: Vec<f64> = curve.values[there..].iter().skip(1).take(end).copied().collect();
    let levels = curve.values[..end].iter_mut().rev().zip(spread[..end].iter_mut().rev());
    for (k, (level, spread)) in levels.enumerate() {
        *level = level.min(flank.get(k).copied().unwrap_or_default());
        *spread = spread.min(usual);
    }
    Some(Later { lag: top.lag, level: 1.0 / top.level })
}

/// Replaces the levels between two points after the lobe by a line, but none higher than the rising
/// flank, turned round: a top on the falling flank has raised the valley before it. Holds the
/// spread there to the usual one.
fn level_out(curve: &mut Curve, spread: &mut [f64], usual: f64, [from, to]: [Later; 2]) {
    let point = |lag: f64| (lag / curve.step).round() as usize + curve.zero;
    let (first, last) = (point(from.lag), point(to.lag));
    for k in first..=last.min(curve.values.len() - 1) {
        let share = (k - first) as f64 / (last - first).max(1) as f64;
        let line = from.level + share * (to.level - from.level);
        let rising = curve.zero.checked_sub(k - curve.zero).map_or(0.0, |k| curve.values[k]);
        curve.values[k] = line.min(rising.max(to.level));
        if let Some(spread) = spread.get_mut(k) {
            *spread = spread.min(usual);
        }
    }
}

/// Median level of emitted pulses at a lag; `None` where less than half of them was recorded so
/// long, or none was.
fn level_of(pulses: &[Strong], lag: f64) -> Option<f64> {
    let mut levels: Vec<f64> =
        pulses.iter().filter_map(|pulse| pulse.at(pulse.time + lag)).collect();
    (!levels.is_empty() && 2 * levels.len() >= pulses.len()).then(|| median(&mut levels))
}

/// True when the echoes that are as narrow as most have about the same level at a lag.
fn is_steady(strong: &[Strong], lag: f64) -> bool {
    let limit = narrow_limit(strong);
    let narrow = || strong.iter().filter(|s| s.width <= limit);
    let mut levels: Vec<f64> = narrow().filter_map(|s| s.at(s.time + lag)).collect();
    if levels.is_empty() {
        return true;
    }
    levels.sort_by(f64::total_cmp);
    let (level, spread) = densest_half(&levels);
    let noise = median(&mut narrow().map(Strong::noise).collect::<Vec<_>>());
    beyond(spread, noise) <= (STEADY * level).max(STEADY_OF_LOW)
}

/// Greatest level of a later top that is the instrument's; 0 where the targets differ so little
/// that what all records have in common may be theirs.
fn greatest_level(strong: &[Strong], turns: &[Later], width: f64) -> f64 {
    let mut heights: Vec<f64> = strong.iter().map(|s| s.height * s.unit).collect();
    heights.sort_by(f64::total_cmp);
    let tenth = heights.len() / 10;
    let ratio = heights[heights.len() - 1 - tenth] / heights[tenth];
    let is_elsewhere =
        |lag: &f64| turns.iter().all(|turn| (lag.abs() - turn.lag).abs() > width / 2.0);
    let otherwise = strong.iter().filter(|s| s.others.iter().any(is_elsewhere)).count();
    match otherwise as f64 >= OTHERWISE * strong.len() as f64 {
        true if ratio >= LITTLE_VARIED => HIGHEST,
        false if ratio >= VARIED => HIGHEST_OF_ONE_SCENE,
        _ => 0.0,
    }
}
