//! The driver over a simulated ring of three ND21 (ND21 chapters 11, 12, 13.2).

use crate::driver::{
    Axis, Error, OpenRings, Options, Recovery, ScopeSettings, SpelledOut, SpellingCause, Trigger,
    count_drives, recover,
};
use crate::link::SimulatedLink;
use harness_bench::link::{DriveFault, Line, Link, Moment, Octets, PlacedFault};
use harness_bench::medium::{HeardPiece, Medium, Out};
use harness_proto::line::{Rate, Received};
use harness_proto::nd21::io::Input;
use harness_proto::nd21::position::{Position, PositionMode};
use harness_proto::nd21::units::{Ratio, trigger_delay, trigger_level_to_raw};
use harness_proto::nd21::{ee, ram};
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::command::Command;
use harness_proto::novobus::master::Job;
use harness_proto::novobus::output::{Output, OutputChange};
use harness_proto::novobus::properties::Properties;
use harness_proto::time::{Instant, Span};
use harness_sim::fault::LinkFault;
use harness_sim::nd21::{Nd21Drive, Nd21Properties, Stimulus, factory};
use harness_sim::novobus::bench::Bench;
use harness_sim::novobus::drive::Drive;
use harness_sim::novobus::ring::Ring;

fn size(drives: u64) -> RingSize {
    RingSize::new(drives).expect("1 to 250")
}

fn ring(drives: u64, properties: Nd21Properties) -> Ring<Drive> {
    Ring::new(size(drives), Rate::Baud38400, |k| {
        let mut eeprom = factory::eeprom();
        eeprom[usize::from(ee::SERIENNUMMER) + 2] = k / 10 % 10 * 16 + k % 10;
        eeprom[0x23] = 0xFB;
        harness_sim::nd21::set_parity(&mut eeprom);
        let mut drive = Nd21Drive::new(Properties::default(), properties, eeprom);
        drive.stimulate(Stimulus::Input(Input::Gpin3, true));
        drive.stimulate(Stimulus::Input(Input::Gpin5, true));
        drive.stimulate(Stimulus::Cam(Input::Gpin4, 65_536, 100_000));
        Drive::Nd21(drive)
    })
}

fn bus_of(ring: Ring<Drive>, options: Options) -> OpenRings<'static> {
    let drives = u64::from(ring.size().drives());
    let link = SimulatedLink::new(Bench::one(ring));
    OpenRings::open(Box::new(link), &[size(drives)], options).expect("an open bus")
}

fn bus() -> OpenRings<'static> {
    bus_of(ring(3, Nd21Properties::default()), Options::default())
}

fn axis(number: u16) -> Axis {
    Axis::from_number(number).expect("an axis")
}

/// ND21 12.2, 12.3: bytes, words and longs; ranges are refused before a byte is sent.
#[test]
fn reading_and_writing_of_12_2_and_12_3() {
    let bus = bus();
    bus.write_word(axis(1), ram::NSOLL, 0x0123)
        .expect("written");
    assert_eq!(bus.read_word(axis(1), ram::NSOLL), Ok(0x0123));
    assert_eq!(bus.read_byte(axis(1), ram::NSOLL + 1), Ok(0x23));
    bus.write_byte(axis(2), ram::VCO_LIN, 0x44)
        .expect("written");
    assert_eq!(bus.read_byte(axis(2), ram::VCO_LIN), Ok(0x44));
    assert_eq!(bus.read_long(axis(0), ram::N_MAX), Ok(0x2C3D_0000));
    assert_eq!(bus.read_bytes(axis(0), ram::N_MAX, 2), Ok(vec![0x2C, 0x3D]));
    let before = bus.counters()[0].sent;
    for (refused, part) in [
        (bus.read_byte(axis(3), 0xFF00).map(|_| ()), "drive 3"),
        (bus.read_byte(axis(1), 0x1000).map(|_| ()), "FD80"),
        (bus.write_byte(axis(1), 0xFF80, 0), "FF7F"),
        (bus.read_long(axis(1), 0xFF7D).map(|_| ()), "FF7F"),
        (bus.or(axis(1), 0xFE00, 1), "FF00 to FF7F"),
        (bus.read_byte(axis(0x0100), 0xFF00).map(|_| ()), "no ring 2"),
    ] {
        let message = refused.expect_err("refused").to_string();
        assert!(message.contains(part), "{message}");
    }
    assert_eq!(bus.counters()[0].sent, before, "before a byte is sent");
}

