//! Saved settings and power cuts: after a cut anywhere, the old settings or the new are there,
//! never none, never a mix.

use std::time::Duration;

use echoloop_dsp::settings::PARAMETERS;
use echoloop_dsp::{Grid, Hardware, ScanPattern, Settings};
use echoloop_link::{Nack, SETTINGS_SCHEMA, checksum};
use echoloop_sensor::store::{MAGIC, RECORD, Saved, StoreError, forget, load, save};
use echoloop_sensors::boards::nor_flash::RamNorFlash;
use echoloop_sensors::boards::pc::PcSensor;
use echoloop_sensors::client::{Client, ClientError, RetryPolicy};
use echoloop_sensors::transport::InProcess;
use echoloop_tests::faults::Target;
use echoloop_tests::vectors;
use embedded_storage::nor_flash::NorFlash;
use rand::RngExt;

const HARDWARE: Hardware = Hardware::REFERENCE;

/// Settings of step `i`; neighbouring steps also differ in encoded length.
fn set(i: i32) -> Settings {
    Settings {
        gain_cdb: i % 4_000 - 1_000,
        min_separation_mm: (i % 3 == 0).then_some(500 + i % 100),
        ..Settings::default()
    }
}

/// A flash that was saved to `times` times.
fn worn<const W: usize, const E: usize>(times: i32) -> RamNorFlash<W, E> {
    let mut flash = RamNorFlash::from_bytes(vec![0xFF; 2 * E.max(RECORD)]);
    for i in 1..=times {
        assert_eq!(save(&mut flash, &HARDWARE, &set(i)), Ok(i as u32));
    }
    flash
}

fn settings<S: NorFlash>(flash: &mut S) -> Option<Settings> {
    load(flash, &HARDWARE).map(|saved| saved.settings)
}

/// Length of a record with its checksum.
fn used(slot: &[u8]) -> usize {
    20 + u32::from_le_bytes(slot[16..20].try_into().unwrap()) as usize + 4
}

/// Changes a record and corrects its checksum.
fn forge(slot: &mut [u8], change: impl FnOnce(&mut [u8])) {
    change(slot);
    let end = used(slot) - 4;
    let sum = checksum(&slot[..end]);
    slot[end..end + 4].copy_from_slice(&sum.to_le_bytes());
}

/// Cuts the power in every word and every erased block of a save, then in another save, which has
/// to clean up. Returns the number of cuts.
fn cut_everywhere<const W: usize, const E: usize>() -> usize {
    let mut cuts = 0;
    for times in 0..3 {
        let old = (times > 0).then(|| set(times));
        let (new, newer) = (set(100), set(200));
        for (seed, step) in
            (0..16).flat_map(|seed| (0..RECORD / W + 8).map(move |step| (seed, step)))
        {
            let mut flash = worn::<W, E>(times);
            flash.cut_after(step, seed);
            if save(&mut flash, &HARDWARE, &new).is_ok() {
                continue;
            }
            cuts += 1;
            flash.switch_on();
            let found = settings(&mut flash);
            assert!(
                found == old || found == Some(new),
                "{times} saves, cut in step {step}, seed {seed}: {found:?}"
            );
            flash.cut_after(step, seed + 1);
            assert_eq!(save(&mut flash, &HARDWARE, &newer), Err(StoreError::Flash));
            flash.switch_on();
            let again = settings(&mut flash);
            assert!(
                again == found || again == Some(newer),
                "twice in step {step}, seed {seed}: {again:?}"
            );
            save(&mut flash, &HARDWARE, &newer).unwrap();
            assert_eq!(settings(&mut flash), Some(newer));
        }
    }
    cuts
}

