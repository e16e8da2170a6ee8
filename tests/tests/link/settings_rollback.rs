//! Settings on trial over the link: kept when the host confirms them, rolled back otherwise.

use std::time::Duration;

use echoloop_dsp::{Grid, Hardware, ScanPattern, Settings};
use echoloop_sensors::boards::pc::PcSensor;
use echoloop_sensors::client::{Client, ClientError, RetryPolicy};
use echoloop_sensors::transport::InProcess;
use echoloop_tests::faults::{Faulty, Rates, Target};

type Host = Client<Faulty<InProcess<Target>>>;

fn host() -> Host {
    let pattern = ScanPattern::Grid(Grid { columns: 12, rows: 8, ..Grid::default() });
    let sensor = PcSensor::new(Target::default(), pattern, Hardware::REFERENCE);
    let retry_policy = RetryPolicy { timeout: Duration::from_secs(1), tries: 2 };
    Client::connect_from(Faulty::new(InProcess(sensor), 1), retry_policy, 0).unwrap()
}

fn gain(gain_cdb: i32) -> Settings {
    Settings { gain_cdb, ..Settings::default() }
}

fn active(host: &mut Host) -> i32 {
    host.transport_mut().inner.0.session().settings().gain_cdb
}

#[test]
fn a_confirmed_trial_stays_through_scans_and_new_programs() {
    let mut host = host();
    host.configure_on_trial(&gain(100), 2).unwrap();
    (1..=2).for_each(|frame| assert_eq!(host.scan(frame).unwrap().len(), 96));
    host.confirm().unwrap();
    host.confirm().unwrap();
    (3..=9).for_each(|frame| assert_eq!(host.scan(frame).unwrap().len(), 96));
    assert_eq!(active(&mut host), 100);
    assert_eq!(host.read_counters().unwrap().rollbacks, 0);
}

#[test]
fn the_scan_after_the_end_of_a_trial_reports_the_change_of_settings() {
    let mut host = host();
    host.configure(&gain(50)).unwrap();
    host.configure_on_trial(&gain(100), 2).unwrap();
    host.scan(1).unwrap();
    host.scan(2).unwrap();
    assert!(matches!(host.scan(3), Err(ClientError::Mixed { frame: 3, .. })));
    assert_eq!(active(&mut host), 50);
    for _ in 0..2 {
        assert!(
            matches!(host.confirm(), Err(ClientError::Changed { .. })),
            "a repeated confirmation is late, too"
        );
        assert!(matches!(host.save(), Err(ClientError::Changed { .. })));
    }
    assert_eq!(host.read_settings().unwrap(), gain(50));
    assert_eq!(host.scan(4).unwrap().len(), 96);
    assert_eq!(host.read_counters().unwrap().rollbacks, 1);
}

#[test]
fn settings_that_blind_the_sensor_are_rolled_back_after_one_scan() {
    let mut host = host();
    host.configure_on_trial(&gain(-1_000), 100).unwrap();
    assert!(host.scan(1).unwrap().iter().all(|echoes| echoes.is_empty()));
    assert!(matches!(host.scan(2), Err(ClientError::Mixed { .. })));
    assert_eq!(host.read_settings().unwrap(), gain(0));
    assert!(host.scan(3).unwrap().iter().all(|echoes| echoes.len() == 1));
}

#[test]
fn unconfirmed_candidates_can_follow_each_other() {
    let mut host = host();
    for step in 1..20 {
        host.configure_on_trial(&gain(step), 1).unwrap();
        host.scan(step as u32).unwrap();
    }
    host.configure(&gain(500)).unwrap();
    assert_eq!(host.read_settings().unwrap(), gain(500));
    assert_eq!(host.read_counters().unwrap().rollbacks, 19);
}

#[test]
fn the_host_notices_a_lost_confirmation_and_a_lost_answer() {
    for seed in 0..200 {
        let mut host = host();
        host.configure_on_trial(&gain(100), 2).unwrap();
        host.scan(1).unwrap();
        *host.transport_mut() = {
            let inner = std::mem::replace(&mut host.transport_mut().inner, host_line());
            let mut line = Faulty::new(inner, seed);
            line.rates = Rates { drop: 0.7, ..Rates::NONE };
            line
        };
        let first = host.confirm();
        host.transport_mut().rates = Rates::NONE;
        match (first, host.confirm()) {
            (_, Ok(())) => assert_eq!(active(&mut host), 100, "seed {seed}"),
            (Err(ClientError::Silent { .. }), Err(ClientError::Changed { .. })) => {
                assert_eq!(
                    active(&mut host),
                    0,
                    "seed {seed}: the confirmation was lost, and the hello ended the trial"
                );
            }
            other => panic!("seed {seed}: {other:?}"),
        }
    }
}

fn host_line() -> InProcess<Target> {
    InProcess(PcSensor::new(Target::default(), ScanPattern::default(), Hardware::REFERENCE))
}
