//! Telegrams, waits and faults for one drive, beside the reference model of its module.

use super::cells::{DpCell, Event, State};
use super::heard::TelegramEffect;
use super::telegrams::{ADDRESS, any_telegram, octets, parameters, telegram};
use crate::fuzz::{LONGEST, Notebook};
use crate::nordac::reference::ReferenceSlave;
use crate::nordac::{Drive, InverterSetup};
use crate::octet_segment::LineStation;
use arbitrary::{Arbitrary, Unstructured};
use harness_proto::line::{LineError, Received};
use harness_proto::nordac::pkw::Index;
use harness_proto::nordac::properties::{Choices, PROPERTIES, Properties};
use harness_proto::nordac::words::{State as DriveState, stw};
use harness_proto::profibus::dp::DpState;
use harness_proto::profibus::{Buffer, BusRate};
use harness_proto::time::{Instant, Span};
use std::sync::LazyLock;

const RATE: BusRate = BusRate::K1500;

/// Most operations of an input.
const MOST: usize = 340;

/// What the reference model does not know.
const UNKNOWN: [&str; 5] = [
    "pzd-latency",
    "ext-diag",
    "autobaud",
    "cfg-follows-ppo-type",
    "position-count",
];

/// Control words of which each does something else in some state.
const WORDS: [u16; 16] = [
    0x047E, 0x047F, 0x047F, 0x047D, 0x047B, 0x0477, 0x0476, 0x04FE, 0x04FF, 0x446F, 0x445F, 0x443F,
    0x447F, 0x147F, 0x007F, 0x0000,
];

/// Milliseconds that pass after an operation.
const WAITS: [u64; 16] = [
    0, 0, 0, 0, 0, 0, 1, 1, 5, 20, 100, 100, 500, 2_000, 10_000, 60_000,
];

/// One operation: what, how it is sent, its data, and the time after it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct SlaveStep {
    what: u8,
    /// Bit 0: from master 3; bits 3, 2: 2 first request, 3 without count, 0 and 1 the next; bits 5, 4: 3 damaged; bits 7, 6: 3 to the address
    /// in data byte 8.
    how: u8,
    data: [u8; 9],
    wait: u8,
}

impl<'a> Arbitrary<'a> for SlaveStep {
    /// Twelve bytes. The first one chooses: 0 to 6 a Data_Exchange with a usual word, 7 with any word, 8 one of another length; 9 Set_Prm, 10 Chk_Cfg, 11 both as
    /// a master starts; 12 a service that reads, 13 Global_Control; 14 the last telegram again; 15 any telegram; 16 the link, a fault, or time.
    fn arbitrary(input: &mut Unstructured<'a>) -> arbitrary::Result<Self> {
        let mut bytes = [0; 12];
        input.fill_buffer(&mut bytes)?;
        let [what, how, data @ .., wait] = bytes;
        let what = what % 17;
        Ok(Self {
            what,
            how,
            data,
            wait,
        })
    }
}

/// The drive and the model, at the same time.
#[derive(Clone, Debug)]
struct SlavePair {
    drive: Drive,
    reference: ReferenceSlave,
    /// The line is idle since then, and both have advanced to it.
    now: Instant,
    /// The upper half of FC of the next counted request.
    count: u8,
    last: Buffer,
}

/// The defaults, and each other value of each open point that the reference model knows.
static VARIANTS: LazyLock<Vec<SlavePair>> = LazyLock::new(|| {
    let mut all = vec![Properties::default()];
    for property in PROPERTIES {
        let words: Vec<String> = match property.accepts {
            Choices::Words(words) => words.iter().skip(1).map(|&word| word.to_owned()).collect(),
            Choices::Count { least, default, .. } => {
                [least, default + 1].iter().map(u8::to_string).collect()
            }
        };
        for word in words {
            let mut variant = Properties::default();
            let known = !UNKNOWN.contains(&property.name);
            if known && property.set(&mut variant, &word) && variant != all[0] {
                all.push(variant);
            }
        }
    }
    all.into_iter().map(SlavePair::new).collect()
});

/// The first byte chooses the variant of the drive; the others are operations of twelve bytes.
///
/// # Panics
/// The drive answers or does something else than the reference model, or breaks a rule of the bus.
pub fn slave(data: &[u8]) {
    watched(data, &mut |_| {});
}

/// The same, and the number of every cell that the drive goes through is given to `reached`.
///
/// # Panics
/// As [`slave`].
pub fn slave_counted(data: &[u8], reached: &mut impl FnMut(usize)) {
    watched(data, &mut |cell| reached(cell.index()));
}