#[test]
fn a_power_cut_anywhere_in_a_save_leaves_the_old_settings_or_the_new() {
    // Words of 1 to 32 bytes; slots of one block and of several.
    let cuts = [
        cut_everywhere::<1, 256>(),
        cut_everywhere::<4, 256>(),
        cut_everywhere::<8, 2048>(),
        cut_everywhere::<16, 128>(),
        cut_everywhere::<4, 64>(),
        cut_everywhere::<32, 32>(),
    ];
    println!("cuts: {cuts:?}");
    // One step for each block erased and word written; from three states, torn in sixteen ways.
    assert_eq!(cuts, [1 + 256, 1 + 64, 1 + 32, 2 + 16, 4 + 64, 8 + 8].map(|steps| 3 * 16 * steps));
}

#[test]
fn a_power_cut_anywhere_in_a_forget_leaves_the_newest_settings_or_none() {
    for (times, steps, seed) in
        (0..4).flat_map(|t| (0..4).flat_map(move |s| (0..64).map(move |seed| (t, s, seed))))
    {
        let mut flash = worn::<4, 256>(times);
        let old = settings(&mut flash);
        flash.cut_after(steps, seed);
        let done = forget(&mut flash, &HARDWARE);
        flash.switch_on();
        let found = settings(&mut flash);
        assert!(
            found.is_none() || (found == old && done.is_err()),
            "{times} saves, cut in step {steps}: {found:?}"
        );
        forget(&mut flash, &HARDWARE).unwrap();
        assert_eq!(settings(&mut flash), None);
        let erased = flash.blocks_erased();
        forget(&mut flash, &HARDWARE).unwrap();
        assert_eq!(flash.blocks_erased(), erased, "a second forget erases nothing");
    }
}

#[test]
fn saved_settings_survive_many_power_cuts() {
    let mut rng = vectors::rng(31);
    let mut flash = RamNorFlash::<4, 256>::default();
    let (mut old, mut cut) = (None, 0);
    for i in 0..20_000 {
        let new = set(rng.random_range(0..4_000));
        flash.cut_after(rng.random_range(0..120), i);
        let saved = save(&mut flash, &HARDWARE, &new).is_ok();
        flash.switch_on();
        let found = settings(&mut flash);
        assert!(found == Some(new) || (!saved && found == old), "save {i}: {found:?}");
        cut += usize::from(!saved);
        old = found;
    }
    assert!((5_000..15_000).contains(&cut), "{cut}");
}

#[test]
fn any_flipped_bit_in_a_slot_leaves_the_other() {
    for (slot, other) in [(0, set(2)), (1, set(3))] {
        let whole = worn::<4, 256>(3); // set(3) in the first slot, set(2) in the second
        let used = used(&whole.bytes()[256 * slot..]);
        for bit in 0..8 * used {
            let mut flash = whole.clone();
            flash.bytes_mut()[256 * slot + bit / 8] ^= 1 << (bit % 8);
            assert_eq!(settings(&mut flash), Some(other), "bit {bit} of slot {slot}");
        }
        for bit in 8 * used..8 * 256 {
            let mut flash = whole.clone();
            flash.bytes_mut()[256 * slot + bit / 8] ^= 1 << (bit % 8);
            assert_eq!(settings(&mut flash), Some(set(3)), "unused bit {bit} of slot {slot}");
        }
    }
}

#[test]
fn a_slot_without_a_valid_record_is_ignored() {
    let whole = worn::<4, 256>(1);
    type Change = fn(&mut [u8]);
    let changes: [(&str, Change); 5] = [
        ("as it was", |_| {}),
        ("magic", |slot| slot[0] ^= 1),
        ("schema", |slot| slot[4..12].copy_from_slice(&(SETTINGS_SCHEMA ^ 1).to_le_bytes())),
        ("a byte too many", |slot| slot[16] += 1),
        ("a byte too few", |slot| slot[16] -= 1),
    ];
    for (name, change) in changes {
        let mut flash = whole.clone();
        forge(&mut flash.bytes_mut()[..256], change);
        assert_eq!(settings(&mut flash), (name == "as it was").then(|| set(1)), "{name}");
    }
    for length in [RECORD as u32 - 23, RECORD as u32, u32::MAX] {
        let mut flash = whole.clone();
        flash.bytes_mut()[16..20].copy_from_slice(&length.to_le_bytes());
        assert_eq!(settings(&mut flash), None, "length {length}");
    }
    assert_eq!(whole.bytes()[..4], MAGIC);
    assert_eq!(settings(&mut RamNorFlash::<4, 256>::from_bytes(vec![0; 512])), None);
}

