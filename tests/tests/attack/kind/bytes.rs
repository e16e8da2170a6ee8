//! Inputs that fuzzing kept, damaged: frames, sessions, flashes, waveforms.

use std::fs;
use std::path::Path;

use echoloop_tests::harness;
use rand::RngExt;

use crate::campaign::Campaign;
use crate::damage::damaged;

type Target = (&'static str, fn(&[u8]));

const TARGETS: [Target; 4] = [
    ("frames", harness::frame_decoder),
    ("sessions", harness::session),
    ("flashes", harness::store),
    ("waveforms", harness::waveforms),
];

/// Files of the corpus, in the order of [`TARGETS`].
const KEPT: [&str; 4] = ["frame_decoder", "session", "store", "waveforms"];

/// The inputs kept for a target.
fn corpus(name: &str) -> Vec<Vec<u8>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fuzz/corpus");
    let text = fs::read_to_string(folder.join(name).with_extension("hex")).expect("a corpus");
    let byte = |pair: &[u8]| {
        let digits = str::from_utf8(pair).expect("digits");
        u8::from_str_radix(digits, 16).expect("hexadecimal")
    };
    text.lines().map(|line| line.as_bytes().chunks(2).map(byte).collect()).collect()
}

#[test]
fn what_fuzzing_kept_is_borne_when_it_is_damaged() {
    let corpora = KEPT.map(corpus);
    Campaign { kind: "bytes", cases: 10_000 }.run(|rng| {
        let at = rng.random_range(0..TARGETS.len());
        let (name, target) = TARGETS[at];
        let [one, other] = [0, 1].map(|_| &corpora[at][rng.random_range(0..corpora[at].len())]);
        target(&damaged(rng, one, other));
        Ok(name)
    });
}
