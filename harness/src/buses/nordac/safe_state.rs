//! The safe state of NORDAC inverters: OFF2 with valid process words, held until the status word shows it. Zeros do not stop a motor.

use super::rig::talk::{Talk, TalkError};
use super::rig::{MASTER, RigSlave};
use crate::guard::{Guarded, Safe, Standstill, StandstillStep};
use crate::link::Line;
use harness_proto::nordac::master::ExchangeError;
use harness_proto::nordac::words::{State, stw, zsw};
use harness_proto::nordac::{IDENT, Image, PpoType};
use harness_proto::profibus::Telegram;
use harness_proto::profibus::dp::{Diagnosis, GlobalControl, Service, SetPrm};
use harness_proto::profibus::fdl::{MAX_TELEGRAM, SD1, SD2, SD3};
use harness_proto::profibus::master::Requests;
use harness_proto::time::Span;
use std::fmt::Write as _;

/// The DP watchdog of an exchange that is begun to stop a motor: 1 s.
const WATCHDOG: [u8; 2] = [1, 100];

/// The DP watchdog by which a slave forgets the bench: 100 ms.
const FORGET: [u8; 2] = [1, 10];

/// The time between two exchanges while a motor ramps down.
const AGAIN: Span = Span::from_millis(5);

/// This number of replies shows no output before an inverter counts as safe that does not take its words from the bus (1621): as many as replies may lag
/// behind (`pzd-latency`), and more.
const LAGGING: u32 = 22;

/// The bits of ZSW that show an output: ready, ready for operation, enabled.
const OUTPUT: u16 = zsw::READY_TO_START | zsw::READY | zsw::ENABLED;

/// The telegrams that stop every motor without waiting for anything: for a watchdog. Each is new to its slave, whatever it was sent last.
///
/// A slave that still exchanges data takes the first words. One whose own DP watchdog has expired before is in Wait_Prm and refuses them, while
/// its motor goes on running (2.6): each slave is therefore taken into the exchange again, and is sent the words once more. A slave of an unknown
/// PPO type refuses every configuration but its own.
#[must_use]
pub fn last_words(slaves: &[RigSlave]) -> Vec<Vec<u8>> {
    let telegram = |address, service: Service, data: &[u8]| {
        let mut first = Requests::new(MASTER, address).ok()?;
        let pdu = first.request(service, data).ok()?;
        Some(Telegram::Pdu(pdu).encode().to_vec())
    };
    let words = |address, ppo| telegram(address, Service::DataExchange, &safe_image().encode(ppo));
    let at_once = slaves.iter().filter_map(|own| words(own.address, own.ppo?));
    let again = slaves.iter().flat_map(|slave| {
        let address = slave.address;
        let known = slave.ppo.map_or(PpoType::ALL.to_vec(), |ppo| vec![ppo]);
        known.into_iter().flat_map(move |ppo| {
            let mut parameters = SetPrm::lock(IDENT);
            parameters.status |= SetPrm::WATCHDOG;
            parameters.watchdog = WATCHDOG;
            let parameters = parameters.encode().unwrap_or_default();
            [
                telegram(address, Service::SetPrm, &parameters),
                telegram(address, Service::ChkCfg, ppo.cfg()),
                words(address, ppo),
            ]
        })
    });
    at_once.chain(again.flatten()).collect()
}

fn image(word: u16) -> Image {
    Image {
        words: [word, 0, 0, 0, 0, 0],
        ..Image::default()
    }
}

fn safe_image() -> Image {
    image(stw::SAFE)
}