#[test]
fn settings_that_this_hardware_refuses_are_ignored() {
    let mut flash = worn::<4, 256>(1);
    let strong = Settings { power_uw: 100_000_000, pulse_width_ps: 8_000, ..Settings::default() };
    let strong_hardware = Hardware { energy_limit_pj: 1_000_000, ..HARDWARE };
    save(&mut flash, &strong_hardware, &strong).unwrap();
    assert_eq!(load(&mut flash, &strong_hardware).map(|s| s.settings), Some(strong));
    assert_eq!(settings(&mut flash), Some(set(1)));
}

#[test]
fn a_thousand_saves_wear_both_slots_alike() {
    let mut flash = RamNorFlash::<4, 256>::default();
    let mut last = [0; 2];
    for i in 1..=3_000 {
        save(&mut flash, &HARDWARE, &set(i)).unwrap();
        assert_eq!(
            load(&mut flash, &HARDWARE),
            Some(Saved { revision: i as u32, settings: set(i) })
        );
        last[(i as usize + 1) % 2] = i;
        for (slot, expected) in
            flash.bytes().chunks(256).zip(last).filter(|(_, expected)| *expected > 0)
        {
            assert_eq!(slot[12..16], expected.to_le_bytes(), "after save {i}");
        }
    }
    assert_eq!(flash.blocks_erased(), 3_000);
}

#[test]
fn revisions_wrap_around() {
    let mut flash = worn::<4, 256>(2);
    forge(&mut flash.bytes_mut()[..256], |slot| {
        slot[12..16].copy_from_slice(&(u32::MAX - 1).to_le_bytes())
    });
    forge(&mut flash.bytes_mut()[256..], |slot| {
        slot[12..16].copy_from_slice(&u32::MAX.to_le_bytes())
    });
    for (i, revision) in [(10, 0), (11, 1), (12, 2)] {
        assert_eq!(save(&mut flash, &HARDWARE, &set(i)), Ok(revision));
        assert_eq!(load(&mut flash, &HARDWARE), Some(Saved { revision, settings: set(i) }));
    }
}

#[test]
fn saved_settings_are_not_written_again() {
    let mut flash = worn::<4, 256>(5);
    let (erased, written) = (flash.blocks_erased(), flash.words_written());
    for _ in 0..100 {
        assert_eq!(save(&mut flash, &HARDWARE, &set(5)), Ok(5));
    }
    assert_eq!((flash.blocks_erased(), flash.words_written()), (erased, written));
}

#[test]
fn a_flash_without_room_for_two_slots_saves_nothing() {
    let mut flash = RamNorFlash::<4, 256>::from_bytes(vec![0xFF; 256]);
    let small = StoreError::TooSmall { capacity: 256, needed: 512 };
    assert_eq!(save(&mut flash, &HARDWARE, &set(1)), Err(small));
    assert_eq!(small.to_string(), "two slots take 512 bytes of the flash's 256");
    assert_eq!(flash.words_written(), 0);
    assert_eq!(settings(&mut flash), None);
}

#[test]
fn the_widest_settings_fit_a_record() {
    let mut widest = Settings::default();
    PARAMETERS.iter().for_each(|p| widest.set(p.id, Some(i32::MIN)));
    let mut flash = RamNorFlash::<4, 256>::default();
    // They do not pass the check, so they are written and never loaded.
    assert_eq!(save(&mut flash, &HARDWARE, &widest), Ok(1));
    assert_eq!(used(flash.bytes()), 20 + 149 + 4);
    assert_eq!(settings(&mut flash), None);
}

