//! Plays a scenario on a simulated ring, as a test of your own would.

use harness::{Scenario, Verdict};
use std::io::Write;

/// Every byte on the way is compared with what the manual says (ND21 10.1, 10.2).
const WRITE_BYTE: &str = "\
title A byte is written and read back
ring 2

write-byte 1 FF32 = 5A
read-byte 1 FF32 = 5A
";

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut out = std::io::stdout();
    let played = Scenario::parse("write-byte", WRITE_BYTE)?.play();
    assert_eq!(played.verdict(), Verdict::Passed, "{played}");

    // The manual's own example of a parity error on a ring of 100 drives (ND21 9.7).
    let played = Scenario::read("9.7-parity-error")?.play();
    writeln!(out, "{played}")?;
    assert_eq!(played.verdict(), Verdict::Passed);

    // A wrong drive fails, and the first line that was not met is named.
    let wrong = WRITE_BYTE.replace("ring 2\n", "ring 2\ndrive 1 deviates writes-ignored\n");
    let played = Scenario::parse("write-byte", &wrong)?.play();
    assert_eq!(played.verdict(), Verdict::Failed);
    writeln!(out, "{}", played.mismatch().unwrap_or_default())?;
    Ok(())
}

#[test]
fn the_example_holds() -> Result<(), Box<dyn std::error::Error>> {
    main()
}