/// The same, and the cells are noted.
///
/// # Panics
/// As [`slave`].
pub(super) fn noted(data: &[u8], notes: &mut Notebook<'_>) {
    watched(data, &mut |cell| {
        assert!(
            cell.is_reachable(),
            "{} was called unreachable",
            cell.feature()
        );
        notes.note(|| cell.feature());
    });
}

fn watched(data: &[u8], reached: &mut impl FnMut(DpCell)) {
    let Some((&variant, data)) = data.split_first() else {
        return;
    };
    let mut pair = VARIANTS[usize::from(variant) % VARIANTS.len()].clone();
    let mut input = Unstructured::new(&data[..data.len().min(LONGEST)]);
    for _ in 0..MOST {
        let (false, Ok(operation)) = (input.is_empty(), input.arbitrary::<SlaveStep>()) else {
            break;
        };
        pair.happens(&operation, reached);
        let wait = WAITS[usize::from(operation.wait % 16)];
        pair.wait(Span::from_millis(wait), reached);
        pair.compare();
    }
}

impl SlavePair {
    fn new(properties: Properties) -> Self {
        let at = |number, set, value| (number, Index { element: 0, set }, value);
        let setup = InverterSetup {
            properties,
            posicon: false,
            parameters: vec![
                at(1621, 0, 2),
                at(1624, 0, ADDRESS.into()),
                at(1625, 0, 50),
                at(1202, 0, 1),
                at(1615, 0, 200),
                // Set 2: a fault starts a quick stop.
                at(1614, 1, 1),
                at(1615, 1, 200),
            ],
            ..InverterSetup::default()
        };
        Self {
            drive: Drive::new(&setup, RATE, Instant::START),
            reference: ReferenceSlave::new(&setup),
            now: Instant::START,
            count: 0x60,
            last: Buffer::new(),
        }
    }

    fn happens(&mut self, operation: &SlaveStep, reached: &mut impl FnMut(DpCell)) {
        let SlaveStep { what, data, .. } = *operation;
        let [a, b, c, ..] = data;
        match what {
            0..=8 => self.send(operation, None, &self.outputs(what, &data), reached),
            9 => self.send(operation, Some(61), &parameters(&data), reached),
            10 => self.send(operation, Some(62), &self.configuration(a, b), reached),
            11 => {
                let watchdog = [0x80 | a & 0x38, b % 16, c, 0, 0x75, 0x31, data[3]];
                self.send(operation, Some(61), &watchdog, reached);
                let cfg = self.drive.slave().ppo().cfg();
                self.send(operation, Some(62), cfg, reached);
            }
            12 => {
                let sap = [60, 56, 57, 59, 60, 55, 58, b & 0x3F][usize::from(a % 8)];
                let more: &[u8] = if c % 8 == 7 { &[0] } else { &[] };
                self.send(operation, Some(sap), more, reached);
            }
            13 => self.control(operation, reached),
            14 if !self.last.is_empty() => self.telegram(&{ self.last }, None, reached),
            15 => self.telegram(&any_telegram(&data), None, reached),
            _ => self.world(a, b, reached),
        }
    }

    /// The outputs of a Data_Exchange: a word, a setpoint, and a task where the PPO type has a parameter channel.
    fn outputs(&self, what: u8, data: &[u8; 9]) -> Buffer {
        let [a, b, hsw_high, hsw_low, pke_high, pke_low, ind, high, low] = *data;
        let word = if what == 7 {
            u16::from_be_bytes([a, b])
        } else {
            WORDS[usize::from(a % 16)]
        };
        let ppo = self.drive.slave().ppo();
        let [word_high, word_low] = word.to_be_bytes();
        // As PPO2, of which each type is a part.
        let mut all = [low; 20];
        all[..8].copy_from_slice(&[pke_high, pke_low, ind, 0, 0, 0, high, low]);
        all[8..12].copy_from_slice(&[word_high, word_low, hsw_high, hsw_low]);
        let begin = if ppo.has_pkw() { 0 } else { 8 };
        let outputs = &all[begin..begin + ppo.octets()];
        if what != 8 {
            return octets(&[outputs]);
        }
        // Another length.
        let length = usize::from(b % 32);
        let shorter = &outputs[..outputs.len().min(length)];
        octets(&[shorter, &[a; 32][shorter.len()..length]])
    }

    /// Mostly the own configuration.
    fn configuration(&self, a: u8, b: u8) -> Buffer {
        match a % 4 {
            0 | 1 => octets(&[self.drive.slave().ppo().cfg()]),
            2 => octets(&[&[0xF3, b]]),
            _ => octets(&[&[0xF5; 3][..usize::from(b % 4)]]),
        }
    }

