//! What the frames of a drive hold: how long they must be, and what a register can read.

use super::follower::{Follower, Homing, PendingRequest};
use super::held::{Contents, is_live, takes_writes};
use super::symptom::FrameSymptom::{Length, Value};
use harness_proto::time::Instant;
use harness_proto::unitek::frame::Reply;
use harness_proto::unitek::words::{MODE_LOCK, status};
use harness_proto::unitek::{Access, Data, Register, Width};

impl Follower {
    /// How long a reply must be.
    pub(super) fn length(&mut self, number: usize, at: Instant, reply: &Reply) {
        let register = Register::of(reply.register);
        let long = matches!(reply.data, Data::Long(_));
        let map = matches!(reply.register, 0x40 | 0x8F);
        // What was read before DC was written may come after it.
        let settled = at.since(self.wide_at) > self.slowest.unwrap_or_default() + self.patience;
        let wide = self
            .wide
            .filter(|_| settled || self.wide_at == Instant::START);
        if settled && self.wide.is_none() && register.width == Width::Bits16 {
            self.wide = Some(long);
        }
        let wrong = match (register.width, wide) {
            (Width::Bits16, Some(wide)) => long != wide,
            (Width::Bits16, None) => false,
            (Width::Bits32, Some(true)) => !long,
            (Width::Bits32, _) => !long && !map,
        };
        if wrong {
            let (bytes, wanted) = if long { (6, 4) } else { (4, 6) };
            let about = format!(
                "register {:02X} ({}) comes with {bytes} bytes, and {wanted} are expected",
                reply.register, register.name
            );
            self.breach(number, reply.register, Length, "App 2", about);
        } else if map && wide == Some(false) && reply.register == 0x8F {
            // 8F is never sent by event, so that its length is that of `map-reply` for good.
            if self.short_map.is_some_and(|short| short == long) {
                let about = "register 8F comes with another length than before".to_owned();
                self.breach(number, reply.register, Length, "App 7", about);
            }
            self.short_map = Some(!long);
        }
    }

    /// Whether a register can read this.
    pub(super) fn value(&mut self, number: usize, reply: &Reply, asked: Option<&PendingRequest>) {
        let register = Register::of(reply.register);
        let raw = reply.data.bits();
        let locks = |held: &Contents| {
            let mode = held.sure();
            mode.is_some_and(|mode| mode & u32::from(MODE_LOCK) != 0)
        };
        if reply.register == 0x40
            && asked.is_some_and(|asked| locks(&asked.held) && locks(&self.held[0x51]))
            && raw & status::ENABLED != 0
        {
            let about = "STATUS shows the drive enabled, and MODE locks it".to_owned();
            let why = self.written_elsewhere(0x51);
            self.differs(number, reply.register, Value, "ex 2", about, why);
        }
        if is_live(reply.register) {
            return;
        }
        let mask = match (register.width, reply.data) {
            (Width::Bits32, Data::Long(_)) => u32::MAX,
            _ => 0xFFFF,
        };
        let place = usize::from(reply.register);
        let Some(asked) = asked else {
            return;
        };
        let whole = mask == u32::MAX || register.width == Width::Bits16;
        if self.refused.get(&reply.register) == Some(&(raw & mask)) && whole {
            let about = format!(
                "register {:02X} ({}) cannot be written, and reads what was written to it",
                reply.register, register.name
            );
            self.refused.remove(&reply.register);
            self.breach(number, reply.register, Value, "dump", about);
        }
        let homes = self.homes == Homing::AskedFor && reply.register == 0x6E;
        if register.access == Access::FN || homes {
            return;
        }
        let held = self.held[place].clone();
        if takes_writes(register) {
            self.judged.values += usize::from(held != Contents::any());
            if held.sure() == Some(raw & mask) {
                self.supply.kept(reply.register, raw & mask);
            }
            if !held.can_be(raw, mask) && !asked.held.can_be(raw, mask) {
                let digits = register.width.bits() as usize / 4;
                let about = format!(
                    "register {:02X} ({}) reads {:0digits$X}, and {} is expected by what was written or read before",
                    reply.register,
                    register.name,
                    raw & mask,
                    held.words(register.width)
                );
                let homes = reply.register == 0x6E && self.homes == Homing::Perhaps;
                let homes = homes.then(|| {
                    "homing that was asked for where the log has no frames sets it at its end (ex 12)"
                        .to_owned()
                });
                let why = self.written_elsewhere(reply.register).or(homes);
                self.differs(number, reply.register, Value, register.origin, about, why);
            }
        }
        if reply.register == 0xDC && asked.held == held {
            self.wide = Some(raw & 0x0100 != 0);
        }
        if whole && asked.held == held {
            self.held[place] = Contents::one(raw & mask);
            self.may_use(reply.register, raw);
        }
    }
}
