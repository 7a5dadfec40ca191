//! The guard itself: takes bytes and permits or denies each one.

use super::FIRST_ADDRESS;
use super::asked::SentCommands;
use super::denial::{Cause, DeniedByte};
use super::doubt::Doubt;
use super::effect::DriveAct;
use super::half::{Half, length};
use super::known::{Found, KnownDrive};
use super::limits::Limits;
use super::listener::Listener;
use super::silence::Silence;
use super::stage::Stage;
use super::tail::Tail;
use super::touched::Touched;
use crate::line::Received;
use crate::nd21::bits::flags2;
use crate::novobus::address::RingSize;
use crate::novobus::check_sequence::ZEROS;
use crate::novobus::checksum::Checksum;
use crate::novobus::error_mode::UPSTREAM_ZEROS;
use crate::novobus::sync::{Addressing, PAUSE, SyncByte, TelegramHeader};
use crate::time::{Instant, Span};
use alloc::boxed::Box;
use alloc::collections::BTreeSet;

/// Decides for each byte whether it may go onto one ring. See the module documentation.
#[derive(Clone, Debug)]
pub struct Guard {
    ring: RingSize,
    limits: Limits,
    state: GateState,
    /// Commands received in part, by the address byte that means their drive.
    halves: Box<[Half; 256]>,
    /// What is known of each drive, by the address byte that means it.
    known: Box<[KnownDrive; 256]>,
    listener: Listener,
    asked: SentCommands,
    silence: Silence,
    /// The last address byte, counted up by "next"; `None` where no short address is valid.
    kept: Option<u8>,
    /// The last bytes, and the last ones without PAUSE, which drives swallow.
    tails: [Tail; 2],
    /// Zeros in a row.
    zeros: u8,
    /// What may have changed in drives, by the address bytes that mean them.
    touched: BTreeSet<(u8, Touched)>,
    passed: u64,
    /// The second that is counted: its begin, and bytes in it.
    second: (Instant, u32),
    closed: bool,
}

/// What the drives take the next byte for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum GateState {
    Doubt(Doubt),
    /// A sync byte.
    Sync,
    /// An address byte.
    Address(TelegramHeader),
    /// A net byte.
    Net {
        key: u8,
        left: u8,
        process: Process,
    },
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Process {
    None,
    High,
    Low(u8),
}

/// What becomes of a parameter byte.
enum ParameterEffect {
    /// A half command, with the byte.
    Half(Half),
    /// A command is complete.
    Complete(DriveAct),
    /// It puts a drive into the error mode.
    Error,
}

impl Guard {
    /// Creates a guard for a ring in an unknown state.
    #[must_use]
    pub fn new(ring: RingSize, limits: Limits) -> Self {
        Self {
            ring,
            limits,
            state: GateState::Doubt(Doubt::default()),
            halves: Box::new([Half::default(); 256]),
            known: Box::new([KnownDrive::default(); 256]),
            listener: Listener::new(),
            asked: SentCommands::default(),
            silence: Silence::new(limits.monitoring),
            kept: None,
            tails: [Tail::default(); 2],
            zeros: 0,
            touched: BTreeSet::new(),
            passed: 0,
            second: (Instant::START, 0),
            closed: false,
        }
    }

    /// Assumes that every drive waits for a sync byte and has received nothing. This holds for newly created simulated drives and
    /// for no physical ring.
    pub fn assume_fresh(&mut self) {
        self.state = GateState::Sync;
        self.listener.start(None);
    }

    /// Takes notice of a byte that came back.
    pub fn hear(&mut self, received: Received) {
        if let Some((key, answer)) = self.listener.hear(received, self.ring) {
            let known = &mut self.known[usize::from(key)];
            let asked = &mut self.asked;
            if !asked.answered(key, answer.sent(), known, &self.limits) {
                self.listener.lose();
            }
        }
    }

    /// A conversation begins: nothing is on its way, or it is not heard.
    pub fn begin(&mut self) {
        self.asked.clear();
        match self.at_rest() {
            true => self.listener.start(self.kept),
            false => self.listener.lose(),
        }
    }

    /// Notes a command that its drive executes, and will answer.
    fn note(&mut self, key: u8, act: DriveAct) {
        let known = &mut self.known[usize::from(key)];
        act.touches(known, &mut |touched| {
            self.touched.insert((key, touched));
        });
        act.note(known);
        let is_there = key >= self.ring.lowest_address();
        if is_there && !self.asked.sent(key, act, known) {
            self.asked.clear();
            self.listener.lose();
        }
    }

