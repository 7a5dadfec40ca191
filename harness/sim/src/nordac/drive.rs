//! The drive as a station of a line.

use super::inverter::Inverter;
use super::setup::InverterSetup;
use super::slave::{Receiver, Slave};
use crate::octet_segment::{LineStation, Octet, Wish};
use harness_proto::line::Received;
use harness_proto::nordac::Properties;
use harness_proto::profibus::{Buffer, BusRate, Telegram};
use harness_proto::time::Instant;
use std::hash::{Hash as _, Hasher};

/// A drive on a line.
#[derive(Clone, Debug)]
pub struct Drive {
    properties: Properties,
    rate: BusRate,
    receiver: Receiver,
    slave: Slave,
    inverter: Inverter,
    /// The reply that waits, and when it begins.
    reply: Option<(Instant, Buffer)>,
    /// Module and inverter as they were before the last telegram: an octet right after it makes it too long (EN 1).
    before: Option<(Slave, Inverter)>,
    /// Whether the last octet was such a one.
    torn: bool,
    powered: bool,
}

impl Drive {
    /// A drive that is switched on at `at`.
    #[must_use]
    pub fn new(setup: &InverterSetup, rate: BusRate, at: Instant) -> Self {
        let inverter = Inverter::new(setup, at);
        Self {
            slave: Slave::new(setup.properties, inverter.settings()),
            receiver: Receiver::new(rate, at),
            inverter,
            properties: setup.properties,
            rate,
            reply: None,
            before: None,
            torn: false,
            powered: true,
        }
    }

    /// The module.
    #[must_use]
    pub const fn slave(&self) -> &Slave {
        &self.slave
    }

    /// The inverter.
    #[must_use]
    pub const fn inverter(&self) -> &Inverter {
        &self.inverter
    }

    /// The inverter, to be changed by its inputs.
    pub fn inverter_mut(&mut self) -> &mut Inverter {
        self.before = None;
        &mut self.inverter
    }

    /// Whether it has power.
    #[must_use]
    pub const fn is_powered(&self) -> bool {
        self.powered
    }

    /// Feeds all that decides what it does from `at` on, but its properties, to a checksum. The line is idle, and no reply waits.
    pub fn hash_state(&self, at: Instant, sum: &mut impl Hasher) {
        self.powered.hash(sum);
        self.slave.hash_state(at, sum);
        self.inverter.hash_state(at, sum);
    }

    /// Switches the drive off or on. At power-up it has its settings, and everything else is as after power-up.
    pub fn set_power(&mut self, at: Instant, on: bool) {
        LineStation::advance(self, at);
        if on == self.powered {
            return;
        }
        self.powered = on;
        self.reply = None;
        self.before = None;
        if on {
            self.inverter.power_up(at);
            self.slave = Slave::new(self.properties, self.inverter.settings());
        }
    }

    /// Module and inverter lose each other, or find each other again (NORDAC 2.6).
    pub fn set_link(&mut self, at: Instant, lost: bool) {
        LineStation::advance(self, at);
        self.before = None;
        self.slave.link(at, lost, &mut self.inverter);
    }
}

impl Drive {
    /// Takes an octet; gives the telegram that it completes, to be answered by [`Drive::answer`]. A drive without power hears nothing.
    pub fn receive(&mut self, at: Instant, octet: Received) -> Option<Telegram> {
        self.hears_end(at, octet)
            .then(|| self.receiver.telegram())
            .flatten()
    }

    /// Takes an octet; `true` if it is the last one of what may be a telegram.
    #[inline]
    fn hears_end(&mut self, at: Instant, octet: Received) -> bool {
        self.torn = self.powered && self.receiver.tears(at);
        if !self.powered {
            self.receiver.skip(at);
            return false;
        }
        if self.torn {
            self.undo();
        }
        self.receiver.hear(at, octet)
    }

    /// The last telegram was none: module and inverter are as they were before it.
    #[cold]
    fn undo(&mut self) {
        if let Some((slave, inverter)) = self.before.take() {
            (self.slave, self.inverter) = (slave, inverter);
            self.reply = None;
        }
    }

    /// Answers the telegram that has just ended. A function of its own: most octets are no last ones.
    #[inline(never)]
    fn end(&mut self, at: Instant) {
        if let Some(telegram) = self.receiver.telegram() {
            self.answer(at, &telegram);
        }
    }

    /// Takes a telegram that has ended at `at`. The reply, if there is one, waits from now on.
    pub fn answer(&mut self, at: Instant, telegram: &Telegram) {
        LineStation::advance(self, at);
        self.before = Some((self.slave.clone(), self.inverter.clone()));
        // Set_Prm changes the delay of the replies behind its own.
        let delay = self.rate.bit_time() * self.slave.reply_delay_bits();
        if let Some(octets) = self.slave.hear(at, telegram, &mut self.inverter) {
            self.reply = Some((at + delay, octets));
        }
    }

    /// Whether the last octet followed a telegram without a gap: then that one was too long, and nothing was done.
    #[must_use]
    pub const fn torn(&self) -> bool {
        self.torn
    }

    /// The reply that waits, and when it begins.
    #[must_use]
    pub const fn reply(&self) -> Option<&(Instant, Buffer)> {
        self.reply.as_ref()
    }

    /// Takes the waiting reply out, so that it is not sent.
    pub const fn take_reply(&mut self) -> Option<(Instant, Buffer)> {
        self.reply.take()
    }

    /// The rate of the line.
    #[must_use]
    pub const fn rate(&self) -> BusRate {
        self.rate
    }
}

impl LineStation for Drive {
    #[inline]
    fn hear(&mut self, at: Instant, octet: Received) {
        if self.hears_end(at, octet) {
            self.end(at);
        }
    }

    fn wants(&self) -> Option<Wish> {
        self.reply.as_ref().map(|(ready, _)| Wish {
            ready: *ready,
            idle_bits: 0,
        })
    }

    fn begin(&mut self, _at: Instant, into: &mut Vec<Octet>) {
        if let Some((_, octets)) = self.reply.take() {
            into.extend(octets.iter().copied().map(Octet::from));
        }
    }

    fn sent(&mut self, at: Instant) {
        self.receiver.skip(at);
    }

    fn next_action(&self) -> Option<Instant> {
        if !self.powered {
            return None;
        }
        let slave = self.slave.next_action();
        slave.into_iter().chain(self.inverter.next_action()).min()
    }

    fn advance(&mut self, to: Instant) {
        while let Some(at) = self.next_action().filter(|at| *at <= to) {
            self.inverter.advance(at);
            self.slave.advance(at, &mut self.inverter);
        }
        if self.powered {
            self.inverter.advance(to);
        }
    }
}
