//! Damaged inputs of the fuzz corpora: frames, sessions, flashes, waveforms.

use echoloop_tests::harness::{self, corpus};
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

#[test]
fn damaged_inputs_of_the_corpora_keep_every_property() {
    let corpora = KEPT.map(corpus);
    Campaign { kind: "bytes", cases: 10_000 }.run(|rng| {
        let at = rng.random_range(0..TARGETS.len());
        let (name, target) = TARGETS[at];
        let [one, other] = [0, 1].map(|_| &corpora[at][rng.random_range(0..corpora[at].len())]);
        target(&damaged(rng, one, other));
        Ok(name)
    });
}