    /// A drive of the ring has shown that it monitors time-outs (ND21 9.9).
    pub fn expect_time_outs(&mut self) {
        self.silence.is_monitored();
    }

    /// The last byte leaves the line at this time.
    pub fn ends(&mut self, at: Instant) {
        self.silence.ends(at);
    }

    /// Replaces what is known of the drive with this address byte by values that were read from it.
    pub fn learn(&mut self, address: u8, found: &Found) {
        self.known[usize::from(address)].learn(found, &self.limits);
        if found.flags2 & flags2::MONITORING != 0 {
            self.expect_time_outs();
        }
    }

    /// The same of `DataIn` alone, which says where process data are written (ND21 14.10.3).
    pub fn learn_data_in(&mut self, address: u8, data_in: u8) {
        self.known[usize::from(address)].learn_data_in(data_in, &self.limits);
    }

    /// Forgets everything about the drives: one may have been switched off and on.
    pub fn forget(&mut self) {
        self.known.iter_mut().for_each(KnownDrive::forget);
    }

    /// What may have changed in the drives with these address bytes since the last call.
    pub fn take_touched(&mut self) -> BTreeSet<(u8, Touched)> {
        core::mem::take(&mut self.touched)
    }

    /// Copies what another guard of the same ring knows of the drives.
    pub fn know_as(&mut self, other: &Self) {
        self.known.clone_from(&other.known);
        self.silence.know_as(other.silence);
    }

    /// The limits that it enforces.
    #[must_use]
    pub const fn limits(&self) -> &Limits {
        &self.limits
    }

    /// How many bytes have passed.
    #[must_use]
    pub const fn passed(&self) -> u64 {
        self.passed
    }

    /// Whether only the bytes of the recovery pass.
    #[must_use]
    pub const fn in_doubt(&self) -> bool {
        matches!(self.state, GateState::Doubt(_)) && !self.limits.allow_everything()
    }

    /// Whether every drive waits for a sync byte, and none has a command in part, as far as the bytes that have passed tell.
    #[must_use]
    pub fn at_rest(&self) -> bool {
        self.state == GateState::Sync && self.halves.iter().all(|half| half.sent().is_empty())
    }

    /// What the drives take the next byte for, as far as the bytes that have passed tell.
    #[must_use]
    pub fn stage(&self) -> Stage {
        match self.state {
            GateState::Doubt(doubt) => {
                match (doubt.cleared, doubt.matched > 0, doubt.zeros == ZEROS) {
                    (false, ..) => Stage::Doubt,
                    (true, false, false) => Stage::Cleared,
                    (true, false, true) => Stage::Zeros,
                    (true, true, true) => Stage::Sequence,
                    (true, true, false) => Stage::IdleSequence,
                }
            }
            GateState::Sync => Stage::Sync,
            GateState::Address(_) => Stage::Address,
            GateState::Net {
                process: Process::High,
                ..
            } => Stage::ProcessHigh,
            GateState::Net {
                process: Process::Low(_),
                ..
            } => Stage::ProcessLow,
            GateState::Net { key, .. } if key < FIRST_ADDRESS => Stage::Nobody,
            GateState::Net { key, .. } => {
                let sent = self.halves[usize::from(key)].sent();
                match sent.first().and_then(|code| length(*code)) {
                    None => Stage::Command,
                    Some(length) if sent.len() < length => Stage::Parameter,
                    Some(_) => Stage::Check,
                }
            }
        }
    }

    /// The address byte that a short address goes on from (9.2); `None` where no short address is valid.
    #[must_use]
    pub const fn kept(&self) -> Option<u8> {
        self.kept
    }

    /// The drives may be in any state from now on: bytes were changed on their way, or a drive was switched on.
    pub fn doubt(&mut self) {
        self.state = GateState::Doubt(Doubt::default());
        self.silence.doubt();
        self.listener.lose();
        self.kept = None;
        self.doubt_commands();
    }

    /// It is not known which of the last commands were executed.
    fn doubt_commands(&mut self) {
        self.known.iter_mut().for_each(KnownDrive::doubt);
    }

    fn known(&self, key: u8) -> &KnownDrive {
        &self.known[usize::from(key)]
    }