fn switch_on(store: RamNorFlash) -> Client<InProcess<Target>> {
    let sensor = PcSensor::with_store(Target::default(), pattern(), HARDWARE, store);
    Client::connect_from(InProcess(sensor), retry_policy(), 0).unwrap()
}

fn pattern() -> ScanPattern {
    ScanPattern::Grid(Grid { columns: 2, rows: 2, ..Grid::default() })
}

fn retry_policy() -> RetryPolicy {
    RetryPolicy { timeout: Duration::from_secs(1), tries: 1 }
}

fn switch_off(client: &mut Client<InProcess<Target>>) -> RamNorFlash {
    client.transport_mut().0.store_mut().clone()
}

#[test]
fn a_sensor_starts_with_the_saved_settings_only() {
    let mut client = switch_on(RamNorFlash::default());
    client.configure(&set(1)).unwrap();
    assert_eq!(client.save().unwrap(), 1);
    assert_eq!(client.save().unwrap(), 1);
    client.configure(&set(2)).unwrap();
    let mut client = switch_on(switch_off(&mut client));
    assert_eq!(client.read_settings().unwrap(), set(1), "set(2) was not saved");
    client.forget().unwrap();
    assert_eq!(client.read_settings().unwrap(), set(1), "active settings stay");
    let mut client = switch_on(switch_off(&mut client));
    assert_eq!(client.read_settings().unwrap(), Settings::default());
}

#[test]
fn a_trial_can_be_saved_after_its_confirmation() {
    let mut client = switch_on(RamNorFlash::default());
    client.configure_on_trial(&set(1), 2).unwrap();
    assert!(matches!(client.save(), Err(ClientError::Nack(Nack::OnTrial))));
    client.scan(1).unwrap();
    client.confirm().unwrap();
    client.save().unwrap();
    client.configure_on_trial(&set(2), 2).unwrap();
    let mut client = switch_on(switch_off(&mut client));
    assert_eq!(client.read_settings().unwrap(), set(1), "a trial does not outlive the power");
}

#[test]
fn a_power_cut_in_a_save_over_the_link_leaves_a_sensor_with_the_old_settings_or_the_new() {
    for step in 0..40 {
        let mut client = switch_on(worn(3));
        client.configure(&set(4)).unwrap();
        client.transport_mut().0.store_mut().cut_after(step, 1);
        let saved = client.save();
        let mut flash = switch_off(&mut client);
        flash.switch_on();
        let mut client = switch_on(flash);
        let found = client.read_settings().unwrap();
        match saved {
            Ok(revision) => assert_eq!((revision, found), (4, set(4))),
            Err(ClientError::Nack(Nack::Storage)) => {
                assert!(found == set(3) || found == set(4), "step {step}")
            }
            Err(other) => panic!("{other}"),
        }
    }
}

#[test]
fn a_broken_flash_does_not_stop_the_sensor() {
    let mut client = switch_on(worn(3));
    client.transport_mut().0.store_mut().cut_after(0, 1);
    client.configure(&set(4)).unwrap();
    for _ in 0..2 {
        assert!(matches!(client.save(), Err(ClientError::Nack(Nack::Storage))));
        assert!(matches!(client.forget(), Err(ClientError::Nack(Nack::Storage))));
    }
    assert_eq!(client.read_settings().unwrap(), set(4));
    assert_eq!(client.scan(1).unwrap().len(), 4);
}

#[test]
fn with_both_slots_bad_the_sensor_starts_with_the_defaults() {
    let mut flash = worn(3);
    flash.bytes_mut()[30] ^= 0x10;
    flash.bytes_mut()[256 + 30] ^= 0x10;
    let mut client = switch_on(flash);
    assert_eq!(client.read_settings().unwrap(), Settings::default());
    client.configure(&set(5)).unwrap();
    client.save().unwrap();
    let mut client = switch_on(switch_off(&mut client));
    assert_eq!(client.read_settings().unwrap(), set(5));
}
