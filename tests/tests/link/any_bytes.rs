//! The fuzz targets on random bytes and on their corpora.

use echoloop_tests::harness::{self, corpus};
use echoloop_tests::readers::READERS;
use proptest::collection::vec;
use proptest::prelude::{any, prop_oneof, proptest};

proptest! {
    #[test]
    fn an_accepted_message_decodes_again_as_it_was(
        bytes in vec(prop_oneof![0..12u8, any::<u8>()], 0..300),
    ) {
        harness::frame_decoder(&bytes);
    }

    #[test]
    fn the_next_whole_frame_after_any_garbage_is_decoded(
        bytes in vec(prop_oneof![0..2u8, any::<u8>()], 0..5_000),
    ) {
        harness::resynchronises(&bytes);
    }

    #[test]
    fn a_sensor_keeps_its_properties_in_any_session(bytes in vec(any::<u8>(), 0..600)) {
        harness::session(&bytes);
    }

    #[test]
    fn a_store_keeps_its_properties_in_any_flash(
        forged in 0..5u8,
        bytes in vec(prop_oneof![0..4u8, any::<u8>()], 0..520),
    ) {
        harness::store(&[&[forged], &bytes[..]].concat());
    }

    #[test]
    fn any_waveform_is_processed(
        kind in 0..2u8,
        bytes in vec(prop_oneof![0..4u8, any::<u8>()], 0..600),
    ) {
        harness::waveforms(&[&[kind], &bytes[..]].concat());
    }

    #[test]
    fn any_text_of_numbers_is_processed(
        text in "([-0-9.e]{0,6},{0,2}){0,60}(\\n([0-9]{1,4},){0,80}){0,4}",
    ) {
        harness::waveforms(&[&[2], text.as_bytes()].concat());
    }
}

#[test]
fn every_input_of_the_corpora_keeps_its_properties() {
    type Target = fn(&[u8]);
    let targets: [(&str, Target); 4] = [
        ("frame_decoder", harness::frame_decoder),
        ("session", harness::session),
        ("store", harness::store),
        ("waveforms", harness::waveforms),
    ];
    for (name, target) in targets {
        let kept = corpus(name);
        assert!(kept.len() > 50, "{name}");
        kept.iter().for_each(|bytes| target(bytes));
    }
}

#[test]
fn every_reader_accepts_the_files_of_its_corpus() {
    for (name, read) in READERS {
        for (line, bytes) in corpus(name).iter().enumerate() {
            assert!(read(bytes), "line {line} of {name}.hex is refused");
        }
    }
}