    /// After a denial: lets the bytes of the recovery pass, and permitted bytes behind them. The zeros end incomplete telegrams and
    /// complete no command (ND21 9.5, 9.6).
    pub fn reset_after_denial(&mut self) {
        self.closed = false;
        self.doubt();
    }

    /// Lets any number of bytes pass: those of a safe state must not be denied for their number.
    pub fn lift_caps(&mut self) {
        self.limits.bytes_per_second = None;
        self.limits.most_bytes = u64::MAX;
    }

    /// Until when these bytes must wait, because a drive may keep one of them to itself (ND21 9.9); `None` where they need not, or where one of
    /// them is denied for another reason.
    #[must_use]
    pub fn waits_until(&self, now: Instant, bytes: &[u8]) -> Option<Instant> {
        self.kept_until(now, true)?;
        let mut guard = self.clone();
        for &byte in bytes {
            if let Some(until) = guard.kept_until(now, guard.recovers(byte)) {
                return Some(until);
            }
            guard.admit(now, byte, false).ok()?;
        }
        None
    }

    /// Whether a byte would be the first of a recovery, or one of its zeros.
    fn recovers(&self, byte: u8) -> bool {
        byte == 0 && matches!(self.state, GateState::Sync | GateState::Doubt(_))
    }

    /// Until when a drive may keep to itself what comes now.
    fn kept_until(&self, now: Instant, recovers: bool) -> Option<Instant> {
        let silence = self.silence.at(now, || self.at_rest());
        let until = silence.until(now, recovers);
        until.filter(|_| !self.limits.allow_everything())
    }

    /// Judges the next byte. `line_error`: it is sent with wrong parity or a broken frame. Not every port sends the error
    /// as requested, so the byte must also be allowed as a good byte, and the guard's state becomes doubtful.
    ///
    /// # Errors
    /// [`DeniedByte`]: it must not be sent. No byte passes after that until [`Self::reset_after_denial`]; nothing else changes.
    pub fn admit(&mut self, now: Instant, byte: u8, line_error: bool) -> Result<(), DeniedByte> {
        match self.judge(now, byte) {
            Ok(next) => {
                self.commit(now, byte, line_error, next);
                Ok(())
            }
            Err(cause) => {
                let denial = DeniedByte {
                    number: self.passed + 1,
                    byte,
                    ring: self.ring,
                    address: self.address(),
                    cause,
                };
                self.closed = true;
                Err(denial)
            }
        }
    }

    /// The address byte of the telegram under way.
    fn address(&self) -> Option<u8> {
        match self.state {
            GateState::Net { key, .. } => Some(key),
            _ => None,
        }
    }

    fn judge(&self, now: Instant, byte: u8) -> Result<Next, Cause> {
        if self.closed {
            return Err(Cause::Closed);
        }
        let most = self.limits.most_bytes;
        if self.passed >= most {
            return Err(Cause::TooLong { most });
        }
        if let Some(most) = self.limits.bytes_per_second
            && self.in_this_second(now) >= most
        {
            return Err(Cause::TooMany { most });
        }
        if self.kept_until(now, self.recovers(byte)).is_some() {
            return Err(Cause::BehindSilence);
        }
        match self.next(byte) {
            // If everything is allowed, bytes that the guard cannot interpret pass as well.
            Err(_) if self.limits.allow_everything() => Ok(Next::to(in_doubt(byte, false))),
            next => next,
        }
    }

    /// What follows behind a byte, where no check sequence is hidden in it.
    fn next(&self, byte: u8) -> Result<Next, Cause> {
        let next = self.follow(byte)?;
        let shift = self.tails[0].shift(byte);
        let shift = shift.or_else(|| self.tails[1].shift(byte).filter(|_| byte != PAUSE));
        match (shift, self.state) {
            (Some(0), GateState::Doubt(_)) | (None, _) => Ok(next),
            _ => Err(Cause::CheckSequence),
        }
    }

    /// How many bytes have passed in the second in which `now` lies.
    fn in_this_second(&self, now: Instant) -> u32 {
        let (begin, count) = self.second;
        if now.since(begin) < Span::from_millis(1_000) {
            count
        } else {
            0
        }
    }

