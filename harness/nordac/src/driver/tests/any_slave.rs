//! The driver against every slave that the manual allows, and against slaves that break it.

use super::*;
use crate::rig::values;
use harness_proto::nordac::properties::PROPERTIES;
use harness_sim::nordac::deviation::DEVIATIONS;

/// A low rate: a slave is judged by its telegrams, and fewer of them take as long.
const RATE: BusRate = BusRate::K93_75;

/// More than any call may take: 40 exchanges of each of a few hundred telegrams.
const LONGEST: Span = Span::from_millis(60_000);

/// Ramps of 0.05 s.
const RAMPS: [(u16, i64); 2] = [(1202, 1), (1203, 1)];

/// Everything that the commands do with a slave, as far as it gets.
fn all_calls(driver: &mut Driver<'_>) -> Vec<Result<(), Error>> {
    let started = driver.start(8, None).map(drop);
    if started.is_err() {
        return vec![started];
    }
    let accel = parameter("1202");
    vec![
        started,
        driver.read(8, &accel).map(drop),
        driver.write(8, &parameter("1205.3"), 500).map(drop),
        driver.on(8, 0x2000).map(drop),
        driver.run(Span::from_millis(100)),
        driver.read(8, &parameter("1813")).map(drop),
        driver.quick_stop(8).map(drop),
        driver.on(8, 0xE000).map(drop),
        driver.off(8).map(drop),
        driver.on(8, 0x1000).map(drop),
        driver.block(8).map(drop),
        driver.acknowledge(8).map(drop),
    ]
}

/// 11: whatever the manual leaves open, each call succeeds.
#[test]
fn every_value_of_every_property() {
    for property in PROPERTIES {
        for value in values(property) {
            let mut setup = slave(8, PpoType::One, &RAMPS);
            assert!(property.set(&mut setup.properties, &value), "{value}");
            let mut bench = bench(RATE, &[setup]);
            let mut driver = driver(&mut bench, RATE);
            let name = property.name;
            // The slave does not answer the first telegram; the driver asks again.
            for (place, result) in all_calls(&mut driver).into_iter().enumerate() {
                assert_eq!(result, Ok(()), "{name} = {value}, call {place}");
            }
        }
    }
}

/// Slaves that break the standard or the manual: each call ends, with success or with an error, and nothing panics.
#[test]
fn every_deviation_ends() {
    let mut troubled = 0;
    for deviation in DEVIATIONS.all() {
        let setup = SlaveSetup {
            deviation: Some(deviation),
            ..slave(8, PpoType::One, &RAMPS)
        };
        let mut bench = bench(RATE, &[setup]);
        let mut driver = driver(&mut bench, RATE);
        let results = all_calls(&mut driver);
        let end = Instant::START + LONGEST;
        assert!(driver.now() < end, "{}: {results:?}", deviation.name);
        troubled += usize::from(results.iter().any(Result::is_err));
    }
    // Most deviations show in no call of a master that does nothing wrong.
    assert!(troubled >= 20, "{troubled}");
}
