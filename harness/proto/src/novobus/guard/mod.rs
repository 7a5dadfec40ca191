//! The guard: which bytes may go onto a ring, decided from the bytes themselves.
//!
//! This is no safety function: an emergency stop must be wired.
//!
//! A [`Guard`] sits where bytes leave the program. It admits only a stream whose interpretation by every drive it knows:
//!
//! * It begins in **doubt**: a drive may be at any place in a telegram or a command, or in the error mode. In doubt only the
//!   bytes of the recovery pass (ND21 9.8): zeros; behind 17 of them SYNCO, PAUSE and the check sequence. The first of the 17 zeros
//!   complete any open telegram (at most 8 bytes), the others are bad sync bytes, and eight of these make a drive wait for the check
//!   sequence. A zero completes no command: 00 is never a checking byte (9.6) and never a command byte (9.5).
//! * Behind 17 zeros and the check sequence without a gap between them, a drive **waits for a sync byte** with half-received
//!   commands forgotten, or is still in the error mode and sends zeros down the ring. From then on telegrams are read as a drive
//!   reads them. A command is judged at its checking byte, the one without which it is not executed, and also where that is wrong; process
//!   data at the sync byte that announces them, as half of them must never stand before a zero.
//! * Every byte that puts a drive into the error mode brings doubt back: a bad sync byte, a wrong checking byte, a line error, eight zeros in
//!   a row. So does `ResetH8`, because a drive does not listen for a time after it.
//!
//! Where a bad sync byte has put every drive into the error mode, and 17 zeros follow, every drive waits for the check sequence and takes
//! nothing else (9.7, 9.8). Up to 8 bytes below 80 pass then in its place, which try what breaks a sequence off.
//!
//! A command is judged the same for every drive, so a wrong ring size or a neighbour that takes a short address
//! does not weaken the guard. Incomplete commands are kept for each address byte; "next" counts up from the last one (9.2).
//!
//! Drives in the error mode send what they receive plus 1 (9.7). Bytes that become FF 44 72 4C 41 by being
//! counted up would end the error mode of the drives behind such a drive, and later bytes would reach them counted up. So this
//! sequence, plus any number, passes only after 17 zeros, and then only as printed.
//!
//! If a rig has a `max_speed`, a command passes only if it cannot make a motor turn faster than that. One table (`table`) classifies each cell
//! as harmless, as a speed, or as a way to turn faster, with its section. A speed passes as a whole word within the limit, scaled by the
//! drive's own range. An order that makes a drive turn at a speed that it holds already, such as a release or a positioning, passes if the guard
//! knows that speed (`known`).
//!
//! Process data are written where `DataIn` (FF32) points (14.10.3). Unless everything is allowed, they pass if the guard knows that this is a cell
//! in which any word may be written.
//!
//! A drive whose time is up may keep what it receives for 10 ms, so that it does not reach the drives behind it (9.9). Where time-outs may be
//! monitored, nothing passes in this time after a silence in the middle of a telegram, a command or a recovery, and no recovery behind any silence
//! (`silence`). PAUSE counts as silence, as the first drive keeps it (9.2).
//!
//! What comes back is read for two things only (`listener`): what `DataIn` holds, and whether the EEPROM controller has done with a read, which
//! puts a byte over the address that the next write would take (14.10.5.2).
//!
//! The guard cannot protect against these:
//!
//! * An undetected bit error on a wire can turn one command into another: the parity bit detects an odd number of wrong bits in a
//!   byte, and the checking byte is a sum of 8 bits, which 1 wrong command in 256 passes. A lost or doubled byte behind the master can leave a drive
//!   out of step for the rest of a telegram.
//! * A command that another program left incomplete may be completed by a 01, which a preceding drive in the error mode makes of a zero.
//!   Process data that it left incomplete end with the next byte of any value (9.4), so with the first zero of the recovery.
//! * Silence that the computer does not know of, such as that of an adapter in the middle of a telegram.
//! * Actions of the drive itself: by its switches, its cycle control, its EEPROM after power-up. The guard judges only the bus.
//! * A regulator that overshoots the nominal speed.

mod asked;
mod denial;
mod doubt;
mod eeprom;
mod effect;
mod gate;
mod half;
mod known;
mod limits;
mod listener;
mod silence;
mod stage;
mod table;
mod tail;
#[cfg(test)]
mod tests;
mod touched;

/// Address bytes from here to FF mean one of 250 drives (ND21 8.4, 9.3); those below address no drive in any ring.
const FIRST_ADDRESS: u8 = 6;

pub use denial::{Cause, DeniedByte};
pub use effect::DriveAct;
pub use gate::Guard;
pub use known::{Configuration, Facts, Found};
pub use limits::{Limits, Need};
pub use stage::Stage;
pub use touched::Touched;
