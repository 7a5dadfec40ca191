//! The guard: which bytes may go onto a ring, decided from the bytes themselves.
//!
//! This is no safety function: an emergency stop must be wired.
//!
//! A [`Guard`] stands where bytes leave the program. It admits a stream of which it knows what every drive makes:
//!
//! * It begins in **doubt**: a drive may be anywhere in a telegram, in a command, in the error mode. In doubt only the
//!   bytes of the recovery pass (ND21 9.8): zeros; behind 17 of them SYNCO, PAUSE and the check sequence. 17 zeros use
//!   up what is left of any telegram (at most 8 bytes), then are bad sync bytes, and eight of those make a drive look for the check
//!   sequence. A zero completes no command: 00 is never a checking byte (9.6) and never a command byte (9.5).
//! * Behind 17 zeros and the check sequence without a gap between them, a drive **waits for a sync byte** with half-received
//!   commands forgotten, or is still in the error mode and sends zeros down the ring. From then on telegrams are read as a drive
//!   reads them. A command is judged at its checking byte, the one without which it is not executed; process
//!   data at the sync byte that announces them, as half of them must never stand before a zero.
//! * What a drive answers with its error mode brings doubt back: a bad sync byte, a wrong checking byte, a line error, eight zeros in
//!   a row; and `ResetH8`, behind which a drive is deaf for a time.
//!
//! Commands are judged without regard to whom they reach, so that a wrong size of the ring or a neighbour that takes a short address
//! changes nothing; halves of commands are kept for each address byte, "next" counts up from the last one (9.2).
//!
//! Drives in the error mode send what they receive plus 1 (9.7). Bytes that become FF 44 72 4C 41 by being
//! counted up would wake drives behind such a drive, and everything would reach them counted up. So this sequence, plus any number,
//! passes nowhere but behind 17 zeros, and then only as printed.
//!
//! Where a rig has a `max_speed`, a command passes only if no motor turns faster by it. Each cell stands in one table (`table`) as
//! harmless, as a speed, or as a way to turn faster, with its section. A speed passes as a whole word within the limit, counted in the drive's own
//! range. An order that makes a drive turn at a speed which it holds already, such as a release or a positioning, passes if the guard
//! knows that speed (`known`).
//!
//! What cannot be promised:
//!
//! * An undetected bit error on a wire can turn one command into another: the parity bit detects an odd number of wrong bits in a
//!   byte, and the checking byte is a sum of 8 bits, which 1 wrong command in 256 passes. A lost or doubled byte behind the master can leave a drive
//!   out of step for the rest of a telegram.
//! * A command that another program has left half-sent may end with a 01 that a drive before it makes of a zero. Process data
//!   that it has left half-sent end with the next byte, whichever that is (9.4), so with the first zero of the recovery.
//! * Without a `max_speed`, `DataIn` (FF32) is believed to point at `nsoll` (14.10.3), as this guard lets nothing else be written there.
//! * What a drive does by itself: by its switches, its cycle control, its EEPROM after switching on. Only the bus is judged.
//! * That a regulator does not overshoot the nominal speed.

mod denial;
mod effect;
mod gate;
mod known;
mod limits;
mod stage;
mod table;
#[cfg(test)]
mod tests;

pub use denial::{Cause, Denial};
pub use effect::Act;
pub use gate::Guard;
pub use known::{Configuration, Facts, Found};
pub use limits::{Limits, Need, Setting};
pub use stage::Stage;
