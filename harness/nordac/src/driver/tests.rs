//! The driver against simulated slaves, in virtual time.

mod any_slave;

use super::*;
use crate::simulate::{Bench, Setup, SlaveSetup};
use harness_bench::link::{AnyStimulus, DriveFault, Link, Moment, PlacedFault};
use harness_proto::nordac::pkw::Index;
use harness_proto::nordac::words::State;
use harness_proto::nordac::{Parameter, ParameterRef, PkwError};
use harness_sim::nordac::Stimulus;

fn slave(address: u8, ppo: PpoType, more: &[(u16, i64)]) -> SlaveSetup {
    let usual = [(1621, 2), (1202, 10), (1203, 10)];
    let all = usual.iter().chain(more);
    SlaveSetup {
        ppo,
        parameters: all
            .map(|(number, value)| {
                let parameter = Parameter::of(*number).expect("a parameter");
                (parameter, Index::default(), *value)
            })
            .collect(),
        ..SlaveSetup::new(address)
    }
}

fn bench(rate: BusRate, slaves: &[SlaveSetup]) -> Bench {
    Bench::new(&Setup::new(rate, slaves.to_vec()))
}

fn driver(bench: &mut Bench, rate: BusRate) -> Driver<'_> {
    Driver::new(Box::new(bench), Options::simulated(rate))
}

fn parameter(text: &str) -> ParameterRef {
    ParameterRef::parse(text).expect("a parameter")
}

/// 3.1, 3.3: at every rate and with every PPO type the slave starts, its type is asked for, and the motor turns at 50 %.
#[test]
fn a_motor_turns_at_every_rate_with_every_ppo_type() {
    for rate in BusRate::ALL {
        for ppo in PpoType::ALL {
            let mut bench = bench(rate, &[slave(8, ppo, &[])]);
            let mut driver = driver(&mut bench, rate);
            let started = driver.start(8, None).expect("a start");
            assert_eq!(
                (started.ppo, started.inputs.first()),
                (ppo, 0x0B70),
                "{rate:?}"
            );
            let on = driver.on(8, 0x2000).expect("on");
            assert_eq!(on.words().collect::<Vec<_>>(), [0x047E, 0x047F]);
            driver.run(Span::from_millis(1000)).expect("an exchange");
            let inputs = driver.inputs(8).expect("inputs");
            assert_eq!(
                (inputs.first(), inputs.main()),
                (0x0F37, 0x2000),
                "{rate:?}"
            );
            let off = driver.off(8).expect("off");
            assert_eq!(State::of_zsw(off.inputs.first()), Some(State::ReadyToStart));
            drop(driver);
            let drive = bench.drive(8).expect("the drive");
            assert_eq!(drive.slave().master(), Some(MASTER));
        }
    }
}

/// 3.4: values, sets and arrays; the errors of the manual, in its words and with what can be done.
#[test]
fn parameters_are_read_and_written() {
    let mut bench = bench(BusRate::K500, &[slave(8, PpoType::One, &[(1203, 77)])]);
    let mut driver = driver(&mut bench, BusRate::K500);
    driver.start(8, None).expect("a start");
    for (name, value) in [
        ("Decel. time", 77),
        ("1205.3", 700),
        ("1806.9", 0),
        ("965", 768),
    ] {
        assert_eq!(driver.read(8, &parameter(name)), Ok(value), "{name}");
    }
    let third = parameter("1205.3");
    assert_eq!(driver.write(8, &third, 500), Ok(WriteResult::Holds(500)));
    assert_eq!(driver.read(8, &third), Ok(500));
    assert_eq!(driver.read(8, &parameter("1205.2")), Ok(700));
    for (name, value, error, hint) in [
        (
            "1202",
            32001,
            PkwError::Limit,
            "the limits are 0.05 s and 1600.00 s",
        ),
        ("1800", 1, PkwError::ReadOnly, "it is read only"),
        ("1716", 1, PkwError::Number, "PosiCon"),
    ] {
        let found = driver.write(8, &parameter(name), value).expect_err(name);
        assert!(
            matches!(found, Error::Refused { error: refusal, .. } if refusal == error),
            "{found}"
        );
        assert!(found.to_string().contains(hint), "{found}");
    }
    let on = driver.on(8, 0).expect("on");
    assert_eq!(
        State::of_zsw(on.inputs.first()),
        Some(State::OperationEnabled)
    );
    let found = driver
        .write(8, &parameter("1621"), 0)
        .expect_err("while it runs");
    assert!(
        found.to_string().contains("only while the output is off"),
        "{found}"
    );
    drop(driver);
    let stored = bench.parameter(8, Parameter::of(1205), third.index);
    assert_eq!(stored, Some(500));
}