    fn commit(&mut self, now: Instant, byte: u8, line_error: bool, next: Next) {
        let count = self.in_this_second(now);
        if count == 0 {
            self.second.0 = now;
        }
        self.second.1 = count.saturating_add(1);
        self.silence = self.silence.at(now, || self.at_rest()).with_byte(now, byte);
        self.passed += 1;
        self.tails[0].push(byte);
        if byte != PAUSE {
            self.tails[1].push(byte);
        }
        self.zeros = if byte == 0 {
            self.zeros.saturating_add(1)
        } else {
            0
        };
        if next.recovered {
            self.halves.fill(Half::default());
            self.kept = None;
        }
        if let Some((key, half)) = next.half {
            self.halves[usize::from(key)] = half;
        }
        if let Some(kept) = next.kept {
            self.kept = kept;
        }
        if let Some((key, act)) = next.act {
            self.note(key, act);
        }
        let certain = !matches!(self.state, GateState::Doubt(_));
        self.state = match (self.state, next.state) {
            // If no drive can be in the middle of a telegram, a bad byte does not start one.
            (GateState::Doubt(doubt), _) if line_error => GateState::Doubt(Doubt {
                cleared: doubt.cleared,
                ..Doubt::default()
            }),
            _ if line_error => GateState::Doubt(Doubt::default()),
            // A drive in the error mode may take these for its neighbour's (ND21 9.7).
            (_, state) if !matches!(state, GateState::Doubt(_)) && self.zeros >= UPSTREAM_ZEROS => {
                GateState::Doubt(Doubt::default().with_zeros(self.zeros))
            }
            // Zeros that a telegram has swallowed belong to the 17 as well (ND21 9.8).
            (before, GateState::Doubt(doubt))
                if byte == 0 && !matches!(before, GateState::Doubt(_)) =>
            {
                GateState::Doubt(doubt.with_zeros(self.zeros))
            }
            (_, state) => state,
        };
        if certain && matches!(self.state, GateState::Doubt(_)) {
            self.listener.lose();
            self.doubt_commands();
        }
    }

    /// What follows behind a byte.
    fn follow(&self, byte: u8) -> Result<Next, Cause> {
        match self.state {
            GateState::Doubt(doubt) => Ok(match doubt.follow(byte)? {
                Some(doubt) => Next::to(GateState::Doubt(doubt)),
                None => Next {
                    recovered: true,
                    ..Next::to(GateState::Sync)
                },
            }),
            GateState::Sync => self.sync_byte(byte),
            GateState::Address(header) => {
                self.may_have_process_data(header, byte)?;
                Ok(Next {
                    kept: Some(Some(byte)),
                    ..Next::to(net(header, byte))
                })
            }
            GateState::Net { key, left, process } => {
                let (process, next) = match process {
                    Process::High => {
                        // If zeros must end this telegram, the low byte is one of them.
                        let data = u16::from(byte) << 8;
                        DriveAct::ProcessData(data).judge(&self.limits, self.known(key))?;
                        (Process::Low(byte), None)
                    }
                    Process::Low(high) => {
                        let data = u16::from_be_bytes([high, byte]);
                        DriveAct::ProcessData(data).judge(&self.limits, self.known(key))?;
                        (Process::None, None)
                    }
                    Process::None if key < FIRST_ADDRESS => (Process::None, None),
                    Process::None => (Process::None, Some(self.parameter(key, byte)?)),
                };
                let state = if left > 1 {
                    let left = left - 1;
                    GateState::Net { key, left, process }
                } else {
                    GateState::Sync
                };
                Ok(match next {
                    None => Next::to(state),
                    Some(ParameterEffect::Half(half)) => Next {
                        half: Some((key, half)),
                        ..Next::to(state)
                    },
                    Some(ParameterEffect::Error) => Next::to(in_doubt(byte, false)),
                    Some(ParameterEffect::Complete(DriveAct::Reset)) => Next {
                        act: Some((key, DriveAct::Reset)),
                        ..Next::to(in_doubt(byte, true))
                    },
                    Some(ParameterEffect::Complete(act)) => Next {
                        half: Some((key, Half::default())),
                        act: Some((key, act)),
                        ..Next::to(state)
                    },
                })
            }
        }
    }

