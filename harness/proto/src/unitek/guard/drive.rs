//! What the gate knows of one drive, from the frames that were sent to it.

use super::speed::Speed;
use crate::unitek::frame::{Data, Request, low};
use crate::unitek::words::MODE_LOCK;
use alloc::vec::Vec;

/// What the gate knows of a drive.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct GuardedDrive {
    /// As the rig's file names it.
    pub(super) first_rx: u16,
    pub(super) first_tx: u16,
    /// On which it may receive: after a write to 68 the old and the new one, since it is open when the drive changes.
    pub(super) rx: Vec<u16>,
    pub(super) tx: Vec<u16>,
    /// On which it receives for certain, if on one of them: its first one, until a write to 68 may have changed it, or where it has
    /// answered since.
    sure_rx: Option<u16>,
    /// On which it may receive and send as well: what has been written to 88 and 89 (`second-identifiers`).
    second: Vec<u16>,
    second_tx: Vec<u16>,
    /// A lock written through this gate is in force.
    pub(super) locked: bool,
    /// Registers with a cycle and their intervals in ms.
    pub(super) cycles: Vec<(u8, u8)>,
    /// Registers of which a cycle was started since the drive was last seen to send none, and their longest intervals in ms.
    pub(super) started: Vec<(u8, u8)>,
    /// New bus settings have been written since the last restart.
    pub(super) moved: bool,
    /// What was written to 73 last.
    pub(super) timing: Option<u16>,
    pub(super) speed: Speed,
    /// What it held before, outside of the stated ranges too.
    pub(super) before: Vec<(u8, u32)>,
}

impl GuardedDrive {
    pub(super) fn new((rx, tx): (u16, u16)) -> Self {
        Self {
            first_rx: rx,
            first_tx: tx,
            rx: [rx].to_vec(),
            tx: [tx].to_vec(),
            sure_rx: Some(rx),
            second: Vec::new(),
            second_tx: Vec::new(),
            locked: false,
            cycles: Vec::new(),
            started: Vec::new(),
            moved: false,
            timing: None,
            speed: Speed::default(),
            before: Vec::new(),
        }
    }

    /// Whether it may hear a frame with this identifier of 11 bits.
    pub(super) fn may_hear(&self, number: u32) -> bool {
        let mut all = self.rx.iter().chain(&self.second);
        all.any(|&rx| u32::from(rx) == number)
    }

    /// Whether it hears frames with this identifier for certain.
    pub(super) fn hears(&self, number: u32) -> bool {
        self.sure_rx.map(u32::from) == Some(number)
    }

    /// Whether it may receive or send on an identifier.
    pub(super) fn may_use(&self, id: u16) -> bool {
        self.receives().chain(self.sends()).any(|used| used == id)
    }

    /// On which it may receive, its first identifier before the others, of these the latest first.
    pub(super) fn receives(&self) -> impl Iterator<Item = u16> {
        in_order(self.first_rx, &self.rx, &self.second)
    }

    /// The same for sending.
    pub(super) fn sends(&self) -> impl Iterator<Item = u16> {
        in_order(self.first_tx, &self.tx, &self.second_tx)
    }

    /// The identifier that a write of `value` to `register` would give it, although it is taken: another drive may use it, or this one for
    /// the other direction.
    pub(super) fn taken(&self, register: u8, value: u16, others: &[Self]) -> Option<u16> {
        let used_here = match register {
            0x68 | 0x88 => self.sends().any(|id| id == value),
            0x69 | 0x89 => self.receives().any(|id| id == value),
            _ => return None,
        };
        let mut others = others
            .iter()
            .filter(|other| other.first_rx != self.first_rx);
        (used_here || others.any(|other| other.may_use(value))).then_some(value)
    }

    /// It has answered on this identifier.
    pub(super) fn found(&mut self, rx: u16) {
        if !self.receives().any(|known| known == rx) {
            self.rx.push(rx);
        }
        self.sure_rx = Some(rx);
    }

    /// Its identifiers are those of the rig's file, and it hears no other.
    pub(super) fn settled(&mut self) {
        self.rx = [self.first_rx].to_vec();
        self.tx = [self.first_tx].to_vec();
        self.second.clear();
        self.second_tx.clear();
        self.sure_rx = Some(self.first_rx);
    }

    /// It sends nothing by itself.
    pub(super) fn sends_nothing(&mut self) {
        self.cycles.clear();
        self.started.clear();
    }

    /// It was restarted, or frames were lost.
    pub(super) fn doubt(&mut self) {
        self.locked = false;
        self.speed = Speed::default();
        if self.moved {
            self.sure_rx = None;
        }
    }

    /// Keeps the state that an admitted frame leads to. `sure`: every drive reads the frame so.
    pub(super) fn follow(&mut self, request: Request, sure: bool) {
        match request {
            Request::Read { .. } => {}
            Request::Cycle { register, every } => {
                self.cycles.retain(|(with, old)| {
                    // An interval that may still be in force counts until it is certain.
                    *with != register || (!sure && *old < every)
                });
                if !self.cycles.iter().any(|(with, _)| *with == register) {
                    self.cycles.push((register, every));
                }
                match self.started.iter_mut().find(|cycle| cycle.0 == register) {
                    Some((_, longest)) => *longest = every.max(*longest),
                    None => self.started.push((register, every)),
                }
            }
            Request::Stop { register } if sure => {
                self.cycles.retain(|(with, _)| *with != register);
            }
            Request::Stop { .. } => {}
            Request::Write { register, data } => self.written(register, data, sure),
        }
    }

    pub(super) fn written(&mut self, register: u8, data: Data, sure: bool) {
        let value = low(data.bits());
        self.speed.written(register, value, sure);
        let list = match register {
            0x68 => Some(&mut self.rx),
            0x69 => Some(&mut self.tx),
            0x88 => Some(&mut self.second),
            0x89 => Some(&mut self.second_tx),
            _ => None,
        };
        // With a number that is none of 11 bits no drive can be reached.
        if let Some(list) = list.filter(|_| (1..=0x7FF).contains(&value)) {
            list.retain(|id| *id != value);
            list.push(value);
        }
        match register {
            0x51 if value & MODE_LOCK == 0 => self.locked = false,
            0x51 => self.locked |= sure,
            // 83 brings the identifiers of the EEPROM back.
            0x68 => self.sure_rx = None,
            0x73 => self.timing = Some(value),
            0x83 if self.moved => self.sure_rx = None,
            _ => {}
        }
        self.moved |= matches!(register, 0x68 | 0x69 | 0x73);
    }
}

/// The first identifier, then those that were given, the latest first.
fn in_order<'d>(first: u16, given: &'d [u16], second: &'d [u16]) -> impl Iterator<Item = u16> + 'd {
    let given = given.iter().rev().filter(move |id| **id != first);
    core::iter::once(first).chain(given.chain(second.iter().rev()).copied())
}