/// 2.6: a change of the PPO type or of the address restarts, and the slave is found again.
#[test]
fn a_slave_that_restarts() {
    let mut bench = bench(BusRate::K500, &[slave(8, PpoType::One, &[])]);
    let mut driver = driver(&mut bench, BusRate::K500);
    driver.start(8, None).expect("a start");
    for (name, value) in [("1622", 1), ("1624", 9)] {
        let written = driver.write(8, &parameter(name), value);
        assert_eq!(written, Ok(WriteResult::Restarted), "{name}");
        if name == "1622" {
            assert_eq!(driver.start(8, None).expect("again").ppo, PpoType::Two);
        }
    }
    assert!(matches!(
        driver.start(8, None),
        Err(Error::NoReply { slave: 8, .. })
    ));
    driver.start(9, None).expect("at its new address");
    // PPO2 carries double words, but PosiCon is not there.
    assert_eq!(driver.read(9, &parameter("1622")), Ok(1));
}

/// Two slaves exchange data beside each other, and a third is not there.
#[test]
fn several_slaves() {
    let slaves = [slave(8, PpoType::Two, &[]), slave(9, PpoType::Three, &[])];
    let mut bench = bench(BusRate::K1500, &slaves);
    let mut driver = driver(&mut bench, BusRate::K1500);
    driver.start(8, None).expect("a start");
    driver.on(8, 0x1000).expect("on");
    driver.start(9, None).expect("a start beside it");
    driver.on(9, 0x4000).expect("on");
    driver.run(Span::from_millis(1000)).expect("an exchange");
    let missing = driver.start(7, None).expect_err("no slave 7");
    assert!(
        missing
            .to_string()
            .starts_with("slave 7 does not answer Slave_Diag"),
        "{missing}"
    );
    driver.run(Span::from_millis(10)).expect("the others go on");
    let actual = [8, 9].map(|address| driver.inputs(address).expect("inputs").main());
    assert_eq!(actual, [0x1000, 0x4000]);
    let found = driver.read(9, &parameter("1202")).expect_err("PPO3");
    assert!(
        found
            .to_string()
            .contains("PPO3, which has no parameter channel"),
        "{found}"
    );
    driver.quick_stop(8).expect("a quick stop");
    let nine = driver.inputs(9).expect("inputs").main();
    assert_eq!(nine, 0x4000);
}

/// 5.7, 3.3 rules 12 and 13: a fault is named; acknowledging takes it away only when its cause is gone.
#[test]
fn a_fault_is_named_and_acknowledged() {
    let mut bench = bench(BusRate::K500, &[slave(8, PpoType::One, &[])]);
    let cause = |on| {
        let stimulus = Stimulus::Fault(3, on);
        PlacedFault::Stimulus(8, AnyStimulus::Nordac(stimulus))
    };
    bench.inject(
        0,
        cause(true),
        Moment::At(Instant::START + Span::from_millis(300)),
    );
    bench.inject(
        0,
        cause(false),
        Moment::At(Instant::START + Span::from_millis(4_000)),
    );
    let mut driver = driver(&mut bench, BusRate::K500);
    driver.start(8, None).expect("a start");
    assert_eq!(driver.acknowledge(8).expect("nothing to do").0, Some(0));
    driver.on(8, 0x1000).expect("on");
    driver.run(Span::from_millis(500)).expect("an exchange");
    let fault = driver.on(8, 0x1000).expect_err("a fault");
    assert_eq!(
        fault.to_string(),
        "slave 8 has a fault (3: overcurrent): remove its cause, then `drivebench acknowledge 8`"
    );
    let stays = driver.acknowledge(8).expect_err("the cause is there");
    assert!(
        stays
            .to_string()
            .starts_with("slave 8: no fault expected after STW 04FD"),
        "{stays}"
    );
    driver.run(Span::from_millis(4_000)).expect("an exchange");
    let (number, reached) = driver.acknowledge(8).expect("the cause is gone");
    assert_eq!(
        (number, State::of_zsw(reached.inputs.first())),
        (Some(3), Some(State::StartDisable))
    );
}