    /// ND21 9.2.
    fn sync_byte(&self, byte: u8) -> Result<Next, Cause> {
        let header = match SyncByte::decode(byte) {
            Ok(SyncByte::Synco | SyncByte::Pause) => return Ok(Next::to(GateState::Sync)),
            Ok(SyncByte::Telegram(header)) => header,
            // No drive takes these for sync bytes, and they leave no telegram open.
            Err(_) if byte & 0x90 != 0x80 => {
                let zeros = u8::from(byte == 0);
                return Ok(Next::to(GateState::Doubt(Doubt {
                    cleared: true,
                    zeros,
                    in_error_mode: true,
                    ..Doubt::default()
                })));
            }
            Err(_) => return Ok(Next::to(in_doubt(byte, false))),
        };
        if header.process_data() {
            DriveAct::ProcessDataToCome.judge(&self.limits, &KnownDrive::default())?;
        }
        let key = match (header.addressing(), self.kept) {
            (Addressing::AddressFollows, _) => return Ok(Next::to(GateState::Address(header))),
            (Addressing::SameDrive, Some(kept)) => kept,
            (Addressing::NextDrive, Some(kept)) => kept.wrapping_add(1),
            _ if header.net_length() == 0 => return Ok(Next::to(GateState::Sync)),
            (_, None) => return Err(Cause::NoAddress),
        };
        self.may_have_process_data(header, key)?;
        Ok(Next {
            kept: Some(Some(key)),
            ..Next::to(net(header, key))
        })
    }

    /// Whether the addressed drive may be given process data: judged before the first of them, with the nominal speed 0.
    fn may_have_process_data(&self, header: TelegramHeader, key: u8) -> Result<(), Cause> {
        if header.process_data() && key >= FIRST_ADDRESS {
            DriveAct::ProcessData(0).judge(&self.limits, self.known(key))?;
        }
        Ok(())
    }

    /// ND21 9.5, 9.6, chapter 10.
    fn parameter(&self, key: u8, byte: u8) -> Result<ParameterEffect, Cause> {
        let half = self.halves[usize::from(key)];
        let sent = half.sent();
        if sent.is_empty() && byte == 0 {
            return Ok(ParameterEffect::Error);
        }
        let Some(length) = length(sent.first().copied().unwrap_or(byte)) else {
            DriveAct::Unknown(byte).judge(&self.limits, self.known(key))?;
            return Ok(ParameterEffect::Error);
        };
        if sent.len() < length {
            let half = half.with(byte);
            // A drive that takes 00 for the checking byte of such a command would execute it at a zero of the recovery.
            if half.sent().len() == length
                && Checksum::over(half.sent()) == Checksum::EMPTY
                && let Some(act) = DriveAct::of(half.sent())
            {
                act.judge(&self.limits, self.known(key))?;
            }
            // Drives whose time is up one after the other can send 00 and 01, which complete an And or Or of this sum (ND21 9.6, 9.9).
            if self.silence.may_time_out()
                && (half.sent().len(), length) == (2, 3)
                && Checksum::over(half.sent()) == Checksum::EMPTY
                && let Some(act) = DriveAct::of(half.with(0).sent())
            {
                act.judge(&self.limits, self.known(key))?;
            }
            return Ok(ParameterEffect::Half(half));
        }
        let Some(act) = DriveAct::of(sent) else {
            return Ok(ParameterEffect::Error);
        };
        // With a wrong checking byte too: a wrong drive may execute it.
        act.judge(&self.limits, self.known(key))?;
        Ok(match Checksum::over(sent).plus() == byte {
            true => ParameterEffect::Complete(act),
            false => ParameterEffect::Error,
        })
    }
}

/// What a byte changes, if it passes.
struct Next {
    state: GateState,
    half: Option<(u8, Half)>,
    kept: Option<Option<u8>>,
    /// A command that the drive of this address byte executes.
    act: Option<(u8, DriveAct)>,
    recovered: bool,
}

impl Next {
    const fn to(state: GateState) -> Self {
        Self {
            state,
            half: None,
            kept: None,
            act: None,
            recovered: false,
        }
    }
}

/// Doubt that begins with this byte.
fn in_doubt(byte: u8, behind_reset: bool) -> GateState {
    GateState::Doubt(Doubt {
        zeros: u8::from(byte == 0),
        behind_reset,
        ..Doubt::default()
    })
}

/// The net bytes of a telegram.
fn net(header: TelegramHeader, key: u8) -> GateState {
    match header.net_length() {
        0 => GateState::Sync,
        left => GateState::Net {
            key,
            left,
            process: if header.process_data() {
                Process::High
            } else {
                Process::None
            },
        },
    }
}
