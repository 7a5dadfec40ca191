//! Executions a second of the fuzz bodies `detector` and `ring` beside an empty body, on the same inputs in the same run.
//! The inputs are conversations of ND21 9.2 to 9.8. What libFuzzer itself costs is not in it: for that run the target
//! `empty` beside the others.

use harness_sim::novobus::fuzz::{detector, ring};
use std::hint::black_box;
use std::io::Write as _;
use std::time::Instant;

const EXECUTIONS: u32 = 20_000;

/// A read, process data, a damaged byte, zeros and the check sequence, with the two bytes in front that `ring` takes.
fn inputs() -> [Vec<u8>; 3] {
    let telegrams: &[u8] = &[
        0x00, 0x09, 0x88, 0xFF, 0xC0, 0x13, 0xFE, 0xD1, 0x85, 0xFF, 0x12, 0x34, 0xA8, 0x82, 0x42,
        0x13, 0xFE,
    ];
    let recovery = harness_proto::novobus::check_sequence::CHECK_SEQUENCE;
    [
        telegrams.to_vec(),
        [telegrams, &recovery[..]].concat(),
        [telegrams, &recovery[..], &telegrams[2..]].concat(),
    ]
}

fn rate(body: impl Fn(&[u8])) -> f64 {
    let inputs = inputs();
    let start = Instant::now();
    for _ in 0..EXECUTIONS {
        inputs.iter().for_each(|input| body(black_box(input)));
    }
    f64::from(EXECUTIONS) * inputs.len() as f64 / start.elapsed().as_secs_f64()
}

fn main() -> std::io::Result<()> {
    let empty = rate(|input| {
        black_box(input);
    });
    let mut out = std::io::stdout().lock();
    writeln!(out, "empty    {empty:12.0} executions a second")?;
    for (name, rate) in [("detector", rate(detector)), ("ring", rate(ring))] {
        let percent = rate / empty * 100.0;
        writeln!(
            out,
            "{name:8} {rate:12.0} executions a second, {percent:.3} % of empty"
        )?;
    }
    Ok(())
}
