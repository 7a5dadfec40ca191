//! What is found out about drives before a scenario, and how they are made ready for it.

use super::super::known::KnownDrives;
use super::super::observed::Observed;
use super::super::probe;
use super::super::qualify::free;
use super::super::set_back::foretell;
use super::{AT_REST, AtRest, Player, RigScenario};
use crate::driver::{Driver, Error};
use harness_bench::link::Link;
use harness_bench::scenario::run::Outcome;
use harness_bench::scenario::run::outcome::Unready;
use harness_bench::scenario::verdict::Verdict;
use harness_proto::unitek::Register;
use harness_proto::unitek::frame::Data;
use harness_proto::unitek::words::MODE_LOCK;

const MODE: u8 = 0x51;

/// The commands of torque and of speed. The last one decides what the drive controls.
const COMMANDS: [u8; 2] = [0x90, 0x31];

impl Player {
    /// Reads the drives; the first time everything, and what the manual leaves open is settled.
    pub(super) fn learn(&mut self, link: &mut Observed<'_>) -> Result<(), Error> {
        let mut drives = match self.known.take() {
            Some(drives) => drives,
            None => {
                let again = self.axes.iter().map(|axis| {
                    let partly = self.partly.iter().find(|known| known.axis == *axis);
                    KnownDrives {
                        first: partly.map(|known| known.first.clone()).unwrap_or_default(),
                        ..KnownDrives::new(*axis)
                    }
                });
                again.collect()
            }
        };
        let learnt = drives
            .iter_mut()
            .try_for_each(|known| self.learn_of(known, link));
        match learnt {
            Ok(()) => {
                self.written.clear();
                self.known = Some(drives);
            }
            Err(_) => self.partly = drives,
        }
        learnt
    }

    /// Reads and probes one drive.
    fn learn_of(&self, known: &mut KnownDrives, link: &mut Observed<'_>) -> Result<(), Error> {
        let axes = [known.axis];
        if known.doubtful {
            *known = KnownDrives {
                first: std::mem::take(&mut known.first),
                ..KnownDrives::new(known.axis)
            };
        }
        let tolerance = link.time_tolerance();
        let driver = Driver::new(Box::new(&mut *link), &axes, self.patience);
        let mut driver = driver.outlasting(tolerance);
        if known.cells.is_empty() {
            known.read_all(&mut driver)?;
            drop(driver);
            let [free, _] = free(&self.axes, known.axis);
            let rx = known.axis.rx;
            let (written, given) = match self.qualifies && self.limits.bus_settings {
                true => (&probe::WRITTEN[..], &[(0x88, free, rx)][..]),
                false => (&probe::WRITTEN[..1], &[][..]),
            };
            let written = written.iter().map(|register| (rx, *register)).collect();
            foretell(&self.left, std::slice::from_ref(known), &written, given);
            probe::settle(known, link, self.patience)?;
            if self.qualifies {
                let (patience, rate) = (self.patience, self.rate);
                probe::settle_within(known, link, patience, rate, &self.limits, free)?;
            }
            self.left.foretell(Vec::new(), None);
            self.profile.settle(known, self.rate)?;
            let again = Driver::new(Box::new(&mut *link), &axes, self.patience);
            driver = again.outlasting(tolerance);
        }
        known.read_again(&mut driver, &self.written)
    }

    /// The outcome where the drives could not be made ready.
    pub(super) fn unanswered(&self, error: &Error) -> Outcome {
        let remark = error.to_string();
        match error {
            Error::Link(trouble) => Outcome::trouble(trouble),
            Error::OtherThanProfile { .. } => Outcome::rig_error(remark),
            // Nothing was ever heard of it.
            Error::NoReply { .. } if self.known.is_none() => Outcome::rig_error(remark),
            Error::NoReply { .. } => Outcome::not_ready(Verdict::Failed, Unready::NoAnswer, remark),
            // A drive may have reasons of its own to refuse a parameter.
            _ => Outcome::not_ready(Verdict::Inconclusive, Unready::Differs, remark),
        }
    }

    /// Makes the drives ready: locked, without commands, with the registers of the header, and released where motors may turn.
    pub(super) fn prepare(
        &self,
        scenario: &RigScenario,
        release: bool,
        link: &mut dyn Link,
    ) -> Result<AtRest, Error> {
        let tolerance = link.time_tolerance();
        let driver = Driver::new(Box::new(&mut *link), &self.axes, self.patience);
        let mut driver = driver.outlasting(tolerance);
        for axis in &self.axes {
            driver.write(*axis, MODE, Data::Short(MODE_LOCK))?;
            for register in COMMANDS {
                driver.write(*axis, register, Data::Short(0))?;
            }
        }
        let mut at_rest = Vec::new();
        for drive in &scenario.plan.setup.drives {
            let mut known = self.known().iter();
            let known = known.find(|known| known.axis.node == drive.node);
            let Some(known) = known else { continue };
            for (register, raw) in &drive.registers {
                if known.cells.get(register) != Some(raw) {
                    let data = Data::of(Register::of(*register), *raw);
                    driver.write(known.axis, *register, data)?;
                }
            }
            if release {
                driver.write(known.axis, MODE, Data::Short(0))?;
            }
            for register in AT_REST {
                let bits = match driver.read(known.axis, register) {
                    Ok(reply) => reply.data.bits(),
                    Err(Error::NoReply { .. }) => continue,
                    Err(error) => return Err(error),
                };
                at_rest.push((drive.node, register, bits));
            }
        }
        Ok(at_rest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rig::Axis;
    use crate::simulate::{Bench, Setup};
    use harness_proto::can::BitRate;
    use harness_proto::time::Span;
    use harness_proto::unitek::guard::Limits;
    use harness_proto::unitek::properties::UnknownRegister;

    /// A reply that a late computer has lost is no silence of the drive (dump: an unassigned register reads FACE).
    #[test]
    fn what_was_found_out_while_frames_were_lost_is_found_out_again() {
        let mut bench = Bench::new(&Setup::of(1));
        let axis = Axis {
            node: 1,
            rx: 0x201,
            tx: 0x181,
        };
        let (patience, limits) = (Span::from_millis(20), Limits::default());
        let can = Bench::CAPABILITIES.to_vec();
        let mut player = Player::of(vec![axis], BitRate::K500, patience, limits, can, true);
        let mut value = |player: &mut Player, change: UnknownRegister| {
            player
                .learn(&mut Observed::new(&mut bench))
                .expect("a drive");
            let known = &mut player.known.as_mut().expect("a drive")[0];
            std::mem::replace(&mut known.properties.unknown_register, change)
        };
        assert_eq!(
            value(&mut player, UnknownRegister::Silent),
            UnknownRegister::Face
        );
        assert_eq!(
            value(&mut player, UnknownRegister::Silent),
            UnknownRegister::Silent
        );
        player.forget();
        assert_eq!(
            value(&mut player, UnknownRegister::Face),
            UnknownRegister::Face
        );
    }
}
