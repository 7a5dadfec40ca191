//! A desk: masters and drives on one line.

use harness_proto::nordac::Properties;
use harness_proto::nordac::pkw::Index;
use harness_proto::nordac::properties::NordacProperty;
use harness_proto::profibus::fdl::{FcFunction, FrameControl, Pdu, Sequence};
use harness_proto::profibus::{BusRate, Telegram};
use harness_proto::time::{Instant, Span};
use harness_sim::nordac::{Drive, InverterSetup, Member};
use harness_sim::octet_segment::{LineHost, LineStation, Octet, OctetSegment, Wish};
use proptest::prelude::*;
use proptest::test_runner::{Config, RngSeed, TestRunner};

/// Buffer written in hexadecimal digits.
pub(super) fn octets(text: &str) -> Vec<u8> {
    let digits = text.split_whitespace();
    digits
        .map(|octet| u8::from_str_radix(octet, 16).expect("two hexadecimal digits"))
        .collect()
}

/// Buffer in hexadecimal digits; one with a line error has a `!`.
fn written(heard: impl Iterator<Item = harness_proto::line::Received>) -> String {
    let words: Vec<String> = heard
        .map(|octet| {
            let mark = if octet.error.is_some() { "!" } else { "" };
            format!("{:02X}{mark}", octet.byte)
        })
        .collect();
    words.join(" ")
}

/// A setup with this address and these parameters.
pub(super) fn setup(address: i32, parameters: &[(u16, i32)]) -> InverterSetup {
    let mut all = vec![(1624, Index::default(), address)];
    all.extend(
        parameters
            .iter()
            .map(|&(number, raw)| (number, Index::default(), raw)),
    );
    InverterSetup {
        parameters: all,
        ..InverterSetup::default()
    }
}

/// A property with another value.
pub(super) fn with(mut setup: InverterSetup, name: &str, word: &str) -> InverterSetup {
    let property = NordacProperty::of(name).expect("a property");
    let mut properties: Properties = setup.properties;
    assert!(property.set(&mut properties, word), "{name} = {word}");
    setup.properties = properties;
    setup
}

/// LineStation 0 is the bench, the stations from 1 on are drives.
pub(super) struct Desk<D = Box<Drive>> {
    pub(super) line: OctetSegment<Member<D>>,
    pub(super) rate: BusRate,
    now: Instant,
    /// The master as which the bench sends, and the slave to which.
    pub(super) master: u8,
    pub(super) slave: u8,
    sequence: Sequence,
}

impl Desk {
    pub(super) fn new(setup: &InverterSetup) -> Self {
        Self::at(BusRate::K500, std::slice::from_ref(setup))
    }

    pub(super) fn at(rate: BusRate, setups: &[InverterSetup]) -> Self {
        let drives = setups.iter();
        Self::over(
            rate,
            drives.map(|setup| Box::new(Drive::new(setup, rate, Instant::START))),
        )
    }

    /// The bench and the drive of the standard telegrams: master 2, slave 8.
    pub(super) fn standard() -> Self {
        Self::new(&setup(8, &[]))
    }
}

impl<D: LineStation> Desk<D> {
    pub(super) fn over(rate: BusRate, drives: impl Iterator<Item = D>) -> Self {
        let stations =
            std::iter::once(Member::Host(LineHost::default())).chain(drives.map(Member::Drive));
        Self {
            line: OctetSegment::new(rate.format(), stations.collect()),
            rate,
            now: Instant::START,
            master: 2,
            slave: 8,
            sequence: Sequence::None,
        }
    }

    pub(super) fn host(&mut self) -> &mut LineHost {
        self.line
            .station_mut(0)
            .host_mut()
            .expect("station 0 is the bench")
    }

    pub(super) fn drive(&mut self) -> &mut D {
        self.line
            .station_mut(1)
            .drive_mut()
            .expect("station 1 is a drive")
    }

    /// Sends octets, preceded by T_SYN, and gives what comes within 5 ms.
    pub(super) fn say(&mut self, octets: Vec<Octet>) -> String {
        let wish = Wish {
            ready: self.now,
            idle_bits: 33,
        };
        self.host().send(wish, octets);
        self.wait(Span::from_millis(5))
    }