/// Takes every inverter to its safe state and reads it back. One that runs is first stopped on its quick-stop ramp (1615), where the rig's
/// file wants a stop, for as long as the file says; then its output is switched off (OFF2, 047D), until the status word shows it.
pub fn safe_state<L: Line>(
    line: &mut Guarded<L>,
    slaves: &[RigSlave],
    patience: Span,
    standing: &Standstill,
) -> Safe {
    let mut reports = String::new();
    let mut confirmed = true;
    finish_telegrams(line);
    let places = slaves.iter().map(|own| match line.slaves() {
        Some(gate) => gate.places(own.address).collect(),
        None => vec![own.address],
    });
    let places: Vec<Vec<u8>> = places.collect();
    let mut talk = Talk::new(Box::new(&mut *line), patience);
    for (slave, places) in slaves.iter().zip(&places) {
        let made = make_safe(&mut talk, *slave, places, standing);
        let address = slave.address;
        // Writing to a String cannot fail.
        let _infallible = match made {
            Ok(report) => write!(reports, "\n  slave {address}: {report}"),
            Err(why) => {
                confirmed = false;
                write!(reports, "\n  slave {address}: NOT confirmed: {why}")
            }
        };
    }
    let words = match confirmed {
        true => format!("safe state: the output of every inverter is off{reports}"),
        false => format!("the safe state is NOT confirmed; use the emergency stop{reports}"),
    };
    Safe { confirmed, words }
}

/// Ends telegrams of which a part was sent: the next octet could be their FCS.
fn finish_telegrams<L: Line>(line: &mut Guarded<L>) {
    for _ in 0..MAX_TELEGRAM {
        if line.slaves().is_none_or(|gate| gate.at_rest()) {
            return;
        }
        let begins = |octet: &u8| [SD1, SD2, SD3].contains(octet);
        let harmless = (0..=u8::MAX).filter(|octet| !begins(octet));
        let mut harmless =
            harmless.filter(|octet| line.permits(0, crate::medium::Out::Octets(&[*octet])));
        let Some(filler) = harmless.next() else {
            return;
        };
        drop(harmless);
        line.send(0, crate::medium::Out::Octets(&[filler]));
    }
}

/// Takes one inverter to its safe state. Returns what it shows, or why it is not confirmed.
fn make_safe(
    talk: &mut Talk<'_>,
    slave: RigSlave,
    places: &[u8],
    standing: &Standstill,
) -> Result<String, String> {
    let text = |error: TalkError| error.to_string();
    let (address, diagnosis) = found(talk, places)?;
    let exchanges = !diagnosis.has(Diagnosis::NOT_READY);
    let other = diagnosis.master.filter(|own| exchanges && *own != MASTER);
    if let Some(controls) = other {
        return Err(format!(
            "master {controls} controls it: stop it there, or switch that master off"
        ));
    }
    let found = talk.configuration(address).map_err(text)?;
    let ppo = found
        .or(slave.ppo)
        .ok_or("its configuration is of no PPO type")?;
    let mut off = Off {
        talk,
        address,
        ppo,
        standing,
    };
    let stops = standing.order.contains(&StandstillStep::Stop);
    let modes = [
        (Diagnosis::SYNC, GlobalControl::UNSYNC),
        (Diagnosis::FREEZE, GlobalControl::UNFREEZE),
    ];
    // Unsync may let a motor start, and needs permission: it is sent only where it is needed.
    let on = modes
        .into_iter()
        .filter(|(mode, _)| diagnosis.has_mode(*mode));
    let command = on.fold(0, |command, (_, own)| command | own);
    if command != 0 {
        // What waits for Sync is then the word that stops; a frozen status word shows nothing.
        off.exchange(if stops { stw::QUICK_STOP } else { stw::SAFE })?;
        off.talk.command(address, command).map_err(text)?;
    }
    if stops {
        off.stop()?;
    }
    if !standing.order.contains(&StandstillStep::Block) {
        return Ok("stopped".to_owned());
    }
    let shows = off.block()?;
    let shows = match release(talk, address) {
        Ok(()) => shows,
        // Its output is off all the same.
        Err(error) => format!("{shows}; it may go on waiting for the bench's master: {error}"),
    };
    Ok(match address == slave.address {
        true => shows,
        false => format!("{shows}, at address {address} (1624)"),
    })
}

