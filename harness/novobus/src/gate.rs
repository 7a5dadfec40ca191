//! The gate of a ring: its guard, and the bytes that a port damages on purpose.

use crate::driver::Axis;
use crate::language::run::over_bus::read_byte;
use harness_bench::guard::{Denied, Gate, Guarded, Restore};
use harness_bench::link::{
    Capability, DriveFault, Line, Link, LinkFault, Moment, Octets, PlacedFault,
};
use harness_bench::medium::{HeardPiece, Out};
use harness_proto::nd21::ram;
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::check_sequence::CHECK_SEQUENCE;
use harness_proto::novobus::guard::{Cause, DeniedByte, Guard, Limits, Touched};
use harness_proto::novobus::sync::SYNCO;
use harness_proto::time::Instant;
use std::any::Any;
use std::collections::{BTreeMap, BTreeSet};

/// Why no frame leaves through this gate.
const NO_FRAMES: &str = "frames are not sent: the guard judges the bytes of a ring only";

/// The gate of one ring, in doubt until the ring was [synchronised](Guarded::synchronise).
#[derive(Clone, Debug)]
pub(crate) struct RingGate {
    /// Which ring, counted from 0.
    ring: usize,
    size: RingSize,
    limits: Limits,
    guard: Guard,
    /// Data bits to be inverted in a byte that is sent damaged, by the number of the byte.
    damaged: BTreeMap<u64, u8>,
    /// Bytes handed on, denied ones not counted: the numbers of the link's own.
    sent: u64,
    /// A link was cut in this conversation, and is whole again behind it.
    cut: bool,
}

/// What is to be done about a fault.
enum FaultVerdict {
    /// It changes no byte: at most an error is noticed.
    Harmless,
    /// A byte that the master sends arrives with these data bits inverted, and with an error.
    Damages { byte: u64, data: u8 },
    /// Drives may be out of step after it.
    Doubt,
    /// It cannot be judged what drives make of it.
    Open,
}

impl RingGate {
    fn new(ring: usize, size: RingSize, limits: Limits) -> Self {
        Self {
            ring,
            size,
            limits,
            guard: Guard::new(size, limits),
            damaged: BTreeMap::new(),
            sent: 0,
            cut: false,
        }
    }

    /// Judges a byte as it will be, and as it would be if the port did not damage it.
    fn admit_byte(&mut self, now: Instant, byte: u8) -> Result<(), DeniedByte> {
        let number = self.sent + 1;
        match self.damaged.get(&number) {
            None => self.guard.admit(now, byte, false)?,
            Some(data) => {
                self.guard.clone().admit(now, byte, false)?;
                self.guard.admit(now, byte ^ data, true)?;
                self.damaged.remove(&number);
            }
        }
        self.sent = number;
        Ok(())
    }

    fn denied(&self, denial: DeniedByte) -> Denied {
        Denied {
            why: format!("ring {}: {denial}", self.ring + 1),
            settings: self.limits.denying(denial.cause).collect(),
        }
    }

    /// The drive with this address byte; `None` if the ring has none.
    fn drive_at(&self, address: u8) -> Option<u8> {
        let drive = address.wrapping_add(self.size.drives());
        (drive < self.size.drives()).then_some(drive)
    }

    /// What a fault may do to the bytes that drives hear.
    fn verdict(&self, fault: PlacedFault, moment: Moment, settled: bool) -> FaultVerdict {
        match fault {
            PlacedFault::Stimulus(..) | PlacedFault::Drive(_, DriveFault::Off) => {
                FaultVerdict::Harmless
            }
            PlacedFault::Link(link, LinkFault::Flip(flips)) if flips.noticed().is_some() => {
                match moment {
                    _ if flips.data == 0 => FaultVerdict::Harmless,
                    Moment::Byte(byte) if link == 0 && byte > self.sent => {
                        let data = flips.data;
                        FaultVerdict::Damages { byte, data }
                    }
                    Moment::Now if link == 0 && settled => {
                        let (byte, data) = (self.sent + 1, flips.data);
                        FaultVerdict::Damages { byte, data }
                    }
                    _ => FaultVerdict::Open,
                }
            }
            // What a cut link has lost matters when it is joined again, at the latest by the next conversation.
            PlacedFault::Link(_, LinkFault::Cut | LinkFault::Delay(_)) => FaultVerdict::Harmless,
            // Bytes are lost on the way: drives that nothing tells of it are out of step.
            PlacedFault::Drive(_, DriveFault::On) | PlacedFault::Link(_, LinkFault::Join)
                if settled =>
            {
                FaultVerdict::Doubt
            }
            PlacedFault::Link(..) | PlacedFault::Frame(_) | PlacedFault::Drive(..) => {
                FaultVerdict::Open
            }
        }
    }
}

