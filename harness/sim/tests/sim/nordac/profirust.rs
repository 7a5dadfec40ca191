//! The public master profirust, unmodified, against a drive on a segment in virtual time.

use ::profirust::phy::ProfibusPhy;
use ::profirust::{Baudrate, dp, fdl, time};
use harness_proto::line::Received;
use harness_proto::nordac::pkw::Index;
use harness_proto::nordac::words::State;
use harness_proto::nordac::{IDENT, PpoType};
use harness_proto::profibus::BusRate;
use harness_proto::profibus::rate::MIN_TSDR_BITS;
use harness_proto::time::{Instant, Span};
use harness_sim::nordac::{Drive, InverterSetup, Member};
use harness_sim::octet_segment::{LineHost, Octet, OctetSegment, Wish};

/// The master's place on the segment, and the drive's.
const MASTER: usize = 0;
const DRIVE: usize = 1;
const ADDRESS: u8 = 8;

/// How far the master's time goes on at a time, in microseconds.
const STEP: i64 = 20;

/// A segment as profirust sees it.
struct Segment {
    line: OctetSegment<Member<Box<Drive>>>,
    received: Vec<u8>,
    sends: bool,
}

impl Segment {
    fn new(rate: BusRate, ppo: PpoType) -> Self {
        let index = Index::default();
        let parameters = vec![
            (1624, index, ADDRESS.into()),
            (1622, index, ppo.raw().into()),
            (1621, index, 2),
            // 0.5 s.
            (1202, index, 10),
        ];
        let setup = InverterSetup {
            parameters,
            ..InverterSetup::default()
        };
        let drive = Drive::new(&setup, rate, Instant::START);
        let stations = vec![
            Member::Host(LineHost::default()),
            Member::Drive(Box::new(drive)),
        ];
        Self {
            line: OctetSegment::new(rate.format(), stations),
            received: Vec::new(),
            sends: false,
        }
    }

    fn host(&mut self) -> &mut LineHost {
        self.line.station_mut(MASTER).host_mut().expect("a host")
    }

    fn run(&mut self, now: time::Instant) {
        let micros = u64::try_from(now.total_micros()).expect("not before the start");
        self.line
            .run_until(Instant::START + Span::from_micros(micros));
        if self.host().confirmation().is_some() {
            self.sends = false;
        }
        while let Some((_, Received { byte, error })) = self.host().receive() {
            assert_eq!(error, None, "the line is good");
            self.received.push(byte);
        }
    }
}

impl ProfibusPhy for Segment {
    fn poll_transmission(&mut self, now: time::Instant) -> bool {
        self.run(now);
        self.sends
    }

    fn transmit_data<F, R>(&mut self, now: time::Instant, f: F) -> R
    where
        F: FnOnce(&mut [u8]) -> (usize, R),
    {
        self.run(now);
        let mut buffer = [0; 256];
        let (length, result) = f(&mut buffer);
        if length > 0 {
            let octets = buffer[..length].iter().copied().map(Octet::from);
            // The master waits for idle bits by itself.
            let wish = Wish {
                ready: self.line.now(),
                idle_bits: 0,
            };
            self.host().send(wish, octets.collect());
            self.sends = true;
        }
        result
    }

    fn receive_data<F, R>(&mut self, now: time::Instant, f: F) -> R
    where
        F: FnOnce(&[u8]) -> (usize, R),
    {
        self.run(now);
        let (used, result) = f(&self.received);
        self.received.drain(..used);
        result
    }
}

/// Brings the drive into the exchange, turns the motor at 50 %, and gives the time that this took and the segment.
fn turns(ppo: PpoType, rate: BusRate, baud: Baudrate) -> (i64, Segment) {
    let mut segment = Segment::new(rate, ppo);
    let options = dp::PeripheralOptions {
        ident_number: IDENT,
        max_tsdr: u16::try_from(rate.max_tsdr_bits()).expect("a few bits"),
        user_parameters: Some(&[]),
        config: Some(ppo.cfg()),
        ..Default::default()
    };
    let mut master = dp::DpMaster::new(Vec::new());
    let inputs = vec![0; ppo.octets()];
    let outputs = vec![0; ppo.octets()];
    let handle = master.add(dp::Peripheral::new(ADDRESS, options, inputs, outputs));
    let parameters = fdl::ParametersBuilder::new(2, baud)
        .slot_bits(400)
        .watchdog_timeout(time::Duration::from_millis(300))
        .build_verified(&master);
    let mut station = fdl::FdlActiveStation::new(parameters);
    station.set_online();
    master.enter_operate();
    let begin = ppo.words_begin();
    let mut now = 0;
    while now < 5_000_000 {
        station.poll(time::Instant::from_micros(now), &mut segment, &mut master);
        if master.take_last_events().cycle_completed {
            let drive = master.get_mut(handle);
            let status = u16::from_be_bytes([drive.pi_i()[begin], drive.pi_i()[begin + 1]]);
            let actual = u16::from_be_bytes([drive.pi_i()[begin + 2], drive.pi_i()[begin + 3]]);
            if (status, actual) == (0x0F37, 0x2000) {
                return (now, segment);
            }
            let word: u16 = match State::of_zsw(status) {
                Some(State::StartDisable) | None => 0x047E,
                Some(_) => 0x047F,
            };
            let words = [word.to_be_bytes(), 0x2000u16.to_be_bytes()].concat();
            drive.pi_q_mut()[begin..begin + 4].copy_from_slice(&words);
        }
        now += STEP;
    }
    panic!("{ppo}: the motor does not turn at 50 % after 5 s");
}

/// NORDAC 3.1, EN 14: with every PPO type the master gets into the exchange, and ZSW and HIW end at 0F37 and 2000.
#[test]
fn profirust_turns_the_motor() {
    for ppo in PpoType::ALL {
        let (_, segment) = turns(ppo, BusRate::K500, Baudrate::B500000);
        let drive = segment.line.station(DRIVE).drive().expect("a drive");
        assert_eq!(drive.inverter().state(), State::OperationEnabled, "{ppo}");
        assert_eq!(drive.slave().master(), Some(2), "{ppo}");
    }
}

/// EN 1: at every rate the first octet of a reply begins 11 bits or more behind the last octet of its request.
#[test]
fn replies_keep_the_shortest_delay() {
    for (rate, baud) in [
        (BusRate::K19_2, Baudrate::B19200),
        (BusRate::K187_5, Baudrate::B187500),
        (BusRate::K1500, Baudrate::B1500000),
    ] {
        let (_, segment) = turns(PpoType::Three, rate, baud);
        let requests: Vec<_> = segment
            .line
            .record(MASTER)
            .iter()
            .map(|octet| octet.at)
            .collect();
        let mut last = Instant::START;
        let mut replies = 0;
        for octet in segment.line.record(DRIVE) {
            let begin = octet.at - rate.octet_time();
            if begin > last {
                let request = requests[requests.partition_point(|at| *at <= begin) - 1];
                let delay = begin.since(request);
                assert_eq!(delay, rate.bit_time() * MIN_TSDR_BITS, "{rate:?}");
                replies += 1;
            }
            last = octet.at;
        }
        assert!(replies > 10, "{rate:?}");
    }
}