    /// Sends octets written in digits, and gives what comes within 5 ms.
    pub(super) fn ask(&mut self, text: &str) -> String {
        self.say(octets(text).into_iter().map(Octet::from).collect())
    }

    /// What comes within this time.
    pub(super) fn wait(&mut self, time: Span) -> String {
        self.now += time;
        self.line.run_until(self.now);
        let host = self.host();
        written(std::iter::from_fn(|| host.receive()).map(|(_, octet)| octet))
    }

    pub(super) fn now(&self) -> Instant {
        self.now
    }

    /// A new request with the next pdu count bit: `exchange` has no SAPs.
    fn new_request(&mut self, function: FcFunction, sap: Option<u8>, data: &[u8]) -> String {
        if function.is_srd() {
            self.sequence = self.sequence.next();
        }
        let sequence = if function.is_srd() {
            self.sequence
        } else {
            Sequence::None
        };
        let control = FrameControl::request(function, sequence);
        self.request(control, sap, data)
    }

    /// A request with this FC.
    pub(super) fn request(&mut self, fc: FrameControl, sap: Option<u8>, data: &[u8]) -> String {
        let ssap = sap.map(|_| 62);
        let pdu = Pdu::with_saps(self.slave, self.master, fc, sap, ssap, data);
        let telegram = Telegram::Pdu(pdu.expect("a telegram"));
        self.ask(&telegram.encode().to_string())
    }

    /// SRD to a SAP, new.
    pub(super) fn srd(&mut self, sap: u8, data: &str) -> String {
        self.new_request(FcFunction::SrdHigh, Some(sap), &octets(data))
    }

    /// Data_Exchange, new.
    pub(super) fn exchange(&mut self, data: &str) -> String {
        self.new_request(FcFunction::SrdHigh, None, &octets(data))
    }

    /// The data of the reply to a Data_Exchange, and its FC in front.
    pub(super) fn inputs(&mut self, data: &str) -> String {
        let reply = self.exchange(data);
        data_of(&reply)
    }

    /// Global_Control to the slave.
    pub(super) fn control(&mut self, command: u8, group: u8) -> String {
        self.new_request(FcFunction::SdnHigh, Some(58), &[command, group])
    }

    /// The data of a Slave_Diag.
    pub(super) fn diagnosis(&mut self) -> String {
        let reply = self.srd(60, "");
        let data = data_of(&reply);
        // FC and the two SAPs stand in front.
        data.get(9..).unwrap_or(&reply).to_owned()
    }

    /// Set_Prm and Chk_Cfg, without watchdog.
    pub(super) fn start(&mut self, cfg: &str) {
        self.start_with("80 00 00 0B 75 31 00", cfg);
    }

    pub(super) fn start_with(&mut self, prm: &str, cfg: &str) {
        assert_eq!(self.srd(61, prm), "E5");
        assert_eq!(self.srd(62, cfg), "E5");
    }
}

/// FC and what follows it up to FCS, of a reply in form SD2; an empty text for another reply.
fn data_of(reply: &str) -> String {
    let words: Vec<&str> = reply.split(' ').collect();
    match words.as_slice() {
        ["68", .., _, _] if words.len() > 8 => words[6..words.len() - 2].join(" "),
        _ => String::new(),
    }
}

/// Runs a property; a failure prints the seed and the command that repeats it.
pub(super) fn property<S: Strategy>(
    name: &str,
    cases: u32,
    strategy: &S,
    test: impl Fn(S::Value) -> Result<(), TestCaseError>,
) {
    let seed = std::env::var("DRIVEBENCH_SEED")
        .ok()
        .and_then(|s| s.parse().ok())
        .unwrap_or(7_531);
    let config = Config {
        cases,
        rng_seed: RngSeed::Fixed(seed),
        failure_persistence: None,
        ..Config::default()
    };
    if let Err(error) = TestRunner::new(config).run(strategy, test) {
        panic!(
            "{error}\nrepeat with: DRIVEBENCH_SEED={seed} cargo test -p harness-sim-tests --test sim {name}"
        );
    }
}