fn no_frames() -> Denied {
    Denied {
        why: NO_FRAMES.to_owned(),
        settings: Vec::new(),
    }
}

impl Gate for RingGate {
    fn admit(&mut self, now: Instant, what: Out<'_>) -> (usize, Option<Denied>) {
        if !what.frames().is_empty() {
            return (0, Some(no_frames()));
        }
        for (admitted, &byte) in what.octets().iter().enumerate() {
            if let Err(denial) = self.admit_byte(now, byte) {
                return (admitted, Some(self.denied(denial)));
            }
        }
        (what.len(), None)
    }

    fn denies(&self, now: Instant, what: Out<'_>) -> Option<Denied> {
        if !what.frames().is_empty() {
            return Some(no_frames());
        }
        let mut guard = self.guard.clone();
        let mut admit = |byte: &u8| guard.admit(now, *byte, false);
        let judged = what.octets().iter().try_for_each(&mut admit);
        judged.err().map(|denial| self.denied(denial))
    }

    fn probe(&mut self, now: Instant, octets: &[u8], copy: bool) -> Result<(), Denied> {
        let mut guard = self.guard.clone();
        let mut admit = |byte: &u8| guard.admit(now, *byte, false);
        let judged = octets.iter().try_for_each(&mut admit);
        judged.map_err(|denial| self.denied(denial))?;
        if !copy {
            self.guard = guard;
            self.sent += octets.len() as u64;
        }
        Ok(())
    }

    fn fault(&mut self, fault: PlacedFault, moment: Moment, settled: bool) -> Result<(), Denied> {
        if self.limits.allow_everything() {
            return Ok(());
        }
        match self.verdict(fault, moment, settled) {
            FaultVerdict::Harmless => {
                self.cut |= matches!(fault, PlacedFault::Link(_, LinkFault::Cut))
            }
            FaultVerdict::Damages { byte, data } => *self.damaged.entry(byte).or_default() ^= data,
            FaultVerdict::Doubt => {
                self.guard.doubt();
                self.guard.forget();
            }
            FaultVerdict::Open => {
                let why = format!(
                    "ring {}: the fault `{fault}` is not made: what drives take changed or lost bytes for cannot be \
                     judged, so it needs everything allowed in the rig's [limits], --allow-motion, and no `max_speed`",
                    self.ring + 1
                );
                let settings = self.limits.denying(Cause::InDoubt).collect();
                return Err(Denied { why, settings });
            }
        }
        Ok(())
    }

    fn hear(&mut self, heard: &HeardPiece) {
        if let Some(octet) = heard.octet() {
            self.guard.hear(octet);
        }
    }

    fn begin(&mut self) {
        // What was read of the drives still holds: they have heard nothing else.
        if std::mem::take(&mut self.cut) {
            self.guard.doubt();
        }
        self.guard.begin();
        self.sent = 0;
        self.damaged.clear();
    }

    fn at_rest(&self) -> bool {
        self.guard.at_rest()
    }

    fn can_pause(&self) -> bool {
        let kept = self.guard.kept();
        kept.is_none_or(|address| self.drive_at(address).is_some())
    }

    fn addressed(&self) -> Option<u8> {
        self.guard.kept()
    }

    /// A short address goes on from the drive that it went on from before (ND21 9.2).
    fn restore(&self, before: Option<u8>) -> Option<Restore> {
        if self.guard.kept() == before {
            return None;
        }
        let (ring, drives) = (self.ring, self.size.drives());
        let drive = self.drive_at(before?)?;
        Some(Box::new(move |line| {
            let _again = read_byte(line, drives, (ring, drive), ram::STATUS);
        }))
    }

    fn assume_fresh(&mut self) {
        self.guard.assume_fresh();
    }

