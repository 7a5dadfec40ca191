//! The safe state of NORDAC inverters: OFF2 with valid process words, held until the status word shows it. Zeros do not stop a motor.

use super::rig::talk::{Talk, TalkError};
use super::rig::{MASTER, RigSlave};
use crate::gate::GuardsSlaves as _;
use harness_bench::guard::{Guarded, Safe, Standstill, StandstillStep};
use harness_bench::link::Line;
use harness_proto::nordac::master::{ExchangeError, StartError};
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

/// How often a slave is taken into the exchange that leaves it again.
const TRIES: usize = 3;

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
pub(crate) fn last_words(slaves: &[RigSlave]) -> Vec<Vec<u8>> {
    let telegram = |address, service: Service, data: &[u8]| {
        let mut first = Requests::new(MASTER, address).ok()?;
        let pdu = first.request(service, data).ok()?;
        Some(Telegram::Pdu(pdu).encode().to_vec())
    };
    let safe = Image::of_words(stw::SAFE, 0);
    let words = |address, ppo| telegram(address, Service::DataExchange, &safe.encode(ppo));
    let at_once = slaves.iter();
    let at_once = at_once.filter_map(|slave| words(slave.address, slave.ppo?));
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

/// Takes every inverter to its safe state and reads it back. One that runs is first stopped on its quick-stop ramp (1615), where the rig's
/// file wants a stop, for as long as the file says; then its output is switched off (OFF2, 047D), until the status word shows it.
pub(crate) fn safe_state<L: Line>(
    line: &mut Guarded<L>,
    slaves: &[RigSlave],
    patience: Span,
    standing: &Standstill,
) -> Safe {
    let mut reports = String::new();
    let mut confirmed = true;
    finish_telegrams(line);
    let places = slaves.iter().map(|slave| match line.slaves() {
        Some(gate) => gate.places(slave.address).collect(),
        None => vec![slave.address],
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
            harmless.filter(|octet| line.permits(0, harness_bench::medium::Out::Octets(&[*octet])));
        let Some(filler) = harmless.next() else {
            return;
        };
        drop(harmless);
        line.send(0, harness_bench::medium::Out::Octets(&[filler]));
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
    let other = diagnosis.master.filter(|to| exchanges && *to != MASTER);
    if let Some(controls) = other {
        return Err(format!(
            "master {controls} controls it: stop it there, or switch that master off"
        ));
    }
    let found = talk.configuration(address).map_err(text)?;
    let ppo = found
        .or(slave.ppo)
        .ok_or("its configuration is of no PPO type")?;
    let mut off = Shutdown {
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
    let command = on.fold(0, |command, (_, mode)| command | mode);
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

/// Whether a slave is not in the exchange: its DP watchdog may have expired.
fn has_left(error: &TalkError) -> bool {
    match error {
        TalkError::Exchange { why, .. } => *why == ExchangeError::Left,
        TalkError::Start { why, .. } => {
            matches!(
                why,
                StartError::NotActivated { .. } | StartError::Refused(_)
            )
        }
        _ => false,
    }
}

/// An inverter on its way to the safe state.
struct Shutdown<'t, 'l> {
    talk: &'t mut Talk<'l>,
    address: u8,
    ppo: PpoType,
    standing: &'t Standstill,
}

impl Shutdown<'_, '_> {
    /// One exchange with a control word and setpoint 0; a slave that is not in the exchange is taken into it first. It leaves it again where the
    /// computer stands still for longer than the DP watchdog, and is then taken into it once more. Gives the status word.
    fn exchange(&mut self, word: u16) -> Result<u16, String> {
        let (address, ppo) = (self.address, self.ppo);
        let (mut tries, mut refused) = (0..TRIES, None);
        loop {
            let exchanged = self.talk.exchange(address, ppo, &Image::of_words(word, 0));
            let error = match exchanged {
                Ok(inputs) => return Ok(inputs.first()),
                Err(error) if !has_left(&error) => return Err(error.to_string()),
                Err(error) => error,
            };
            if tries.next().is_none() {
                return Err(refused.unwrap_or(error).to_string());
            }
            refused = self.talk.start(address, ppo, Some(WATCHDOG)).err();
            if let Some(error) = refused.as_ref().filter(|error| !has_left(error)) {
                return Err(error.to_string());
            }
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
        let (mut off_for, mut asked) = (0, 0);
        loop {
            let status = self.exchange(stw::SAFE)?;
            asked += 1;
            let off = status & OUTPUT == 0;
            off_for = if off { off_for + 1 } else { 0 };
            // ZSW bit 4 repeats OFF2: what is seen is after the word that was sent.
            let seen = off && status & zsw::NO_OFF2 == 0;
            if seen || off_for >= LAGGING {
                let state = State::of_zsw(status).map_or("unknown", State::name);
                return Ok(format!("{state}, status word {status:04X}"));
            }
            // Replies lag behind also where the computer has stood still for all that time.
            if self.talk.now() >= end && off_for == 0 && asked >= LAGGING {
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
mod tests;