/// ND21 11.6, 12.4: orders are pipelined, and their result can be fetched once.
#[test]
fn orders_of_11_6() {
    let bus = bus();
    let read = |drive| {
        Job::new(
            drive,
            Command::ReadWord {
                address: ram::N_MAX,
            },
        )
    };
    let orders: Vec<_> = (0..20)
        .map(|i| bus.start(axis(i % 3), read).expect("started"))
        .collect();
    for order in &orders {
        assert_eq!(bus.result(*order), Ok(Some(0x2C3D)));
    }
    assert_eq!(bus.result(orders[0]), Err(Error::NoSuchOrder));
    // Twenty answers of five bytes and the ring's three byte times, not twenty times both.
    let counters = bus.counters()[0];
    assert!(counters.sent - counters.idle < 20 * 7, "{counters:?}");
}

/// Clones may be used from several threads.
#[test]
fn used_from_threads() {
    let bus = bus();
    std::thread::scope(|scope| {
        for k in 0..3 {
            let bus = bus.clone();
            scope.spawn(move || {
                for value in 0..40 {
                    bus.write_word(axis(k), ram::NSOLL, value).expect("written");
                    assert_eq!(bus.read_word(axis(k), ram::NSOLL), Ok(value));
                }
            });
        }
    });
}

/// ND21 12.5: EEPROM read and write, RAM to EEPROM.
#[test]
fn eeprom_of_12_5() {
    let bus = bus();
    assert_eq!(bus.read_eeprom(axis(2), ee::POLE), Ok(6));
    bus.write_eeprom(axis(2), 0x60, 0x12).expect("written");
    assert_eq!(bus.read_eeprom(axis(2), 0x60), Ok(0x12));
    bus.write_word(axis(2), ram::N_MAX, 0x1000)
        .expect("written");
    bus.ram_to_eeprom(axis(2)).expect("copied");
    bus.reset(axis(2)).expect("reset");
    bus.run(Span::from_millis(200));
    assert_eq!(bus.read_word(axis(2), ram::N_MAX), Ok(0x1000));
}

/// A ring whose answer to the command that reads a byte of the EEPROM is damaged every other time, so and so often.
struct DamagesReads {
    link: SimulatedLink,
    left: u8,
    damages: bool,
    heard: [u8; 4],
}

impl Line for DamagesReads {
    fn medium(&self, port: usize) -> Medium {
        self.link.medium(port)
    }

    fn now(&self) -> Instant {
        self.link.now()
    }

    fn send(&mut self, ring: usize, what: Out<'_>) -> Instant {
        self.link.send(ring, what)
    }

    fn receive(&mut self, ring: usize) -> Option<(Instant, HeardPiece)> {
        let (at, mut received) = self.link.receive_octet(ring)?;
        // Its check byte follows.
        if self.heard == [0x82, 0x81, 0x8A, 0xFD] && self.left > 0 {
            self.damages = !self.damages;
            if self.damages {
                self.left -= 1;
                received.byte ^= 1;
            }
        }
        self.heard.rotate_left(1);
        self.heard[3] = received.byte;
        Some((at, HeardPiece::Octet(received)))
    }

    fn wait(&mut self, until: Instant) -> bool {
        self.link.wait(until)
    }
}

