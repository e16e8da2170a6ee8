//! The fuzz targets' bodies, on bytes that nobody chose and on every input that fuzzing kept.

use echoloop_tests::harness::{self, corpus};
use echoloop_tests::readers::READERS;
use proptest::collection::vec;
use proptest::prelude::{any, prop_oneof, proptest};

proptest! {
    #[test]
    fn what_a_decoder_accepts_it_accepts_again(
        bytes in vec(prop_oneof![0..12u8, any::<u8>()], 0..300),
    ) {
        harness::frame_decoder(&bytes);
    }

    #[test]
    fn after_any_garbage_the_next_whole_frame_is_understood(
        bytes in vec(prop_oneof![0..2u8, any::<u8>()], 0..5_000),
    ) {
        harness::resynchronises(&bytes);
    }

    #[test]
    fn a_sensor_bears_any_program(bytes in vec(any::<u8>(), 0..600)) {
        harness::session(&bytes);
    }

    #[test]
    fn a_flash_may_hold_anything(
        forged in 0..5u8,
        bytes in vec(prop_oneof![0..4u8, any::<u8>()], 0..520),
    ) {
        harness::store(&[&[forged], &bytes[..]].concat());
    }

    #[test]
    fn any_waveform_and_any_file_of_them_is_borne(
        kind in 0..2u8,
        bytes in vec(prop_oneof![0..4u8, any::<u8>()], 0..600),
    ) {
        harness::waveforms(&[&[kind], &bytes[..]].concat());
    }

    #[test]
    fn any_text_of_numbers_is_borne(
        text in "([-0-9.e]{0,6},{0,2}){0,60}(\\n([0-9]{1,4},){0,80}){0,4}",
    ) {
        harness::waveforms(&[&[2], text.as_bytes()].concat());
    }
}

#[test]
fn every_input_that_fuzzing_kept_still_holds() {
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
fn every_reader_takes_the_files_that_it_is_for() {
    for (name, read) in READERS {
        for (line, bytes) in corpus(name).iter().enumerate() {
            assert!(read(bytes), "line {line} of {name}.hex is refused");
        }
    }
}
