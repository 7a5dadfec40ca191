//! Serves a ring of three drives to a controller under test, which connects over TCP in place of its serial port.

use harness::{Error, Served};
use std::io::{Read, Write};
use std::net::TcpStream;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut out = std::io::stdout();
    let served = Served::ring(3, "", "127.0.0.1:0")?;
    writeln!(out, "the controller connects to {}", served.address())?;

    // In place of the controller: the byte 80, SYNCO (ND21 9.2), comes back through all drives as it is.
    let mut controller = TcpStream::connect(served.address())?;
    controller.write_all(&[0x80])?;
    let mut answer = [0];
    controller.read_exact(&mut answer)?;
    assert_eq!(answer, [0x80]);

    // A mistake in the setup of the drives is named with its line.
    let wrong = Served::ring(3, "drive 7 deviates writes-ignored", "127.0.0.1:0");
    assert!(matches!(wrong, Err(Error::Mistake(_))), "{wrong:?}");
    Ok(())
}

#[test]
fn the_example_holds() -> Result<(), Box<dyn std::error::Error>> {
    main()
}