/// ND21 14.10.5.1: the byte that was read stands where its address stood, so that a read that is repeated reads another byte.
#[test]
fn a_disturbed_read_of_the_eeprom() {
    let bus_of = |left| {
        let line = DamagesReads {
            link: SimulatedLink::new(Bench::one(ring(3, Nd21Properties::default()))),
            left,
            damages: false,
            heard: [0; 4],
        };
        OpenRings::open(Box::new(line), &[size(3)], Options::default()).expect("an open bus")
    };
    // 02 stands there, and 00 at 02.
    let place = ee::SERIENNUMMER + 2;
    for left in 0..8 {
        let bus = bus_of(left);
        assert_eq!(bus.read_eeprom(axis(2), place), Ok(2), "{left} times");
        assert_eq!(bus.corrected_errors(), u64::from(left));
        assert_eq!(bus.read_eeprom(axis(2), 2), Ok(0));
    }
    let bus = bus_of(8);
    let disturbed = bus.read_eeprom(axis(2), place).expect_err("8 times");
    assert_eq!(
        disturbed.to_string(),
        "reading the EEPROM at 03 (ND21 14.10.5.2) was disturbed 8 times"
    );
    assert_eq!(bus.read_eeprom(axis(2), place), Ok(2));
}

/// Wherever a byte is lost or damaged, the EEPROM is read as it is.
#[test]
fn the_eeprom_on_a_disturbed_ring() {
    for byte in 1..=100 {
        for (place, fault) in [
            (0, LinkFault::Drop),
            (2, LinkFault::Drop),
            (3, LinkFault::Drop),
            (3, LinkFault::Replace(0x41)),
        ] {
            let mut link = SimulatedLink::new(Bench::one(ring(3, Nd21Properties::default())));
            link.inject(0, PlacedFault::Link(place, fault), Moment::Byte(byte));
            let bus =
                OpenRings::open(Box::new(link), &[size(3)], Options::default()).expect("open");
            let read = bus.read_eeprom(axis(2), ee::SERIENNUMMER + 2);
            assert_eq!(read, Ok(2), "{fault:?} at byte {byte} of link {place}");
        }
    }
}

/// ND21 11.8, 12.6-12.8.
#[test]
fn start_stop_error_and_outputs() {
    let bus = bus();
    let mode = |k| bus.state(axis(k)).expect("a state").mode();
    assert_eq!(mode(1), "go");
    bus.stop(axis(1)).expect("stopped");
    bus.run(Span::from_millis(1));
    assert_eq!(mode(1), "stop");
    bus.block(axis(1)).expect("blocked");
    bus.run(Span::from_millis(1));
    assert_eq!(mode(1), "block");
    bus.go(axis(1)).expect("started");
    bus.run(Span::from_millis(1));
    assert_eq!(mode(1), "go");
    let change = OutputChange {
        output: Output::Gpo1,
        set: true,
    };
    bus.start(axis(0), |drive| Job::new(drive, Command::WriteIo(change)))
        .and_then(|order| bus.result(order))
        .expect("set");
    assert_eq!(bus.read_byte(axis(0), 0xFFB7).expect("read") & 0x80, 0x80);
    // 13.4: a calculation without initialisation is error 601.
    bus.or(axis(1), ram::FLAGS2, 0x08).expect("set");
    bus.run(Span::from_millis(1));
    let state = bus.state(axis(1)).expect("a state");
    assert_eq!((state.mode(), state.error), ("error", 0x0601));
    assert!(
        state
            .error_in_words()
            .is_some_and(|words| words.contains("DisPS"))
    );
    bus.delete_error(axis(1)).expect("confirmed");
    bus.run(Span::from_millis(1));
    assert_eq!(mode(1), "go");
}

/// ND21 13.2.1.1, 13.2.2-13.2.4: referencing, then a target, then back; interrupted by a stop.
#[test]
fn positioning_of_13_2() {
    let bus = bus();
    bus.write_word(axis(1), ram::PS_V0, 0x0800)
        .expect("written");
    bus.reference(axis(1)).expect("referenced");
    assert_eq!(bus.read_word(axis(1), ram::PS_V0), Ok(0x0800), "step 9");
    let target = Position::from_turns(
        PositionMode::Absolute,
        Ratio::decimal(1025, 2).expect("turns"),
    );
    bus.write_ps(axis(1), target.expect("a position"))
        .expect("sent");
    bus.start_ps(axis(1)).expect("started");
    bus.wait_for_end(axis(1)).expect("there");
    assert_eq!(bus.read_long(axis(1), ram::UMDRSOLL), Ok(0x000A_4000));
    bus.stop(axis(1)).expect("stopped");
    let interrupted = bus.reference(axis(1)).expect_err("stopped");
    assert!(
        matches!(interrupted, Error::Interrupted { by: "stop", .. }),
        "{interrupted}"
    );
    assert_eq!(bus.read_word(axis(1), ram::PS_V0), Ok(0x0800));
}

