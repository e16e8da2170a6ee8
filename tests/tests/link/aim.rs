//! Aim of a steered sensor over the link: checked, committed, and pointed at by its own program.

use echoloop_closed_loop::beams::Beams;
use echoloop_dsp::{Grid, Hardware, ParameterId, Reason, Refusal, ScanPattern, Settings, Steered};
use echoloop_frontend::{Analog, FrontEnd, Trigger};
use echoloop_link::Nack;
use echoloop_sensors::boards::pc::PcSensor;
use echoloop_sensors::client::{Client, ClientError, RetryPolicy};
use echoloop_sensors::transport::InProcess;

/// Front end that notes where each shot goes.
#[derive(Default)]
struct Noting {
    cell: u32,
    shots: Vec<(u32, u32)>,
}

impl FrontEnd for Noting {
    fn adc_bits(&self) -> u32 {
        12
    }

    fn steer(&mut self, cell: u32) {
        self.cell = cell;
    }

    fn capture(&mut self, _: &Analog, trigger: Trigger, codes: &mut [u16]) {
        self.shots.push((trigger.beam, self.cell));
        codes.fill(100);
    }
}

type Host = Client<InProcess<Noting>>;

fn host(pattern: ScanPattern) -> Host {
    let sensor = PcSensor::new(Noting::default(), pattern, Hardware::REFERENCE);
    Client::connect(InProcess(sensor), RetryPolicy::default()).expect("a sensor")
}

/// Small sensor of its own aim: 12 × 8 beams over 360° × 60°.
fn steered() -> ScanPattern {
    let mut own = Steered::REFERENCE;
    (own.aim.columns, own.aim.rows) = (12, 8);
    ScanPattern::Steered(own)
}

fn aim(set: &[(ParameterId, i32)]) -> Settings {
    let mut settings = Settings::default();
    set.iter().for_each(|&(id, value)| settings.set(id, Some(value)));
    settings
}

fn shots(host: &mut Host) -> Vec<(u32, u32)> {
    std::mem::take(&mut host.transport_mut().0.front_end_mut().shots)
}

#[test]
fn every_shot_goes_to_the_cell_that_the_host_expects() {
    let mut host = host(steered());
    for settings in [
        Settings::default(),
        aim(&[(ParameterId::AzimuthSpan, 9_000), (ParameterId::Tilt, -1_234)]),
        aim(&[(ParameterId::Columns, 31), (ParameterId::Rows, 3), (ParameterId::Shots, 4)]),
        aim(&[(ParameterId::AzimuthFovea, 700), (ParameterId::ElevationFovea, -300)]),
        Settings::default(),
    ] {
        host.configure(&settings).expect("an aim");
        let beams = Beams::new(steered());
        let beams = beams.aimed(&settings).expect("an aim");
        assert_eq!(host.pattern(), beams.pattern());
        assert_eq!(host.scan(1).expect("a scan").len(), beams.directions(1).len());
        let each = |(beam, cell): (u32, u32)| (0..settings.shots).map(move |_| (beam, cell));
        let expected: Vec<_> = (0..).zip(beams.cells()).flat_map(each).collect();
        assert_eq!(shots(&mut host), expected, "{settings:?}");
    }
}

#[test]
fn an_aim_that_is_refused_names_the_bound_and_leaves_the_one_before() {
    let mut host = host(steered());
    let narrow = aim(&[(ParameterId::AzimuthSpan, 9_000)]);
    host.configure(&narrow).expect("an aim");
    let (field, value) = (ParameterId::ElevationSpan, 9_001);
    match host.configure(&aim(&[(field, value)])) {
        Err(ClientError::Refused(refusal)) => {
            let reason = Reason::BeyondMount { most_cdeg: 9_000 };
            assert_eq!(refusal, Refusal { field, value, reason });
        }
        other => panic!("{other:?}"),
    }
    assert_eq!(host.read_settings().expect("settings"), narrow);
    host.scan(1).expect("a scan");
    let cells: Vec<u32> = shots(&mut host).into_iter().map(|(_, cell)| cell).collect();
    assert_eq!(cells, Beams::new(steered()).aimed(&narrow).expect("an aim").cells());
}

#[test]
fn a_sensor_that_is_not_steered_refuses_every_field_of_an_aim() {
    let pattern = ScanPattern::Grid(Grid { columns: 4, rows: 2, ..Grid::default() });
    let mut host = host(pattern);
    for field in ParameterId::AIM {
        let value = field.parameter().min;
        let refused = host.configure(&aim(&[(field, value)]));
        let expected = Refusal { field, value, reason: Reason::NotSteered };
        assert!(
            matches!(refused, Err(ClientError::Refused(refusal)) if refusal == expected),
            "{refused:?}"
        );
    }
    host.scan(1).expect("a scan");
    assert!(shots(&mut host).iter().all(|(_, cell)| *cell == 0), "nothing is steered");
}

#[test]
fn a_rolled_back_trial_points_where_the_settings_before_did() {
    let mut host = host(steered());
    let wide = aim(&[(ParameterId::Columns, 20)]);
    host.configure(&wide).expect("an aim");
    host.configure_on_trial(&aim(&[(ParameterId::Rows, 2)]), 1).expect("a trial");
    assert_eq!(host.scan(1).expect("a scan").len(), 24);
    assert!(matches!(host.scan(2), Err(ClientError::Mixed { .. })));
    assert_eq!(host.read_settings().expect("settings"), wide);
    assert_eq!(host.scan(3).expect("a scan").len(), 160);
}

#[test]
fn a_beam_beyond_the_aim_is_none_although_the_sensor_s_own_aim_has_it() {
    let mut host = host(steered());
    host.configure(&aim(&[(ParameterId::Rows, 1)])).expect("an aim");
    assert_eq!(host.scan(1).expect("a scan").len(), 12);
    let session = host.transport_mut().0.session().clone();
    assert_eq!(session.pattern().beams(), 12);
    let mut session = session;
    let ask = |first| echoloop_link::Command::ReadBeams { frame: 2, first, count: 1 };
    let nack = echoloop_link::Report::Nack(Nack::NoSuchBeams { beams: 12 });
    assert_eq!(session.handle(ask(12)), echoloop_link::Answer::Report(nack));
    assert!(matches!(session.handle(ask(11)), echoloop_link::Answer::Measure { .. }));
}
