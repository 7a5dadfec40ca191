//! A PROFIBUS master over profirust: brings slave 8 of a served segment into the exchange and turns its motor at 50 %.

use profirust::{Baudrate, dp, fdl, phy::ProfibusPhy, time};
use std::io::{self, ErrorKind, Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

/// A socket in place of a serial port.
struct Socket {
    stream: TcpStream,
    received: Vec<u8>,
    broken: Option<io::Error>,
}

impl ProfibusPhy for Socket {
    fn poll_transmission(&mut self, _now: time::Instant) -> bool {
        false
    }

    fn transmit_data<F, R>(&mut self, _now: time::Instant, f: F) -> R
    where
        F: FnOnce(&mut [u8]) -> (usize, R),
    {
        let mut buffer = [0; 256];
        let (length, result) = f(&mut buffer);
        if let Err(error) = self.stream.write_all(&buffer[..length]) {
            self.broken = Some(error);
        }
        result
    }

    fn receive_data<F, R>(&mut self, _now: time::Instant, f: F) -> R
    where
        F: FnOnce(&[u8]) -> (usize, R),
    {
        let mut buffer = [0; 256];
        match self.stream.read(&mut buffer) {
            Ok(0) => self.broken = Some(ErrorKind::UnexpectedEof.into()),
            Ok(length) => self.received.extend_from_slice(&buffer[..length]),
            Err(error) if error.kind() == ErrorKind::WouldBlock => {}
            Err(error) => self.broken = Some(error),
        }
        let (used, result) = f(&self.received);
        self.received.drain(..used);
        result
    }
}

/// Turns the motor at 50 %, and returns the status word and the main actual value that show it.
pub(crate) fn turn(address: &str) -> io::Result<(u16, u16)> {
    let stream = TcpStream::connect(address)?;
    stream.set_nodelay(true)?;
    stream.set_nonblocking(true)?;
    let (received, broken) = (Vec::new(), None);
    let mut socket = Socket {
        stream,
        received,
        broken,
    };

    // What the GSD says of the slave: ident number, no user parameters, and the two modules of PPO1.
    let options = dp::PeripheralOptions {
        ident_number: 0x7531,
        user_parameters: Some(&[]),
        config: Some(&[0xF3, 0xF1]),
        max_tsdr: 100,
        ..Default::default()
    };
    let mut master = dp::DpMaster::new(Vec::new());
    let slave = master.add(dp::Peripheral::new(8, options, vec![0; 12], vec![0; 12]));
    let parameters = fdl::ParametersBuilder::new(2, Baudrate::B500000)
        .slot_bits(20_000) // 40 ms: a computer is not as fast as the bus
        .watchdog_timeout(time::Duration::from_secs(5))
        .build_verified(&master);
    let mut station = fdl::FdlActiveStation::new(parameters);
    station.set_online();
    master.enter_operate();

    let start = Instant::now();
    let mut control: u16 = 0x047E; // OFF1: an ON that stands from the beginning does nothing
    while socket.broken.is_none() && start.elapsed() < Duration::from_secs(60) {
        let micros = i64::try_from(start.elapsed().as_micros()).unwrap_or(i64::MAX);
        station.poll(time::Instant::from_micros(micros), &mut socket, &mut master);
        let exchanged = Some((slave, dp::PeripheralEvent::DataExchanged));
        if master.take_last_events().peripheral != exchanged {
            std::thread::sleep(Duration::from_micros(200));
            continue;
        }
        let (inputs, outputs) = master.get_mut(slave).pi_both();
        let word = |at: usize| u16::from_be_bytes([inputs[at], inputs[at + 1]]);
        let (status, actual) = (word(8), word(10)); // behind the 8 octets of the parameter channel
        if (status, actual) == (0x0F37, 0x2000) {
            return Ok((status, actual));
        }
        if status & 0x4F == 0x01 {
            control = 0x047F; // ready to start: ON
        }
        outputs[8..10].copy_from_slice(&control.to_be_bytes());
        outputs[10..12].copy_from_slice(&0x2000_u16.to_be_bytes());
    }
    Err(socket.broken.unwrap_or(ErrorKind::TimedOut.into()))
}

fn main() -> io::Result<()> {
    let address = std::env::args()
        .nth(1)
        .unwrap_or("127.0.0.1:4200".to_owned());
    let (status, actual) = turn(&address)?;
    writeln!(io::stdout(), "ZSW {status:04X}, HIW {actual:04X}")
}
