//! Properties under test, with a seed that a failure prints.

use proptest::strategy::Strategy;
use proptest::test_runner::{Config, RngSeed, TestRunner};

/// Runs a property; a failure prints the seed and the command that repeats it.
pub(super) fn property<S: Strategy>(name: &str, strategy: &S, test: impl Fn(S::Value)) {
    let seed = std::env::var("DRIVEBENCH_SEED").ok();
    let seed = seed.and_then(|seed| seed.parse().ok()).unwrap_or(7_531);
    let config = Config {
        rng_seed: RngSeed::Fixed(seed),
        failure_persistence: None,
        ..Config::default()
    };
    let outcome = TestRunner::new(config).run(strategy, |value| {
        test(value);
        Ok(())
    });
    if let Err(error) = outcome {
        panic!(
            "{error}\nrepeat with: DRIVEBENCH_SEED={seed} cargo test -p harness-sim --lib {name}"
        );
    }
}