/// ND21 13.2.1.2, 13.2.1.3.
#[test]
fn actual_value_and_init() {
    let bus = bus();
    bus.set_actual_value(axis(0), 0xFFFB_1234).expect("set");
    let actual = bus.read_long(axis(0), ram::UMDRIST).expect("read");
    assert!(actual.abs_diff(0xFFFB_1234) < 256, "{actual:08X}");
    assert_eq!(bus.read_byte(axis(0), ram::PS_STATUS), Ok(0x01));
    bus.init_ps(axis(2)).expect("initialised");
    assert_eq!(bus.read_byte(axis(2), ram::PS_STATUS), Ok(0x01));
}

/// ND21 9.3, 14.8: discovery counts the drives without changing them and reads their identity.
#[test]
fn discovery() {
    for drives in [1, 3, 40, 250] {
        let mut link = SimulatedLink::new(Bench::one(ring(drives, Nd21Properties::default())));
        assert_eq!(count_drives(&mut link, 0), Ok(size(drives)));
        // Also out of the error mode.
        link.send_octets(0, &[0x11, 0x22]);
        assert_eq!(count_drives(&mut link, 0), Ok(size(drives)));
    }
    let mut link = SimulatedLink::new(Bench::one(ring(3, Nd21Properties::default())));
    link.inject(0, PlacedFault::Link(1, LinkFault::Cut), Moment::Now);
    assert!(matches!(
        count_drives(&mut link, 0),
        Err(Error::TimeOut { .. })
    ));
    let identity = bus().identity(axis(2)).expect("an identity");
    assert_eq!(identity.serial_number, Some(2));
    assert_eq!(identity.start_up.map(|date| date.year()), Some(1996));
    // More jobs than the master holds, all of them answered in order.
    let bus = bus_of(ring(100, Nd21Properties::default()), Options::default());
    let identities = bus.identities(&bus.axes()).expect("identities");
    let numbers: Vec<_> = identities.iter().map(|i| i.serial_number).collect();
    assert_eq!(numbers, (0..100).map(Some).collect::<Vec<_>>());
    let ram = bus.read_bytes(axis(7), 0xFD80, 0x200).expect("bytes");
    let n_max = usize::from(ram::N_MAX - 0xFD80);
    assert_eq!(
        (ram.len(), &ram[n_max..n_max + 2]),
        (0x200, &[0x2C, 0x3D][..])
    );
}

/// ND21 9.7, 9.8: recovery names the drive that detected the fault and brings the ring back if possible.
#[test]
fn recovery_of_9_8() {
    let mut link = SimulatedLink::new(Bench::one(ring(4, Nd21Properties::default())));
    let fine = Recovery {
        before: None,
        after: None,
        zeros_unasked: false,
        drives: Some(size(4)),
        heard: Vec::new(),
    };
    assert_eq!(recover(&mut link, 0), fine);
    // The second link ends at drive 2.
    link.inject(
        0,
        PlacedFault::Link(1, LinkFault::Replace(0x11)),
        Moment::Now,
    );
    link.send_octets(0, &[0x80]);
    let damaged = Recovery {
        before: Some(SpelledOut {
            drive: 2,
            why: SpellingCause::Fault,
        }),
        ..fine.clone()
    };
    assert_eq!(recover(&mut link, 0), damaged);
    assert_eq!(recover(&mut link, 0), fine);
    link.inject(0, PlacedFault::Link(1, LinkFault::Cut), Moment::Now);
    let open = recover(&mut link, 0);
    assert_eq!((open.drives, &open.heard[..]), (None, &[][..]));
}