/// The first of the addresses at which a slave may be and where a NORDAC replies, and its diagnosis there.
pub(super) fn found(talk: &mut Talk<'_>, places: &[u8]) -> Result<(u8, Diagnosis), String> {
    let mut why = None;
    for address in places {
        talk.restart(*address);
        match talk.diagnose(*address) {
            // A station that the rig's file does not list may have the address.
            Ok(diagnosis) if diagnosis.ident == IDENT || places.len() == 1 => {
                return Ok((*address, diagnosis));
            }
            Ok(_) => {}
            Err(TalkError::Line(trouble)) => return Err(trouble.to_string()),
            Err(error) => {
                why.get_or_insert(error.to_string());
            }
        }
    }
    let why = why.unwrap_or_else(|| "no address that it had is that of a NORDAC".to_owned());
    let others = places.iter().skip(1).map(u8::to_string);
    let others: Vec<_> = others.collect();
    Err(match others.is_empty() {
        true => why,
        false => format!(
            "{why}, nor is it at address {}, which it was given",
            others.join(" or ")
        ),
    })
}

/// Lets a slave forget the bench, so that any master can take it: without a watchdog it would be the bench's until its power goes (EN 2).
fn release(talk: &mut Talk<'_>, address: u8) -> Result<(), TalkError> {
    let mut parameters = SetPrm::lock(IDENT);
    parameters.status |= SetPrm::WATCHDOG;
    parameters.watchdog = FORGET;
    let parameters = parameters.encode().unwrap_or_default();
    talk.raw(address, Service::SetPrm, &parameters)?;
    Ok(())
}

/// An inverter on its way to the safe state.
struct Off<'t, 'l> {
    talk: &'t mut Talk<'l>,
    address: u8,
    ppo: PpoType,
    standing: &'t Standstill,
}

impl Off<'_, '_> {
    /// One exchange with a control word and setpoint 0; a slave that is not in the exchange is taken into it first. Gives the status word.
    fn exchange(&mut self, word: u16) -> Result<u16, String> {
        let text = |error: TalkError| error.to_string();
        let left = |error: &TalkError| {
            let why = ExchangeError::Left;
            matches!(error, TalkError::Exchange { why: own, .. } if *own == why)
        };
        let (address, ppo) = (self.address, self.ppo);
        match self.talk.exchange(address, ppo, &image(word)) {
            Err(error) if left(&error) => {
                let started = self.talk.start(address, ppo, Some(WATCHDOG));
                started.map_err(text)?;
                let again = self.talk.exchange(address, ppo, &image(word));
                Ok(again.map_err(text)?.first())
            }
            Err(error) => Err(error.to_string()),
            Ok(inputs) => Ok(inputs.first()),
        }
    }

    /// Stops on the quick-stop ramp. One that does not stand in time is switched off all the same.
    fn stop(&mut self) -> Result<(), String> {
        let end = self.talk.now() + self.standing.within;
        loop {
            let status = self.exchange(stw::QUICK_STOP)?;
            // OFF3 has been taken, and the output is off; or there is nothing on.
            let seen = status & zsw::NO_OFF3 == 0 && status & zsw::ENABLED == 0;
            let off = status & OUTPUT == 0;
            if seen || off || self.talk.now() >= end {
                return Ok(());
            }
            self.talk.pass(AGAIN).map_err(|error| error.to_string())?;
        }
    }

