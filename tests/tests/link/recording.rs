//! A conversation that was recorded is the same bytes when it is said again.

use std::time::Duration;

use echoloop_dsp::{Grid, Hardware, ScanPattern, Settings};
use echoloop_sensors::boards::pc::PcSensor;
use echoloop_sensors::client::{Client, RetryPolicy};
use echoloop_sensors::size::scan_bits;
use echoloop_sensors::transport::{Conversation, Direction, InProcess, Recording};
use echoloop_tests::faults::Target;

fn sensor() -> InProcess<Target> {
    let pattern = ScanPattern::Grid(Grid { columns: 12, rows: 8, ..Grid::default() });
    InProcess(PcSensor::new(Target::default(), pattern, Hardware::REFERENCE))
}

/// Everything that may be said.
fn talk() -> Conversation {
    let retry_policy = RetryPolicy { timeout: Duration::from_secs(1), tries: 1 };
    let mut client = Client::connect_from(Recording::new(sensor()), retry_policy, 100).unwrap();
    client.scan(1).unwrap();
    client.configure(&Settings { gain_cdb: 100, ..Settings::default() }).unwrap();
    client.configure_on_trial(&Settings { gain_cdb: 200, ..Settings::default() }, 2).unwrap();
    client.scan(2).unwrap();
    client.confirm().unwrap();
    client.save().unwrap();
    client.configure(&Settings { gain_cdb: 9_999, ..Settings::default() }).unwrap_err();
    client.forget().unwrap();
    client.read_counters().unwrap();
    client.transport_mut().conversation().clone()
}

#[test]
fn a_recorded_conversation_said_again_to_a_new_sensor_has_the_same_answers() {
    let recorded = talk();
    let again = recorded.replay(sensor(), Duration::ZERO).unwrap();
    assert_eq!(again.bytes(Direction::ToHost), recorded.bytes(Direction::ToHost));
    assert_eq!(again, recorded);
    assert!(recorded.pieces().count() > 20);
}

#[test]
fn a_sensor_that_does_something_else_is_found_out() {
    let recorded = talk();
    let pattern = ScanPattern::Grid(Grid { columns: 12, rows: 9, ..Grid::default() });
    let other = InProcess(PcSensor::new(Target::default(), pattern, Hardware::REFERENCE));
    assert_ne!(recorded.replay(other, Duration::ZERO).unwrap(), recorded);
}

/// Both ways, so far.
fn carried_bits(client: &mut Client<Recording<InProcess<Target>>>) -> u64 {
    let conversation = client.transport_mut().conversation();
    let ways = [Direction::ToSensor, Direction::ToHost];
    8 * ways.map(|way| conversation.bytes(way).len() as u64).iter().sum::<u64>()
}

#[test]
fn the_bits_of_a_scan_are_those_that_went_over_the_line() {
    let retry_policy = RetryPolicy { timeout: Duration::from_secs(1), tries: 1 };
    let pattern = ScanPattern::Grid(Grid { columns: 48, rows: 32, ..Grid::default() });
    let line = InProcess(PcSensor::new(Target::default(), pattern, Hardware::REFERENCE));
    let mut client = Client::connect_from(Recording::new(line), retry_policy, 0).unwrap();
    for settings in [Settings::default(), Settings { echoes: 4, ..Settings::default() }] {
        let hash = client.configure(&settings).unwrap();
        let before = carried_bits(&mut client);
        let scan = client.scan(1).unwrap();
        let carried = carried_bits(&mut client) - before;
        assert!(scan.iter().any(|echoes| !echoes.is_empty()), "there is something to tell");
        let counted = scan_bits(&scan, hash);
        assert!(counted.abs_diff(carried) * 1_000 <= carried, "{counted} of {carried}");
    }
}