    fn control(&mut self, operation: &SlaveStep, reached: &mut impl FnMut(DpCell)) {
        let [command, group, more, ..] = operation.data;
        let all = [command, group, more];
        let data = if more == 0xFF { &all[..] } else { &all[..2] };
        let da = if more & 1 == 0 {
            self.drive.slave().address()
        } else {
            127
        };
        let octets = telegram(da, master(operation), 0x46, Some(58), data);
        self.transmit(&octets, operation, reached);
    }

    /// SRD with the count that belongs to it.
    fn send(
        &mut self,
        operation: &SlaveStep,
        sap: Option<u8>,
        data: &[u8],
        reached: &mut impl FnMut(DpCell),
    ) {
        let (upper, next) = match operation.how >> 2 & 3 {
            2 => (0x60, 0x50),
            3 => (0x40, 0x60),
            _ if self.count == 0x50 => (0x50, 0x70),
            _ => (self.count, 0x50),
        };
        self.count = next;
        let da = if operation.how >> 6 == 3 {
            operation.data[8] & 0x7F
        } else {
            self.drive.slave().address()
        };
        let octets = telegram(da, master(operation), upper | 0x0D, sap, data);
        self.transmit(&octets, operation, reached);
    }

    fn transmit(
        &mut self,
        octets: &Buffer,
        operation: &SlaveStep,
        reached: &mut impl FnMut(DpCell),
    ) {
        let damage = (operation.how >> 4 & 3 == 3).then_some(operation.data[7]);
        self.telegram(octets, damage, reached);
    }

    /// A telegram to both, and both must answer the same at the same time.
    fn telegram(&mut self, octets: &Buffer, damage: Option<u8>, reached: &mut impl FnMut(DpCell)) {
        let start = self.now + RATE.bit_time() * 33;
        let end = start + RATE.octet_time() * octets.len() as u64;
        self.pass(end, reached);
        let state = State::of(&self.drive);
        let (master, ppo) = (self.drive.slave().master(), self.drive.slave().ppo());
        let delay = RATE.bit_time() * self.reference.delay();
        let damaged = damage.map(|place| usize::from(place) % octets.len().max(1));
        let mut at = start;
        for (place, &octet) in octets.iter().enumerate() {
            let received = if damaged == Some(place) {
                Received::bad(octet ^ 1, LineError::Parity)
            } else {
                Received::good(octet)
            };
            at += RATE.octet_time();
            self.drive.hear(at, received);
        }
        let expected = match damaged {
            None => self.reference.telegram(end, octets),
            Some(_) => None,
        };
        let reply = self.drive.take_reply();
        let sent = reply.as_ref().map(|(_, reply)| &**reply);
        let expected = expected.as_deref();
        assert_eq!(sent, expected, "the reply to {octets}");
        self.now = end;
        if let Some((begin, reply)) = reply {
            assert_eq!(begin, end + delay, "the reply to {octets} begins");
            self.now = begin + RATE.octet_time() * reply.len() as u64;
            self.drive.sent(self.now);
            self.pass(self.now, reached);
        }
        let heard = TelegramEffect {
            octets,
            repeated: damaged.is_none() && self.reference.repeated(),
            master,
            before: state.dp,
            after: self.drive.slave().state(),
            ppo,
            executed: self.reference.executed(),
        };
        for event in heard.events(expected) {
            reached(DpCell { state, event });
        }
        self.last = *octets;
    }

    fn world(&mut self, a: u8, b: u8, reached: &mut impl FnMut(DpCell)) {
        let state = State::of(&self.drive);
        let event = match a % 6 {
            0 | 1 => {
                let lost = a.is_multiple_of(6);
                self.drive.set_link(self.now, lost);
                self.reference.set_link(self.now, lost);
                if lost { Event::Lost } else { Event::Found }
            }
            2 | 3 => {
                let code = (a % 6 == 2).then_some(b % 25 + 1);
                self.drive.inverter_mut().set_cause(self.now, code);
                self.reference.inverter.set_cause(self.now, code);
                if code.is_some() {
                    Event::Cause
                } else {
                    Event::Gone
                }
            }
            _ => return self.wait(Span::from_millis(u64::from(b) * 10), reached),
        };
        reached(DpCell { state, event });
    }

    fn wait(&mut self, time: Span, reached: &mut impl FnMut(DpCell)) {
        if time != Span::ZERO {
            self.now += time;
            self.pass(self.now, reached);
        }
    }

