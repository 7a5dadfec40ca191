//! A place in the ring: a device between its two links, with the faults of a drive.

use crate::fault::DriveFault;
use crate::novobus::device::Device;
use crate::novobus::fault_plan::FaultPlan;
use crate::novobus::link::Link;
use crate::novobus::mark::bits;
use crate::record::Remark;
use harness_proto::novobus::bus_end::{Deadline, Reaction, Relay};
use harness_proto::time::{Instant, Span};

/// A device in its place in the ring.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct RingNode<D> {
    device: D,
    powered: bool,
    stuck: Option<u8>,
    plan: FaultPlan<DriveFault>,
    remarks: Vec<Remark>,
    recording: bool,
    drive: u8,
    /// See [`Device::head_start`].
    head_start: Span,
}

impl<D: Device> RingNode<D> {
    pub(crate) fn new(device: D, drive: u8) -> Self {
        Self {
            head_start: device.head_start(),
            device,
            powered: true,
            stuck: None,
            plan: FaultPlan::default(),
            remarks: Vec::new(),
            recording: true,
            drive,
        }
    }

    /// The same place around another device.
    pub(crate) fn around<E: Device>(&self, device: E) -> RingNode<E> {
        RingNode {
            device,
            powered: self.powered,
            stuck: self.stuck,
            plan: self.plan.clone(),
            remarks: self.remarks.clone(),
            recording: self.recording,
            drive: self.drive,
            head_start: self.head_start,
        }
    }

    pub(crate) const fn is_recording(&self) -> bool {
        self.recording
    }

    pub(crate) fn device(&self) -> &D {
        &self.device
    }

    pub(crate) fn device_mut(&mut self) -> &mut D {
        &mut self.device
    }

    pub(crate) fn powered(&self) -> bool {
        self.powered
    }

    pub(crate) fn remarks(&self) -> &[Remark] {
        &self.remarks
    }

    pub(crate) fn stop_recording(&mut self) {
        self.remarks = Vec::new();
        self.recording = false;
    }

    /// Takes its remarks since the last call.
    pub(crate) fn take_remarks(&mut self) -> Vec<Remark> {
        std::mem::take(&mut self.remarks)
    }

    /// Forgets its remarks, and records those that come.
    pub(crate) fn record_anew(&mut self) {
        self.remarks.clear();
        self.recording = true;
    }

    /// Resets the node around a reset device, but keeps whether it records.
    pub(crate) fn restart(&mut self) {
        self.head_start = self.device.head_start();
        self.powered = true;
        self.stuck = None;
        self.begin();
    }

    /// Discards its remarks and the faults whose byte has not come.
    pub(crate) fn begin(&mut self) {
        self.plan.clear();
        self.remarks.clear();
    }

    /// Arms a fault for the `byte`-th byte on this drive's inbound link, lost ones included, counted from 1.
    pub(crate) fn arm(&mut self, byte: u64, fault: DriveFault) {
        self.plan.add(byte, fault);
    }