    fn reset_after_denial(&mut self) {
        self.guard.reset_after_denial();
    }

    fn lift_caps(&mut self) {
        self.guard.lift_caps();
    }

    fn know_as(&mut self, other: &dyn Gate) {
        let other: &dyn Any = other;
        if let Some(other) = other.downcast_ref::<Self>() {
            self.guard.know_as(&other.guard);
        }
    }

    fn waits_until(&self, now: Instant, what: Out<'_>) -> Option<Instant> {
        self.guard.waits_until(now, what.octets())
    }

    fn ends(&mut self, at: Instant) {
        self.guard.ends(at);
    }

    fn expect_time_outs(&mut self) {
        self.guard.expect_time_outs();
    }

    fn may_keep(&self) -> bool {
        self.limits.bytes_per_second.is_none()
    }

    fn filler(&self) -> Option<u8> {
        self.guard.at_rest().then_some(SYNCO)
    }
}

/// A guarded link of rings, in doubt until it was [synchronised](GuardsRings::synchronise). What the limits deny is no capability of it.
pub(crate) fn guard_rings<L: Link>(inner: L, limits: Limits) -> Guarded<L> {
    // A link has one ring or two; a ring that it does not have has no drives.
    let size = |ring: usize| RingSize::new(inner.drives(ring).into()).ok();
    let gates = (0..2)
        .map_while(|ring| Some(Box::new(RingGate::new(ring, size(ring)?, limits)) as _))
        .collect();
    let has = |capability: &Capability| match capability {
        Capability::Motion => limits.motion,
        Capability::Eeprom => limits.eeprom,
        // A reset ends block and stop (ND21 11.8).
        Capability::Reset => limits.reset && limits.motion,
        _ => true,
    };
    let capabilities = inner.capabilities().iter().copied();
    let capabilities = capabilities.filter(has).collect();
    Guarded::behind(inner, gates, capabilities)
}

/// A line behind the gates of rings.
pub(crate) trait GuardsRings {
    /// Sends 17 zeros and the check sequence on every ring (ND21 9.8), waits until they have come round, and takes what came. Behind
    /// it commands pass, as far as they are allowed.
    fn synchronise(&mut self);

    /// What it allows; nothing without a ring.
    fn limits(&self) -> Limits;

    fn sizes(&self) -> Vec<RingSize>;

    /// What may have changed in drives since the last call.
    fn take_touched(&mut self) -> BTreeSet<(Axis, Touched)>;

    /// Learns what was read of a drive.
    fn learn_of(&mut self, axis: Axis, learn: impl FnOnce(&mut Guard, u8));
}

fn rings<L: Line>(line: &Guarded<L>) -> impl Iterator<Item = &RingGate> {
    (0..2).map_while(|ring| line.gate(ring))
}

impl<L: Line> GuardsRings for Guarded<L> {
    fn synchronise(&mut self) {
        for (ring, size) in self.sizes().into_iter().enumerate() {
            let sent = self.send_octets(ring, &CHECK_SEQUENCE);
            let end = sent + self.byte_time() * (u64::from(size.drives()) + 8);
            while self.now() < end && self.wait(end) {}
            while self.receive(ring).is_some() {}
        }
    }

    fn limits(&self) -> Limits {
        rings(self)
            .next()
            .map_or_else(Limits::default, |gate| gate.limits)
    }

    fn sizes(&self) -> Vec<RingSize> {
        rings(self).map(|gate| gate.size).collect()
    }

    fn take_touched(&mut self) -> BTreeSet<(Axis, Touched)> {
        let mut all = BTreeSet::new();
        for ring in 0..2 {
            let Some(gate) = self.gate_mut::<RingGate>(ring) else {
                continue;
            };
            for (address, touched) in gate.guard.take_touched() {
                let drive = gate.drive_at(address);
                let axis = drive.and_then(|drive| Axis::new(ring, drive));
                all.extend(axis.map(|axis| (axis, touched)));
            }
        }
        all
    }

    fn learn_of(&mut self, axis: Axis, learn: impl FnOnce(&mut Guard, u8)) {
        let Some(gate) = self.gate_mut::<RingGate>(axis.ring()) else {
            return;
        };
        if let Ok(address) = gate.size.address_byte(axis.drive()) {
            learn(&mut gate.guard, address);
        }
    }
}
