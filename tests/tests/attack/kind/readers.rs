//! Damaged files for every reader: accidents of people and disks, numbers at the ends of their
//! range, repeated and swapped lines, foreign words.

use echoloop_tests::harness::corpus;
use echoloop_tests::readers::READERS;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::campaign::Campaign;
use crate::damage::accident;

/// Numbers that a reader may not expect.
const NUMBERS: [&str; 26] = [
    "0",
    "-1",
    "1",
    "2",
    "3",
    "255",
    "256",
    "65536",
    "4294967295",
    "4294967296",
    "2147483648",
    "1000000000000",
    "18446744073709551615",
    "18446744073709551616",
    "9223372036854775807",
    "-9223372036854775808",
    "1e308",
    "-1e39",
    "1e-320",
    "nan",
    "-inf",
    "1e999",
    "+1",
    "",
    "--1",
    "0x10",
];

/// Words with a meaning in one of the formats.
const WORDS: [&str; 14] = [
    "x",
    "list",
    "uchar",
    "double",
    "ascii",
    "binary",
    "binary_compressed",
    "end_header",
    "element",
    "mtllib",
    "true",
    "null",
    "[[[[",
    "\u{1b}[31m",
];

/// Bits of floats and integers that a reader may not expect.
const FLOATS: [u32; 8] = [0x7fc0_0000, 0x7f80_0000, 0xff7f_ffff, 1, 0x8000_0000, u32::MAX, 2, 0];

fn one_of<'a, T>(rng: &mut ChaCha8Rng, all: &'a [T]) -> &'a T {
    &all[rng.random_range(0..all.len())]
}

/// Begin and end of every word; `is_in` tells the bytes of words.
fn words(bytes: &[u8], is_in: impl Fn(u8) -> bool) -> Vec<(usize, usize)> {
    let mut found = Vec::new();
    let mut start = None;
    for (at, byte) in bytes.iter().copied().chain([b'\n']).enumerate() {
        match (start, is_in(byte)) {
            (None, true) => start = Some(at),
            (Some(from), false) => {
                found.push((from, at));
                start = None;
            }
            _ => {}
        }
    }
    found
}

/// `bytes` with one of the words at `places` replaced.
fn replaced(rng: &mut ChaCha8Rng, bytes: &[u8], places: &[(usize, usize)], by: &str) -> Vec<u8> {
    if places.is_empty() {
        return bytes.to_vec();
    }
    let (from, to) = *one_of(rng, places);
    [&bytes[..from], by.as_bytes(), &bytes[to..]].concat()
}

/// `bytes` with lines lost, repeated, swapped, very many, or very long.
fn lines(rng: &mut ChaCha8Rng, bytes: &[u8]) -> Vec<u8> {
    let mut lines: Vec<Vec<u8>> = bytes.split(|&byte| byte == b'\n').map(<[u8]>::to_vec).collect();
    let [i, j] = [0, 1].map(|_| rng.random_range(0..lines.len()));
    // The last two ways may make the file two thousand times as long.
    let ways = if bytes.len() < 100_000 { 5 } else { 3 };
    match rng.random_range(0..ways) {
        0 => drop(lines.remove(i)),
        1 => lines.insert(j, lines[i].clone()),
        2 => lines.swap(i, j),
        3 => lines[i] = lines[i].repeat(*one_of(rng, &[2, 100, 2000])),
        _ => {
            let line = lines[i].clone();
            lines.splice(i..i, vec![line; *one_of(rng, &[3, 1000])]);
        }
    }
    lines.join(&b'\n')
}

fn floats(rng: &mut ChaCha8Rng, bytes: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    if let Some(last) = bytes.len().checked_sub(4) {
        let (at, value) = (rng.random_range(0..=last), *one_of(rng, &FLOATS));
        let value = if rng.random() { value.to_le_bytes() } else { value.to_be_bytes() };
        bytes[at..at + 4].copy_from_slice(&value);
    }
    bytes
}

fn damaged(rng: &mut ChaCha8Rng, bytes: &[u8], other: &[u8]) -> Vec<u8> {
    match rng.random_range(0..8) {
        0..3 => {
            let numbers = words(bytes, |b| b.is_ascii_digit() || b"+-.".contains(&b));
            let number = *one_of(rng, &NUMBERS);
            replaced(rng, bytes, &numbers, number)
        }
        3 => {
            let words = words(bytes, |b| b.is_ascii_alphabetic() || b == b'_');
            let word = *one_of(rng, &WORDS);
            replaced(rng, bytes, &words, word)
        }
        4 => lines(rng, bytes),
        5 => floats(rng, bytes),
        _ => accident(rng, bytes, other),
    }
}

#[test]
fn a_damaged_file_is_read_or_refused_in_few_words() {
    let corpora = READERS.map(|(name, _)| corpus(name));
    Campaign { kind: "readers", cases: 10_000 }.run(|rng| {
        let at = rng.random_range(0..READERS.len());
        let [file, other] = [0, 1].map(|_| one_of(rng, &corpora[at]).clone());
        let times = rng.random_range(1..=4);
        let file = (0..times).fold(file, |file, _| damaged(rng, &file, &other));
        Ok(if READERS[at].1(&file) { "read" } else { "refused" })
    });
}
