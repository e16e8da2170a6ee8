//! Recorded conversations: a replay gives the same bytes.

use std::time::Duration;

use echoloop_dsp::{Grid, Hardware, ScanPattern, Settings};
use echoloop_sensors::boards::pc::PcSensor;
use echoloop_sensors::client::{Client, RetryPolicy};
use echoloop_sensors::size::scan_bits;
use echoloop_sensors::transport::InProcess;
use echoloop_tests::faults::Target;
use echoloop_tests::recording::{Conversation, Direction, Recording};

const ONCE: RetryPolicy = RetryPolicy { timeout: Duration::from_secs(1), tries: 1 };

fn sensor(columns: u16, rows: u16) -> InProcess<Target> {
    let pattern = ScanPattern::Grid(Grid { columns, rows, ..Grid::default() });
    InProcess(PcSensor::new(Target::default(), pattern, Hardware::REFERENCE))
}

/// A conversation with every kind of command.
fn talk() -> Conversation {
    let line = Recording::new(sensor(12, 8));
    let mut client = Client::connect_from(line, ONCE, 100).unwrap();
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
fn a_conversation_replayed_to_a_new_sensor_has_the_same_answers() {
    let recorded = talk();
    let again = recorded.replay(sensor(12, 8), Duration::ZERO).unwrap();
    assert_eq!(again.bytes(Direction::ToHost), recorded.bytes(Direction::ToHost));
    assert_eq!(again, recorded);
    assert!(recorded.pieces().count() > 20);
}

#[test]
fn a_replay_to_another_sensor_differs() {
    let recorded = talk();
    assert_ne!(recorded.replay(sensor(12, 9), Duration::ZERO).unwrap(), recorded);
}

/// Bits carried in both directions.
fn carried_bits(client: &mut Client<Recording<InProcess<Target>>>) -> u64 {
    let conversation = client.transport_mut().conversation();
    let ways = [Direction::ToSensor, Direction::ToHost];
    8 * ways.map(|way| conversation.bytes(way).len() as u64).iter().sum::<u64>()
}

#[test]
fn the_computed_bits_of_a_scan_are_those_on_the_line() {
    let line = Recording::new(sensor(48, 32));
    let mut client = Client::connect_from(line, ONCE, 0).unwrap();
    for settings in [Settings::default(), Settings { echoes: 4, ..Settings::default() }] {
        let hash = client.configure(&settings).unwrap();
        let before = carried_bits(&mut client);
        let scan = client.scan(1).unwrap();
        let carried = carried_bits(&mut client) - before;
        assert!(scan.iter().any(|echoes| !echoes.is_empty()), "there are echoes");
        let counted = scan_bits(&scan, hash);
        assert!(counted.abs_diff(carried) * 1_000 <= carried, "{counted} of {carried}");
    }
}
