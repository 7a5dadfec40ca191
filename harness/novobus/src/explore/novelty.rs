//! What a case shows: its features.
//!
//! A feature is an action of a drive's bus end and the state of the line at that time: which byte of which kind of telegram followed which
//! other byte, how the ring answered it, what the drives marked there (ND21 9.7) and for what reason.

use crate::explore::Case;
use crate::explore::MasterView;
use harness_bench::explore::pool::hash;
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::role::{Role, roles};
use harness_sim::novobus::mark::Mark as _;
use harness_sim::record::Trace;

/// The features of a run of the model; the same one may come several times.
#[must_use]
pub(crate) fn features(case: &Case, seen: &MasterView, trace: &Trace) -> Vec<u32> {
    let Ok(size) = RingSize::new(u64::from(case.drives)) else {
        return Vec::new();
    };
    let bytes = case.bytes();
    let sent: Vec<_> = bytes.iter().map(|byte| (*byte, true)).collect();
    let roles = roles(size, &sent);
    let role_at = |index: usize| roles.get(index).map_or(0, |role| number(*role));
    let mut found = Vec::with_capacity(2 * bytes.len() + trace.remarks.len() + 1);
    let mut before = 0;
    let mut last = None;
    for (index, byte) in bytes.iter().enumerate() {
        let role = role_at(index);
        let answer = match seen.received.get(index) {
            None => 0,
            Some((_, answer)) if answer.error.is_some() => 1,
            Some((_, answer)) if answer.byte == *byte => 2,
            Some((_, answer)) if answer.byte == 0 => 3,
            Some((_, answer)) if answer.byte < case.drives => 4,
            Some(_) => 5,
        };
        // Most bytes show what the one before has shown: idle bytes and zeros come in rows.
        if last.replace((before, role, answer)) != Some((before, role, answer)) {
            found.extend([hash(&[1, before, role]), hash(&[2, role, answer])]);
        }
        before = role;
    }
    for mark in &trace.remarks {
        let index = usize::try_from(mark.piece).unwrap_or(usize::MAX);
        let cause = mark.cause().map_or(0, |cause| u32::from(cause.code()));
        let signs = (0..7).fold(0, |signs, bit| {
            let marks = sign(bit);
            signs | u32::from(mark.marks().contains(marks)) << bit
        });
        found.push(hash(&[3, signs, cause, role_at(index.saturating_sub(1))]));
    }
    let surplus = seen.received.len().saturating_sub(bytes.len());
    found.push(hash(&[4, surplus.min(3) as u32]));
    let ring = case.ring();
    if ring > 0 {
        // Features of one ring are independent of those of the other ring.
        for feature in &mut found {
            *feature = hash(&[*feature, ring as u32]);
        }
    }
    found
}

fn sign(bit: u32) -> harness_proto::novobus::error_mode::Marks {
    use harness_proto::novobus::error_mode::Marks;
    const ALL: [Marks; 7] = [
        Marks::DETECTED,
        Marks::UPSTREAM,
        Marks::SEVENTEENTH,
        Marks::SEQUENCE,
        Marks::RECOVERED,
        Marks::ANSWER,
        Marks::CHECKSUM,
    ];
    ALL.get(bit as usize).copied().unwrap_or(Marks::NONE)
}

/// A number for what a byte is for, whichever drive is meant.
fn number(role: Role) -> u32 {
    let meant = |drive: Option<u8>| u32::from(drive.is_some());
    match role {
        Role::Idle => 1,
        Role::Sync => 2,
        Role::Address { drive } => 4 + meant(drive),
        Role::ProcessData { drive } => 6 + meant(drive),
        Role::CheckSequence => 8,
        Role::Foreign => 9,
        Role::Data { drive, address } => 10 + meant(drive) + 4 * u32::from(address >> 12 == 2),
        Role::Command { drive, section } => {
            let section = section.bytes().fold(0, |sum, b| sum * 31 + u32::from(b));
            100 + meant(drive) + (section % 10_000) * 2
        }
        Role::Check { length, writes, .. } => {
            let width = writes.map_or(0, |(_, width)| u32::from(width));
            50 + u32::from(length) + 8 * width
        }
    }
}