    /// Switches the output off, and waits until the status word shows that.
    fn block(&mut self) -> Result<String, String> {
        let end = self.talk.now() + self.standing.within;
        let mut off_for = 0;
        loop {
            let status = self.exchange(stw::SAFE)?;
            let off = status & OUTPUT == 0;
            off_for = if off { off_for + 1 } else { 0 };
            // ZSW bit 4 repeats OFF2: what is seen is behind the word that was sent.
            let seen = off && status & zsw::NO_OFF2 == 0;
            if seen || off_for >= LAGGING {
                let state = State::of_zsw(status).map_or("unknown", State::name);
                return Ok(format!("{state}, status word {status:04X}"));
            }
            if self.talk.now() >= end && off_for == 0 {
                return Err(format!(
                    "its status word reads {status:04X} {} after control word 047D was sent first: the output is on, or \
                     its terminals control it (1621)",
                    self.standing.within
                ));
            }
            self.talk.pass(AGAIN).map_err(|error| error.to_string())?;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::buses::nordac::gate::guarded;
    use crate::buses::nordac::rig::values;
    use crate::buses::nordac::simulate::{Bench, Setup, SlaveSetup};
    use crate::link::{DriveFault, Link, Moment, Octets, PlacedFault, Trouble};
    use harness_proto::nordac::Parameter;
    use harness_proto::nordac::guard::{GuardedSlave, Limits};
    use harness_proto::nordac::pkw::Index;
    use harness_proto::nordac::properties::PROPERTIES;
    use harness_proto::profibus::fdl::{FrameControl, Function, Sequence};
    use harness_proto::profibus::{BusRate, Pdu};

    const PATIENCE: Span = Span::from_millis(5);

    fn set(slave: &mut SlaveSetup, number: u16, value: i64) {
        let parameter = Parameter::of(number).expect("a parameter");
        slave.parameters.push((parameter, Index::default(), value));
    }

    /// An inverter that the bus controls (1621).
    fn slave(address: u8, ppo: PpoType) -> SlaveSetup {
        let mut slave = SlaveSetup::new(address);
        slave.ppo = ppo;
        set(&mut slave, 1621, 2);
        slave
    }

    fn line(slaves: Vec<SlaveSetup>, limits: Limits) -> (Guarded<Bench>, Vec<RigSlave>) {
        let known = slaves.iter().map(|own| RigSlave {
            address: own.address,
            ppo: Some(own.ppo),
        });
        let known: Vec<_> = known.collect();
        let setup = Setup {
            rate: BusRate::K500,
            slaves,
            master: None,
        };
        let gated: Vec<_> = known.iter().map(|own| GuardedSlave::from(*own)).collect();
        (guarded(Bench::new(&setup), limits, &gated, false), known)
    }

    /// Takes motors to a frequency.
    fn run(line: &mut Guarded<Bench>, slaves: &[RigSlave]) {
        let mut talk = Talk::new(Box::new(line), PATIENCE);
        for slave in slaves {
            let ppo = slave.ppo.expect("known");
            talk.start(slave.address, ppo, None).expect("starts");
            for word in [stw::READY, stw::START, stw::START] {
                let words = Image {
                    words: [word, 0x2000, 0, 0, 0, 0],
                    ..Image::default()
                };
                talk.exchange(slave.address, ppo, &words).expect("answers");
            }
            talk.pass(Span::from_millis(2_000)).expect("sound");
        }
    }

    fn is_on(line: &Guarded<Bench>, address: u8) -> bool {
        let drive = line.inner().drive(address).expect("a drive");
        drive.inverter().state().output_on()
    }

    fn safe(line: &mut Guarded<Bench>, slaves: &[RigSlave], order: &[StandstillStep]) -> Safe {
        let standing = Standstill {
            order: order.to_vec(),
            within: Span::from_millis(500),
            ..Standstill::default()
        };
        safe_state(line, slaves, PATIENCE, &standing)
    }

    /// In every PPO type and under every value of every open point: motors that run are off afterwards, and it is seen.
    #[test]
    fn motors_that_run_are_stopped_whatever_the_manual_leaves_open() {
        let mut all = PpoType::ALL
            .map(|ppo| vec![slave(8, ppo), slave(9, ppo)])
            .to_vec();
        for property in PROPERTIES {
            for word in values(property) {
                let mut own = slave(8, PpoType::One);
                assert!(property.set(&mut own.properties, &word), "{word}");
                all.push(vec![own]);
            }
        }
        for setup in all {
            let name = format!("{:?} {:?}", setup[0].ppo, setup[0].properties);
            let (mut line, slaves) = line(setup, Limits::unlimited());
            run(&mut line, &slaves);
            assert!(is_on(&line, 8), "{name}");
            let safe = safe(
                &mut line,
                &slaves,
                &[StandstillStep::Stop, StandstillStep::Block],
            );
            assert!(safe.confirmed, "{safe} {name}");
            for slave in &slaves {
                assert!(!is_on(&line, slave.address), "{name}");
            }
        }
    }

    /// Without permission for motion, with words that wait for Sync, and after the slave has fallen out of the exchange.
    #[test]
    fn other_ways_in() {
        let (mut line, slaves) = line(vec![slave(8, PpoType::One)], Limits::default());
        let none = safe(&mut line, &slaves, &[StandstillStep::Block]);
        assert!(none.confirmed, "{none}");
        for seconds in [0, 5] {
            let (mut line, slaves) = self::line(vec![slave(8, PpoType::One)], Limits::unlimited());
            run(&mut line, &slaves);
            match seconds {
                // Sync and Freeze, which Set_Prm asked for.
                0 => {
                    let prm = [0xB8, 1, 100, 0, 0x75, 0x31, 0];
                    let control = FrameControl::request(Function::SrdLow, Sequence::First);
                    let pdu = Pdu::with_saps(8, MASTER, control, Some(61), Some(62), &prm);
                    let prm = Telegram::Pdu(pdu.expect("fits")).encode();
                    let control = FrameControl::request(Function::SrdLow, Sequence::None);
                    let cfg = PpoType::One.cfg();
                    let pdu = Pdu::with_saps(8, MASTER, control, Some(62), Some(62), cfg);
                    let cfg = Telegram::Pdu(pdu.expect("fits")).encode();
                    let mut talk = Talk::new(Box::new(&mut line), PATIENCE);
                    for octets in [prm, cfg] {
                        talk.send(&octets).expect("sent");
                        talk.pass(PATIENCE).expect("sound");
                    }
                    let started = talk.exchange(8, PpoType::One, &image(stw::START));
                    started.expect("answers");
                    let both = GlobalControl::SYNC | GlobalControl::FREEZE;
                    talk.command(8, both).expect("sent");
                }
                // The watchdog ends the exchange.
                _ => {
                    let mut talk = Talk::new(Box::new(&mut line), PATIENCE);
                    let started = talk.start(8, PpoType::One, Some(WATCHDOG));
                    started.expect("starts");
                    talk.pass(Span::from_millis(5_000)).expect("sound");
                }
            }
            assert!(
                is_on(&line, 8),
                "zeros and an end of the exchange stop nothing"
            );
            let safe = safe(
                &mut line,
                &slaves,
                &[StandstillStep::Stop, StandstillStep::Block],
            );
            assert!(safe.confirmed && !is_on(&line, 8), "{safe}");
        }
    }

    /// The reply to a request of before comes behind the first request of the safe state. It is no reply to that.
    #[test]
    fn a_late_reply_is_not_taken_for_another() {
        let (mut line, slaves) = line(vec![slave(8, PpoType::One)], Limits::unlimited());
        run(&mut line, &slaves);
        let control = FrameControl::request(Function::SrdHigh, Sequence::First);
        let words = image(stw::START).encode(PpoType::One);
        let exchange = Pdu::new(8, MASTER, control, &words).expect("fits");
        line.send_octets(0, &Telegram::Pdu(exchange).encode());
        let safe = safe(
            &mut line,
            &slaves,
            &[StandstillStep::Stop, StandstillStep::Block],
        );
        assert!(safe.confirmed && !is_on(&line, 8), "{safe}");
    }

    #[test]
    fn a_silent_slave_is_not_confirmed_and_the_others_are_stopped() {
        let both = vec![slave(8, PpoType::One), slave(9, PpoType::One)];
        let (mut line, slaves) = line(both, Limits::unlimited());
        run(&mut line, &slaves[1..]);
        line.inject(0, PlacedFault::Drive(8, DriveFault::Off), Moment::Now);
        let safe = safe(&mut line, &slaves, &[StandstillStep::Block]);
        assert!(!safe.confirmed);
        assert!(
            safe.words
                .contains("slave 8: NOT confirmed: slave 8 does not reply to Slave_Diag"),
            "{safe}"
        );
        assert!(safe.words.contains("slave 9: start-disable"), "{safe}");
        assert!(!is_on(&line, 9));
    }

    /// An inverter that ignores OFF2 keeps its output on: that is seen, also where its first replies are from before the start (`pzd-latency`).
    /// On its quick-stop ramp it stops.
    #[test]
    fn an_output_that_stays_on_is_not_confirmed() {
        for latency in [1, 5, 20] {
            let mut deaf = slave(8, PpoType::One);
            deaf.deviation = harness_sim::nordac::deviation::deviation("no-off2");
            assert!(deaf.deviation.is_some());
            deaf.properties.pzd_latency = latency;
            let (mut line, slaves) = line(vec![deaf], Limits::unlimited());
            run(&mut line, &slaves);
            let safe = safe(&mut line, &slaves, &[StandstillStep::Block]);
            assert!(!safe.confirmed, "{latency}: {safe}");
            assert!(safe.words.contains("the output is on"), "{safe}");
            let safe = self::safe(&mut line, &slaves, &[StandstillStep::Stop]);
            assert!(safe.confirmed && !is_on(&line, 8), "{latency}: {safe}");
        }
    }

    /// A denied telegram of which the begin was sent, and whose FCS is the begin of the telegram that stops: it is ended first.
    #[test]
    fn a_begun_telegram_does_not_keep_the_stop_back() {
        let (mut line, slaves) = line(vec![slave(8, PpoType::One)], Limits::default());
        // 047F with an HSW that makes the FCS 68.
        let telegram = (0..=u16::MAX).find_map(|main| {
            let control = FrameControl::request(Function::SrdHigh, Sequence::First);
            let words = Image {
                words: [stw::START, main, 0, 0, 0, 0],
                ..Image::default()
            };
            let pdu = Pdu::new(8, MASTER, control, &words.encode(PpoType::One)).ok()?;
            let octets = Telegram::Pdu(pdu).encode().to_vec();
            (octets[octets.len() - 2] == SD2).then_some(octets)
        });
        let telegram = telegram.expect("one of them");
        line.send_octets(0, &telegram[..telegram.len() - 2]);
        assert_eq!(line.trouble(), None);
        line.send_octets(0, &[SD2]);
        assert!(matches!(line.trouble(), Some(Trouble::Denied(_))));
        line.reset_after_denial();
        let safe = safe(&mut line, &slaves, &[StandstillStep::Block]);
        assert!(safe.confirmed, "{safe}");
    }

    /// In the exchange, and in Wait_Prm after the DP watchdog of the slaves; with PPO types that are known, and with those that are not.
    #[test]
    fn last_words_switch_every_output_off() {
        for (waits, known) in [(0, true), (0, false), (5_000, true), (5_000, false)] {
            let all = PpoType::ALL.into_iter().zip(8..);
            let all = all.map(|(ppo, address)| slave(address, ppo)).collect();
            let (mut line, mut slaves) = line(all, Limits::unlimited());
            run(&mut line, &slaves);
            let mut talk = Talk::new(Box::new(&mut line), PATIENCE);
            for slave in &slaves {
                let ppo = slave.ppo.expect("known");
                let started = talk.start(slave.address, ppo, Some(WATCHDOG));
                started.expect("starts");
            }
            talk.pass(Span::from_millis(waits)).expect("sound");
            drop(talk);
            assert!(slaves.iter().all(|own| is_on(&line, own.address)));
            if !known {
                slaves.iter_mut().for_each(|own| own.ppo = None);
            }
            for telegram in last_words(&slaves) {
                line.send_octets(0, &telegram);
                let end = line.now() + PATIENCE;
                while line.now() < end && line.wait(end) {}
            }
            for slave in &slaves {
                assert!(!is_on(&line, slave.address), "{waits} {known} {slave:?}");
            }
        }
    }
}