    /// Time passes until `to`, event by event.
    fn pass(&mut self, to: Instant, reached: &mut impl FnMut(DpCell)) {
        let mut quiet = true;
        while let Some(next) = self.drive.next_action().filter(|next| *next <= to) {
            let (state, faults) = (State::of(&self.drive), self.faults());
            self.drive.advance(next);
            let after = State::of(&self.drive);
            let events = [
                (after.dp != state.dp, Event::Watchdog),
                (self.faults() != faults, Event::Fault),
                (
                    after.drive != state.drive && self.faults() == faults,
                    Event::Standstill,
                ),
            ];
            for (_, event) in events.into_iter().filter(|(happened, _)| *happened) {
                quiet = false;
                reached(DpCell { state, event });
            }
        }
        self.drive.advance(to);
        self.reference.advance(to);
        if quiet {
            let state = State::of(&self.drive);
            reached(DpCell {
                state,
                event: Event::Quiet,
            });
        }
    }

    /// How often a time-out has occurred.
    fn faults(&self) -> Option<i64> {
        let parameter = harness_proto::nordac::Parameter::of(1806)?;
        self.drive
            .inverter()
            .parameter(parameter, Index { element: 9, set: 0 })
    }

    /// Both are in the same state and show the same.
    fn compare(&self) {
        let (slave, inverter) = (self.drive.slave(), self.drive.inverter());
        let state = match slave.state() {
            DpState::WaitPrm => 'W',
            DpState::WaitCfg => 'C',
            DpState::DataExch => 'D',
        };
        assert_eq!(state, self.reference.state(), "state of the module");
        assert_eq!(slave.address(), self.reference.address(), "address");
        let its = &self.reference.inverter;
        assert_eq!(inverter.words(), its.words(), "words in force");
        assert_eq!(
            inverter.inputs(self.now),
            its.inputs(self.now),
            "actual values"
        );
        // Rule 8, and section 13 of the reading.
        let off2 = inverter.words().stw & stw::NO_OFF2 == 0;
        assert!(
            !off2 || !inverter.state().output_on(),
            "the output is on under OFF2"
        );
        assert!(inverter.state().output_on() || inverter.frequency(self.now).is_zero());
        assert!(inverter.state() != DriveState::NotReady);
    }
}

fn master(operation: &SlaveStep) -> u8 {
    2 + (operation.how & 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nordac::property::property;
    use proptest::prelude::*;

    /// Operations of which most keep a master in data exchange.
    fn operations() -> impl Strategy<Value = Vec<u8>> {
        let what =
            prop_oneof![12 => 0..7_u8, 1 => 7..9_u8, 1 => 9..11_u8, 3 => Just(11), 6 => 12..17_u8];
        let how = prop_oneof![12 => Just(0_u8), 1 => any::<u8>()];
        let task = prop::sample::select(vec![
            0x1715_u16, 0x24B5, 0x2655, 0x1708, 0x64B2, 0x670E, 0x2640, 0x0000,
        ]);
        let data = prop_oneof![
            any::<[u8; 9]>(),
            (any::<[u8; 9]>(), task).prop_map(|(mut data, task)| {
                data[4..6].copy_from_slice(&task.to_be_bytes());
                data[6..8].fill(0);
                data
            })
        ];
        let operation = (what, how, data, any::<u8>()).prop_map(|(what, how, data, wait)| {
            let mut all = vec![what, how];
            all.extend(data);
            all.push(wait);
            all
        });
        let all = prop::collection::vec(operation, 1..60);
        (any::<u8>(), all).prop_map(|(variant, all)| {
            let start = vec![11, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0];
            let all = std::iter::once(start)
                .chain(all)
                .collect::<Vec<_>>()
                .concat();
            std::iter::once(variant).chain(all).collect()
        })
    }

    #[test]
    fn random_telegrams_agree() {
        property("random_telegrams_agree", &operations(), |bytes| {
            noted(&bytes, &mut Notebook::none())
        });
    }

    #[test]
    fn any_octets_agree() {
        let bytes = prop::collection::vec(any::<u8>(), 0..800);
        property("any_octets_agree", &bytes, |bytes| {
            noted(&bytes, &mut Notebook::none())
        });
    }

    #[test]
    fn any_tasks_are_answered() {
        let bytes = prop::collection::vec(any::<u8>(), 0..400);
        property("any_tasks_are_answered", &bytes, |bytes| {
            super::super::pkw(&bytes)
        });
    }

    /// A wrong drive is found: its setting is changed behind the back of the reference model.
    #[test]
    #[should_panic(expected = "the reply to")]
    fn a_difference_is_found() {
        let mut pair = VARIANTS[0].clone();
        pair.drive.inverter_mut().set_cause(Instant::START, Some(3));
        let start = SlaveStep {
            what: 11,
            how: 0,
            data: [0; 9],
            wait: 0,
        };
        pair.happens(&start, &mut |_| {});
        pair.happens(&SlaveStep { what: 0, ..start }, &mut |_| {});
    }
}