/// 5.5: with interface 0 the words are ignored, and the driver says what to write.
#[test]
fn a_slave_under_local_control() {
    let mut bench = bench(BusRate::K500, &[slave(8, PpoType::One, &[(1621, 0)])]);
    let mut driver = driver(&mut bench, BusRate::K500);
    driver.start(8, None).expect("a start");
    let error = driver.on(8, 0).expect_err("local");
    assert!(
        error.to_string().contains("write 8 Interface = 2"),
        "{error}"
    );
    let two = driver.write(8, &parameter("Interface"), 2);
    assert_eq!(two, Ok(WriteResult::Holds(2)));
    driver.on(8, 0).expect("the bus controls it");
}

/// A slave that loses its power while it exchanges data is noticed at once, and can be started again.
#[test]
fn a_slave_that_goes_away() {
    let mut bench = bench(BusRate::K500, &[slave(8, PpoType::One, &[])]);
    let at = |millis| Moment::At(Instant::START + Span::from_millis(millis));
    bench.inject(0, PlacedFault::Drive(8, DriveFault::Off), at(500));
    bench.inject(0, PlacedFault::Drive(8, DriveFault::On), at(1_000));
    let mut driver = driver(&mut bench, BusRate::K500);
    driver.start(8, None).expect("a start");
    let error = driver.run(Span::from_millis(2_000)).expect_err("it is off");
    assert!(
        error
            .to_string()
            .starts_with("slave 8 has left the exchange"),
        "{error}"
    );
    assert!(driver.now() < Instant::START + Span::from_millis(520));
    assert!(matches!(driver.start(8, None), Err(Error::NoReply { .. })));
    driver.run(Span::from_millis(1_000)).expect("time passes");
    driver.start(8, None).expect("it is back");
}

/// EN 2: a slave with another PPO type than it is asked for refuses the configuration.
#[test]
fn a_slave_with_another_configuration() {
    let mut bench = bench(BusRate::K500, &[slave(8, PpoType::One, &[])]);
    let mut driver = driver(&mut bench, BusRate::K500);
    let error = driver.start(8, Some(PpoType::Four)).expect_err("PPO1");
    assert!(
        error
            .to_string()
            .contains("Cfg_Fault, Prm_Req; it refuses the configuration F5 of PPO4"),
        "{error}"
    );
    driver.start(8, None).expect("with its own");
}

/// A slave that is lost beside another one gets no words any more: the master would start it again with the last ones.
#[test]
fn a_lost_slave_is_left_alone() {
    let slaves = [slave(8, PpoType::One, &[]), slave(9, PpoType::One, &[])];
    let mut bench = bench(BusRate::K500, &slaves);
    let at = |millis| Moment::At(Instant::START + Span::from_millis(millis));
    bench.inject(0, PlacedFault::Drive(8, DriveFault::Off), at(500));
    bench.inject(0, PlacedFault::Drive(8, DriveFault::On), at(600));
    let mut driver = driver(&mut bench, BusRate::K500);
    for address in [8, 9] {
        driver.start(address, None).expect("a start");
        driver.on(address, 0x1000).expect("on");
    }
    let error = driver.run(Span::from_millis(1_000)).expect_err("8 is off");
    assert!(matches!(error, Error::Left { slave: 8, .. }), "{error}");
    driver.run(Span::from_millis(1_000)).expect("9 goes on");
    assert_eq!(driver.inputs(9).expect("inputs").main(), 0x1000);
    drop(driver);
    let drive = bench.drive(8).expect("the drive");
    assert_eq!(drive.slave().master(), None, "it waits for Set_Prm");
    let mut driver = Driver::new(Box::new(&mut bench), Options::simulated(BusRate::K500));
    driver.start(8, None).expect("it is back");
}

/// EN 1: while another master sends, the bench sends nothing more.
#[test]
fn another_master_on_the_line() {
    use harness_sim::octet_segment::{Octet, Wish};
    let setup = Setup::new(BusRate::K500, vec![slave(8, PpoType::One, &[])]);
    let mut bench = Bench::with_guests(&setup, 1);
    let token = [0xDC, 3, 3].map(Octet::from).to_vec();
    let wish = Wish {
        ready: Instant::START + Span::from_millis(100),
        idle_bits: 33,
    };
    bench.client(1).expect("a guest").send(wish, token);
    let mut driver = driver(&mut bench, BusRate::K500);
    driver.start(8, None).expect("a start");
    let error = driver
        .run(Span::from_millis(500))
        .expect_err("another master");
    assert_eq!(error, Error::OtherMaster { station: 3 });
    assert!(driver.now() < Instant::START + Span::from_millis(110));
}
