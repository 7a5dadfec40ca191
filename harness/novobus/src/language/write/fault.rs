//! Faults.

use super::{link, ring_prefix};
use crate::language::syntax::{FaultKind, FaultStep, LinkFaultKind};
use harness_sim::fault::LinkFault;

/// What follows `!`: `98->97 byte 10: flip 0`, `drive 3 @20ms: off`.
pub(crate) fn fault(fault: &FaultStep) -> String {
    let place = match (&fault.byte, fault.at) {
        (Some(byte), _) => format!(" byte {byte}"),
        (None, Some(at)) => format!(" @{at}"),
        (None, None) => String::new(),
    };
    let prefix = ring_prefix(fault.ring);
    match &fault.what {
        FaultKind::Link(_, ends, kind) => {
            format!("{}{place}: {}", link(fault.ring, ends), on_link(*kind))
        }
        FaultKind::Drive(drive, fault) => format!("drive {prefix}{drive}{place}: {fault}"),
        FaultKind::Error(drive, error) => {
            format!("drive {prefix}{drive}{place}: error {:04X}", error.code())
        }
    }
}

fn on_link(kind: LinkFaultKind) -> String {
    let fault = match kind {
        LinkFaultKind::Delay(time) => return format!("delay {time}"),
        LinkFaultKind::Break(time) => return format!("break {time}"),
        LinkFaultKind::Flip(flips) => LinkFault::Flip(flips),
        LinkFaultKind::Replace(byte) => LinkFault::Replace(byte),
        LinkFaultKind::Drop => LinkFault::Drop,
        LinkFaultKind::Duplicate => LinkFault::Duplicate,
        LinkFaultKind::Insert(byte) => LinkFault::Insert(byte),
        LinkFaultKind::Overrun => LinkFault::Overrun,
        LinkFaultKind::Cut => LinkFault::Cut,
        LinkFaultKind::Join => LinkFault::Join,
    };
    fault.to_string()
}