    /// Faults whose byte has not come yet.
    pub(crate) fn waiting_faults(&self) -> impl Iterator<Item = (u64, DriveFault)> + '_ {
        self.plan.waiting()
    }

    pub(crate) fn suffer(&mut self, fault: DriveFault, now: Instant, outbound: &mut Link) {
        match fault {
            DriveFault::Off => {
                self.device.advance(now);
                self.powered = false;
                outbound.silence(now);
            }
            DriveFault::On => {
                if !self.powered {
                    self.device.power_on(now);
                }
                self.powered = true;
            }
            DriveFault::Stuck(byte) => self.stuck = Some(byte),
            DriveFault::Unstuck => self.stuck = None,
        }
    }

    /// When something next happens here.
    pub(crate) fn next_event(&self, inbound: &Link, outbound: &Link) -> Instant {
        let deadline = match self.deadline() {
            None => Instant::NEVER,
            Some(Deadline::At(at)) => at,
            Some(Deadline::LineFree(from)) => outbound.line_free().max(from),
        };
        inbound.next_arrival().min(deadline)
    }

    #[inline]
    fn deadline(&self) -> Option<Deadline> {
        if self.powered {
            self.device.deadline()
        } else {
            None
        }
    }

    /// Does everything that is due here up to and including `until`.
    ///
    /// At one instant a time-out comes before a byte, and so does a drive's own first zero (it goes out
    /// before the neighbour's is answered, ND21 9.9); a byte comes before any later zero (with something
    /// to answer, none goes out unasked).
    pub(crate) fn run(&mut self, inbound: &mut Link, outbound: &mut Link, until: Instant) {
        self.run_bus(inbound, outbound, until);
        if self.powered {
            self.device.advance(until);
        }
    }

    fn run_bus(&mut self, inbound: &mut Link, outbound: &mut Link, until: Instant) {
        loop {
            let arrival = inbound.next_arrival();
            match self.deadline() {
                Some(Deadline::At(at)) if at <= arrival => {
                    if at > until {
                        return;
                    }
                    // Only a device that delays its answers sends here: in the error mode its own zeros too (ND21 9.9).
                    let solicited = !self.device.in_error();
                    self.act(at, solicited, outbound, inbound.arrived());
                    continue;
                }
                Some(Deadline::LineFree(from))
                    if outbound.line_free() < arrival
                        || from == arrival && outbound.line_free() == arrival =>
                {
                    let at = outbound.line_free().max(from);
                    if at > until {
                        return;
                    }
                    let solicited = !self.device.in_error();
                    self.act(at, solicited, outbound, inbound.arrived());
                    continue;
                }
                _ => {}
            }
            if arrival > until {
                return;
            }
            while let Some(fault) = self.plan.take(inbound.arrived() + 1) {
                self.suffer(fault, arrival, outbound);
            }
            self.take_byte(arrival, inbound, outbound);
        }
    }

    #[inline]
    fn take_byte(&mut self, now: Instant, inbound: &mut Link, outbound: &mut Link) {
        let Some(byte) = inbound.take() else { return };
        let Some(received) = byte.arrival().filter(|_| self.powered) else {
            return;
        };
        self.device.advance(now);
        let step = self.device.receive(now, received);
        self.finish(step, now, byte.solicited, inbound.arrived(), outbound);
    }

    fn act(&mut self, now: Instant, solicited: bool, outbound: &mut Link, received: u64) {
        self.device.advance(now);
        let step = self.device.handle_deadline(now);
        self.finish(step, now, solicited, received, outbound);
    }

    #[inline(always)]
    fn finish(
        &mut self,
        step: Reaction,
        now: Instant,
        solicited: bool,
        received: u64,
        outbound: &mut Link,
    ) {
        if let Some(byte) = step.byte {
            outbound.transmit(now - self.head_start, self.stuck.unwrap_or(byte), solicited);
        }
        self.remark(step, now, received, outbound.transmitted());
    }

    #[inline(always)]
    fn remark(&mut self, step: Reaction, now: Instant, received: u64, sent: u64) {
        if self.recording && !step.marks.is_empty() {
            self.remarks.push(Remark {
                station: self.drive,
                piece: received,
                answered_as: step.byte.map(|_| sent),
                at: now,
                bits: bits(step.marks, self.device.cause()),
            });
        }
    }

    /// What the device keeps of bytes that it only passes on; `None` where something of this place must see each byte.
    pub(crate) fn relay(&self) -> Option<Relay> {
        let whole = self.powered && self.stuck.is_none() && self.head_start == Span::ZERO;
        if !whole || self.plan.waiting().next().is_some() {
            return None;
        }
        self.device.relay()
    }

    /// The answer to a byte that arrives at `now`, the `received`-th; the answer is the `sent`-th that goes out. The caller transmits it.
    #[inline(never)]
    pub(crate) fn answer(
        &mut self,
        now: Instant,
        byte: u8,
        received: u64,
        sent: u64,
    ) -> Option<u8> {
        self.device.advance(now);
        let step = self.device.answer(now, byte);
        self.remark(step, now, received, sent);
        step.byte
    }
}