/// ND21 9.8, 9.9: a sound ring that monitors time-outs is brought back and counted after every silence, however many of its drives have not
/// noticed that the one before them is in the error mode.
#[test]
fn a_sound_ring_is_counted_behind_every_silence() {
    for drives in [4, 5, 6, 12, 40] {
        let monitors = |_: u8| {
            let mut eeprom = factory::eeprom();
            eeprom[usize::from(ee::SELFTEST)] = 0x80;
            harness_sim::nd21::set_parity(&mut eeprom);
            let properties = Nd21Properties::default();
            Drive::Nd21(Nd21Drive::new(Properties::default(), properties, eeprom))
        };
        let ring = Ring::new(size(drives), Rate::Baud38400, monitors);
        let mut link = SimulatedLink::new(Bench::one(ring));
        link.send_octets(0, &[0x80]);
        for round in 0..4 {
            let end = link.now() + Span::from_millis(500);
            while link.now() < end {
                link.wait(end);
            }
            assert_eq!(
                count_drives(&mut link, 0),
                Ok(size(drives)),
                "{drives}, {round}"
            );
            let end = link.now() + Span::from_millis(500);
            while link.now() < end {
                link.wait(end);
            }
            let recovery = recover(&mut link, 0);
            assert_eq!(recovery.drives, Some(size(drives)), "{drives}, {round}");
        }
    }
}

/// ND21 9.7: where a drive's transmitter sends the same byte for ever, that byte comes back, and not nothing.
#[test]
fn what_a_defective_transmitter_sends_is_heard() {
    for (drives, drive, byte, heard) in [(3, 1, 0, 1), (12, 5, 5, 4), (3, 0, 0x55, 0x55)] {
        let mut link = SimulatedLink::new(Bench::one(ring(drives, Nd21Properties::default())));
        link.inject(
            0,
            PlacedFault::Drive(drive, DriveFault::Stuck(byte)),
            Moment::Now,
        );
        let found = recover(&mut link, 0);
        assert_eq!(
            (found.drives, found.heard),
            (None, vec![heard; 8]),
            "{drive} {byte}"
        );
    }
}

/// ND21 14.10.6: a recording with a trigger, one without, and one that never triggers.
#[test]
fn oscilloscope_of_14_10_6() {
    let bus = bus();
    let [_, nist] = ram::NIST.to_be_bytes();
    let level = trigger_level_to_raw(2);
    let delay = trigger_delay(-5_000, 0).expect("a delay");
    let scope = ScopeSettings {
        signals: [nist; 2],
        timer0: 0,
        trigger: Some(Trigger {
            signal: nist,
            level,
            positive: true,
            delay,
        }),
    };
    bus.start_scope(axis(1), &scope).expect("started");
    bus.write_word(axis(1), ram::NSOLL, 0x1000)
        .expect("written");
    let found = bus
        .finish_scope(axis(1), &scope, Span::from_millis(1_000))
        .expect("triggered");
    let bytes: Vec<_> = found.iter().map(|found| found.byte).collect();
    assert_eq!(bytes.len(), 256);
    assert!(bytes.is_sorted(), "a run-up in time order: {bytes:?}");
    assert_eq!((bytes[45], bytes[46]), (1, 2), "46 before the trigger");
    assert_eq!(found[0].signal + found[1].signal, 3, "in turn");
    bus.write_word(axis(1), ram::NSOLL, 0).expect("written");
    bus.run(Span::from_millis(1_000));
    let again = bus.start_scope(axis(1), &scope);
    again.expect("started");
    let waited = bus.finish_scope(axis(1), &scope, Span::from_millis(100));
    assert!(matches!(waited, Err(Error::TimeOut { .. })), "{waited:?}");
    assert_eq!(
        bus.read_byte(axis(1), ram::SCOPE_STATUS).map(|s| s & 0x80),
        Ok(0x80)
    );
    let at_once = ScopeSettings {
        trigger: None,
        ..scope
    };
    bus.start_scope(axis(1), &at_once).expect("started");
    let found = bus
        .finish_scope(axis(1), &at_once, Span::ZERO)
        .expect("recorded");
    assert!(found.iter().all(|found| found.byte == 0));
}

/// ND21 11.4, 11.5: a ring of another size is not opened; disturbances are corrected and counted.
#[test]
fn opening_and_correcting() {
    let link = SimulatedLink::new(Bench::one(ring(4, Nd21Properties::default())));
    let opened = OpenRings::open(Box::new(link), &[size(3)], Options::default());
    let message = opened.map(|_| ()).expect_err("another size").to_string();
    assert!(message.contains("4 drives"), "{message}");

    let mut link = SimulatedLink::new(Bench::one(ring(3, Nd21Properties::default())));
    link.inject(0, PlacedFault::Link(1, LinkFault::Drop), Moment::Byte(40));
    let bus = OpenRings::open(Box::new(link), &[size(3)], Options::default()).expect("open");
    for value in 0..30 {
        bus.write_word(axis(0), ram::NSOLL, value).expect("written");
        assert_eq!(bus.read_word(axis(0), ram::NSOLL), Ok(value));
    }
    assert_eq!(bus.corrected_errors(), 1);
    assert!(!bus.take_log().is_empty());
}

/// ND21 12.2: two loops, axis numbers 0x0100 and up.
#[test]
fn two_rings() {
    let bench = Bench::two(
        ring(2, Nd21Properties::default()),
        ring(3, Nd21Properties::default()),
    );
    let link = Box::new(SimulatedLink::new(bench));
    let bus = OpenRings::open(link, &[size(2), size(3)], Options::default()).expect("open");
    assert_eq!(bus.axes().len(), 5);
    bus.write_word(axis(0x0102), ram::NSOLL, 7)
        .expect("written");
    assert_eq!(bus.read_word(axis(0x0102), ram::NSOLL), Ok(7));
    assert_eq!(bus.read_word(axis(0x0001), ram::NSOLL), Ok(0));
}

/// A ring that answers as it likes: random bytes, late, too many, or nothing.
struct Hostile {
    seed: u64,
    now: Instant,
    /// Bytes that come for each that is sent, in hundredths.
    answers: u64,
    waiting: u64,
    echo: bool,
    last: u8,
}

impl Hostile {
    fn random(&mut self) -> u64 {
        self.seed ^= self.seed << 13;
        self.seed ^= self.seed >> 7;
        self.seed ^= self.seed << 17;
        self.seed
    }
}

impl Line for Hostile {
    fn medium(&self, _port: usize) -> Medium {
        Rate::Baud38400.into()
    }

    fn now(&self) -> Instant {
        self.now
    }

    fn send(&mut self, _ring: usize, what: Out<'_>) -> Instant {
        self.waiting += self.answers * what.len() as u64;
        self.last = what.octets().last().copied().unwrap_or(self.last);
        self.now + self.byte_time() * what.len() as u64
    }

    fn receive(&mut self, _ring: usize) -> Option<(Instant, HeardPiece)> {
        self.waiting = self.waiting.checked_sub(100)?;
        let byte = if self.echo && !self.random().is_multiple_of(50) {
            self.last
        } else {
            self.random().to_le_bytes()[0]
        };
        Some((self.now, HeardPiece::Octet(Received::good(byte))))
    }

    fn wait(&mut self, until: Instant) -> bool {
        self.now = self.now.max(until);
        true
    }
}

/// Whatever comes back, opening and every call end within bounded time, with a value or a named failure.
#[test]
fn a_hostile_ring_ends_every_call() {
    for case in 0..60 {
        let line = Hostile {
            seed: 0x9E37_79B9_7F4A_7C15 ^ case,
            now: Instant::START,
            answers: [0, 50, 100, 130, 400][case as usize % 5],
            waiting: 0,
            echo: case % 2 == 0,
            last: 0x80,
        };
        let mut counting = Hostile { ..line };
        let _any = count_drives(&mut counting, 0);
        assert!(counting.now < Instant::START + Span::from_millis(2_000));
        let drives = 1 + case % 7;
        let Ok(bus) = OpenRings::open(Box::new(line), &[size(drives)], Options::default()) else {
            continue;
        };
        for _ in 0..5 {
            let _any = bus.read_word(axis(0), ram::NIST);
            let _any = bus.write_byte(axis(0), ram::NSOLL, 1);
        }
        bus.close();
    }
}
