//! Reads and sets cells of drives that are accessible only over their bus, by telegrams.
//!
//! Reads for a check are not part of the conversation: their bytes are not counted, and no line expects them.

use super::Runner;
use crate::language::plan::fault_links;
use crate::language::plan::{Exchange, Plan, PlannedCondition, PlannedDriveCheck};
use crate::language::run::bytes::{matches, resolve};
use crate::link::BesideTheBus;
use crate::locate::MAX_ZEROS;
use crate::rig::health::sounds_timed_out;
use crate::twin::unknowable;
use harness_bench::link::{Line, Link, Octets};
use harness_bench::scenario::pattern::Expected;
use harness_bench::scenario::run::outcome::{Outcome, Unready};
use harness_bench::scenario::run::player::{AtMismatch, play};
use harness_bench::scenario::run::skip::lacks;
use harness_bench::scenario::verdict::Verdict;
use harness_proto::line::Received;
use harness_proto::nd21;
use harness_proto::nd21::cells::cell_at;
use harness_proto::nd21::own::is_of_the_scope;
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::check_sequence::{CHECK_SEQUENCE, SEQUENCE, enough};
use harness_proto::novobus::command::Command;
use harness_proto::novobus::role::at_rest;
use harness_proto::novobus::sync::SYNCO;
use harness_proto::time::{Instant, Span};

/// How long an answer may take, in addition to the time that the ring itself needs.
const PATIENCE: Span = Span::from_millis(1_000);

/// Whether a check is on something that the link shows only in the answer to a telegram.
fn is_asked_for(runner: &Runner<'_>, check: &PlannedDriveCheck) -> bool {
    let address = match &check.condition {
        PlannedCondition::Memory(address, _) => *address,
        PlannedCondition::Cell(cell) => cell.address,
        PlannedCondition::InError(false) => nd21::ram::STATUS,
        PlannedCondition::InError(true) | PlannedCondition::Shows(_) => return false,
    };
    let in_error = matches!(check.condition, PlannedCondition::InError(_));
    let shown = |drive| {
        runner.link.peek(check.ring, drive, address).is_some()
            || in_error && runner.own.tapped.contains_key(&(check.ring, drive))
    };
    !check.drives.clone().all(shown)
}

/// What was asked before says nothing of now.
pub(crate) fn forget_answers(runner: &mut Runner<'_>) {
    runner.own.seen.clear();
    runner.own.answers.clear();
    runner.own.tapped.clear();
}

/// How much later an answer over the bus can come than the cell itself: the cell is asked for again and again.
pub(crate) fn asking_time(runner: &Runner<'_>, check: &PlannedDriveCheck) -> Span {
    if !is_asked_for(runner, check) {
        return Span::ZERO;
    }
    let drives = u64::from(runner.link.drives(check.ring));
    let bytes = match &check.condition {
        PlannedCondition::Memory(_, bytes) => bytes.len(),
        PlannedCondition::Cell(cell) => cell.size,
        _ => 1,
    };
    let asked = check.drives.clone().count() as u64 * bytes as u64;
    let one = runner.link.byte_time() * (2 * drives + 8) + runner.link.time_tolerance();
    one * asked
}

/// Where the link shows neither cells nor the error mode, asks the drives that a check is about. What does not
/// answer stays unseen, and nothing is asked in the middle of a telegram or after an error.
pub(crate) fn ask_for(runner: &mut Runner<'_>, check: &PlannedDriveCheck) {
    if matches!(check.condition, PlannedCondition::InError(_)) {
        super::tapped::tap(runner, check.ring, check.drives.clone());
    }
    let status = nd21::ram::STATUS;
    let (address, size) = match &check.condition {
        PlannedCondition::Memory(address, bytes) => (*address, bytes.len()),
        PlannedCondition::Cell(cell) => (cell.address, cell.size),
        PlannedCondition::InError(false) => (status, 1),
        PlannedCondition::InError(true) | PlannedCondition::Shows(_) => return,
    };
    if !is_asked_for(runner, check) {
        return;
    }
    let ring = check.ring;
    runner.settle();
    let tapped = std::mem::take(&mut runner.own.tapped);
    forget_answers(runner);
    runner.own.tapped = tapped;
    let Ok(size_of_ring) = RingSize::new(u64::from(runner.link.drives(ring))) else {
        return;
    };
    let damaged = fault_links(runner.plan).next().is_some() && runner.own.corrected == 0;
    if damaged || !at_rest(size_of_ring, &runner.own.rings[ring].sent) {
        return;
    }
    let received = runner.ports[ring].received.len();
    for drive in check.drives.clone() {
        for address in (address..=u16::MAX).take(size) {
            // The sum of the address passes through BusAddr (FF36) of every drive: a telegram that asks for it
            // changes it.
            if address == nd21::ram::BUS_ADDR {
                continue;
            }
            let read = exchange(runner.link, ring, drive, Command::ReadByte { address });
            if let Some([byte]) = read.as_deref() {
                runner.own.seen.insert((ring, drive, address), *byte);
                runner.own.answers.insert((ring, drive));
            }
        }
    }
    runner.ports[ring].received.truncate(received);
    runner.line_before = runner.line_before.max(runner.link.now());
}

/// Sends a command to a drive and returns the data of its answer; `None` if the answer is not as in ND21 10.1 and 10.2.
fn exchange(link: &mut dyn Link, ring: usize, drive: u8, command: Command) -> Option<Vec<u8>> {
    let drives = link.drives(ring);
    exchange_in(link, drives, (ring, drive), command)
}

/// The same in a ring of `drives`.
fn exchange_in(
    link: &mut dyn Line,
    drives: u8,
    (ring, drive): (usize, u8),
    command: Command,
) -> Option<Vec<u8>> {
    let exchange = Exchange::new(drives, drive, command)?;
    exchange_all(link, drives, ring, &[exchange])?.pop()
}

/// Sends telegrams without waiting for each answer, because on a long ring a round takes much longer than a telegram. Returns the data of
/// each answer; `None` if not all answers are as in ND21 10.1 and 10.2.
fn exchange_all(
    link: &mut dyn Line,
    drives: u8,
    ring: usize,
    exchanges: &[Exchange],
) -> Option<Vec<Vec<u8>>> {
    let bytes: Vec<u8> = exchanges.iter().flat_map(|e| e.bytes.clone()).collect();
    let expected: Vec<_> = exchanges.iter().flat_map(|e| e.expected.clone()).collect();
    while link.receive_octet(ring).is_some() {}
    let sent = link.send_octets(ring, &bytes);
    let end = sent + link.byte_time() * (2 * u64::from(drives) + 4) + PATIENCE;
    let mut received: Vec<(Instant, Received)> = Vec::new();
    while received.len() < expected.len() {
        match link.receive_octet(ring) {
            // A busy computer may look for it late, but not take a late one for an answer.
            Some((at, _)) if at > end => return None,
            // SYNCO with which the line was kept before.
            Some((_, byte)) if received.is_empty() && byte.is(SYNCO) => {}
            Some(byte) => received.push(byte),
            None if link.now() < end && link.trouble().is_none() => {
                link.wait(end);
            }
            None => return None,
        }
    }
    for (index, (expected, (_, byte))) in expected.iter().zip(&received).enumerate() {
        if !matches(resolve(*expected, &received[..index]), *byte) {
            return None;
        }
    }
    let mut rest = received.as_slice();
    let data = exchanges.iter().map(|exchange| {
        let (answer, others) = rest.split_at(exchange.expected.len());
        rest = others;
        exchange.data.iter().map(|place| answer[*place].1.byte)
    });
    Some(data.map(Iterator::collect).collect())
}

/// Reads a byte of RAM of a drive, given its ring and its place in a ring of `drives`, by a telegram of its own (10.1); `None` where it
/// does not answer as it must. What was received before and not fetched is lost.
pub(crate) fn read_byte(
    line: &mut dyn Line,
    drives: u8,
    place: (usize, u8),
    address: u16,
) -> Option<u8> {
    let read = exchange_in(line, drives, place, Command::ReadByte { address })?;
    read.first().copied()
}

/// Plays a plan on drives that are accessible only over their bus. Cells of the header are set before the plan and restored after it.
pub(crate) fn play_over_bus(plan: &Plan, link: &mut dyn Link, at_mismatch: AtMismatch) -> Outcome {
    if let Some(lacks) = lacks(plan, link) {
        return Outcome::skipped(lacks);
    }
    let mut before = Vec::new();
    let mut outcome = match set_up(plan, link, &mut before) {
        Ok(()) => {
            link.begin();
            play(plan, link, at_mismatch)
        }
        Err(not_ready) => not_ready.judged(link),
    };
    if before.is_empty() || link.trouble().is_some() {
        return outcome;
    }
    link.begin();
    let restored = restore(link, &before).or_else(|_| restore(link, &before));
    if let Some(trouble) = link.trouble() {
        let left = "cells of the header may not be set back";
        outcome.remarks.push(left.to_owned());
        // The verdict of the steps becomes a remark, because a drive may hold other values than before the scenario.
        return outcome.ended_by(trouble);
    }
    let left = restored.err().map(|why| format!("not set back: {why}"));
    outcome.remarks.extend(left);
    outcome
}

/// Why a drive is not ready: which of its cells, and what of it is wrong.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
pub(crate) struct NotReady {
    /// In what way.
    pub unready: Unready,
    /// The manual lets the drive change the cell by itself, or leaves open whether it does.
    pub own_cell: bool,
    message: String,
}

impl NotReady {
    fn new(cell: HeldCell, unready: Unready, why: &str) -> Self {
        let prefix = if cell.ring == 0 { "" } else { "2:" };
        let HeldCell { address, drive, .. } = cell;
        Self {
            unready,
            own_cell: is_own(address),
            message: format!("cell {address:04X} of drive {prefix}{drive}: {why}"),
        }
    }

    /// The outcome of a scenario whose drives could not be made ready. A drive must answer and hold what was written to it. The manual
    /// leaves open only the contents of cells that the drive writes by itself.
    pub(crate) fn judged(self, link: &dyn Link) -> Outcome {
        if let Some(trouble) = link.trouble() {
            return Outcome::trouble(trouble);
        }
        let message = format!("the drive could not be made ready: {}", self.message);
        match (self.unready, self.own_cell) {
            (Unready::Differs, true) => Outcome::not_ready(
                Verdict::Inconclusive,
                self.unready,
                format!("{message} (a drive may change this cell by itself, ND21 14.2)"),
            ),
            _ => Outcome::not_ready(Verdict::Failed, self.unready, message),
        }
    }
}

/// Whether the manual lets a drive change a cell by itself, or leaves open whether it does (14.2). The settings and the recording of the
/// oscilloscope are plain memory as long as no measurement is started (14.10.6.5).
fn is_own(address: u16) -> bool {
    !is_of_the_scope(address) && (cell_at(address).is_none() || unknowable(address))
}

/// How long drives may test themselves after a reset.
const SELF_TEST: Span = Span::from_millis(10_000);

/// How long the ring stays quiet before a drive that did not answer is polled again.
const QUIET: Span = Span::from_millis(250);

/// Resets every drive (ND21 10.5) and waits until all have tested themselves (11.8): RAM is then as their EEPROMs say.
///
/// # Errors
/// The first drive that does not come back, in a sentence.
pub(crate) fn start_anew(link: &mut dyn Link, rings: &[RingSize]) -> Result<(), NotReady> {
    let drives = |(ring, size): (usize, &RingSize)| (0..size.drives()).map(move |k| (ring, k));
    let all: Vec<_> = rings.iter().enumerate().flat_map(drives).collect();
    reset_drives(link, &all)
}

/// The same for some drives: their rings, counted from 0, and their addresses.
///
/// # Errors
/// The first drive that does not come back, in a sentence.
pub(crate) fn reset_drives(link: &mut dyn Link, all: &[(usize, u8)]) -> Result<(), NotReady> {
    link.begin();
    let cells = in_each(all, nd21::ram::STATUS);
    for of_ring in cells.chunk_by(|one, other| one.ring == other.ring) {
        reset_ring(link, of_ring)?;
    }
    let rings = cells.last().map_or(0, |cell| cell.ring + 1);
    let end = link.now() + SELF_TEST;
    let mut waiting = cells;
    loop {
        let status = read_all(link, &waiting);
        let silent = status.iter().any(Result::is_err);
        let back = |status: &Result<u8, NotReady>| {
            let status = status.as_ref();
            status.is_ok_and(|status| status & nd21::bits::status::RESET == 0)
        };
        let still = waiting.iter().zip(&status);
        waiting = still
            .filter(|(_, status)| !back(status))
            .map(|(cell, _)| *cell)
            .collect();
        match waiting.first() {
            None => {
                let _in_the_record = monitors(link, all);
                return Ok(());
            }
            Some(cell) if link.now() >= end || link.trouble().is_some() => {
                let why = "it does not answer after its reset";
                return Err(NotReady::new(*cell, Unready::NoAnswer, why));
            }
            Some(_) if silent => {
                be_quiet(link);
                (0..rings).for_each(|ring| end_time_out(link, ring));
            }
            Some(_) => {}
        }
    }
}

/// Whether one of these drives monitors time-outs (ND21 14.10.2, 14.3.6); `None` where a drive does not answer.
pub(crate) fn monitors(link: &mut dyn Link, all: &[(usize, u8)]) -> Option<bool> {
    let cells = in_each(all, nd21::ram::FLAGS2);
    let monitors = |data: &Vec<u8>| {
        data.iter()
            .any(|flags| flags & nd21::bits::flags2::MONITORING != 0)
    };
    let mut any = Some(false);
    // Every ring is asked: the model reads the answers in the record.
    for of_ring in cells.chunk_by(|one, other| one.ring == other.ring) {
        let flags = together(link, of_ring, HeldCell::read);
        let here = flags.map(|flags| flags.iter().any(monitors));
        any = any.zip(here).map(|(any, here)| any || here);
    }
    any
}

/// A cell in each of these drives.
fn in_each(all: &[(usize, u8)], address: u16) -> Vec<HeldCell> {
    let cell = |&(ring, drive)| HeldCell {
        ring,
        drive,
        address,
        data: 0,
    };
    all.iter().map(cell).collect()
}

/// Lets time pass without a byte: a drive that comes back from its self-test (ND21 11.8) within a telegram takes its next byte for a sync byte.
fn be_quiet(link: &mut dyn Link) {
    let end = link.now() + QUIET;
    while link.now() < end && link.trouble().is_none() {
        link.wait(end);
    }
}

/// Brings a ring back whose drives have missed their bytes in a silence (9.8, 9.9).
fn end_time_out(link: &mut dyn Link, ring: usize) {
    let heard: Vec<_> = std::iter::from_fn(|| link.receive_octet(ring))
        .map(|(_, byte)| byte)
        .collect();
    let size = RingSize::new(u64::from(link.drives(ring))).ok();
    if heard.len() > MAX_ZEROS && sounds_timed_out(&heard, size) {
        let drives = link.drives(ring).into();
        let sequences: Vec<_> = enough(drives).collect();
        let left = link.send_octets(ring, &sequences);
        settle(link, left);
    }
}

/// Whether a ring passes SYNCO within the time of a self-test; the drive that was reset before may have opened it. Drives that monitor
/// time-outs miss their bytes meanwhile (9.9), so the check sequence comes first each time (9.8).
fn closes_again(link: &mut dyn Link, ring: usize) -> bool {
    let end = link.now() + SELF_TEST;
    let sequences = |drives| enough(drives).chain([SYNCO]).collect::<Vec<_>>();
    // Two bring back most rings.
    while !comes_round(link, ring, &sequences(2), PATIENCE) {
        if link.now() >= end || link.trouble().is_some() {
            let all = sequences(link.drives(ring).into());
            return comes_round(link, ring, &all, PATIENCE);
        }
        be_quiet(link);
    }
    true
}

/// Whether the last check sequence of these bytes and what follows it come round (9.8), `patience` behind the ring's own time at the latest.
fn comes_round(link: &mut dyn Link, ring: usize, bytes: &[u8], patience: Span) -> bool {
    let from = bytes.iter().rposition(|byte| *byte == SEQUENCE[0]);
    let last = &bytes[from.unwrap_or(0)..];
    let drives = u64::from(link.drives(ring));
    while link.receive_octet(ring).is_some() {}
    let end = link.send_octets(ring, bytes) + link.byte_time() * (drives + 4) + patience;
    let mut back = Vec::new();
    while link.now() < end && link.trouble().is_none() {
        link.wait(end);
        back.extend(std::iter::from_fn(|| link.receive_octet(ring)).map(|(_, byte)| byte.byte));
        if back.ends_with(last) {
            return true;
        }
    }
    false
}

/// Resets these drives of a ring. A check sequence follows each telegram, so that a drive in the middle of a telegram receives the next one
/// whole (9.8). It also shows whether a drive opens the ring while it tests itself. If the first drive does not, the others are reset without
/// waiting. If it does, each drive waits until the ring passes bytes again, because its answer is visible only then.
fn reset_ring(link: &mut dyn Link, cells: &[HeldCell]) -> Result<(), NotReady> {
    let Some((first, others)) = cells.split_first() else {
        return Ok(());
    };
    let mut passes = reset_one(link, *first)?;
    if passes && reset_at_once(link, others).is_some() {
        return Ok(());
    }
    let before = cells.iter();
    for (before, cell) in before.zip(others) {
        if !passes {
            close(link, *before)?;
        }
        passes = reset_one(link, *cell)?;
    }
    match cells.last() {
        Some(last) if !passes => close(link, *last),
        _ => Ok(()),
    }
}

/// Waits until a ring passes bytes again in which this drive was the last one to be reset.
fn close(link: &mut dyn Link, cell: HeldCell) -> Result<(), NotReady> {
    let why = "it does not answer after its reset";
    match closes_again(link, cell.ring) {
        true => Ok(()),
        false => Err(NotReady::new(cell, Unready::NoAnswer, why)),
    }
}

/// Resets a drive, and returns whether the ring passes bytes right after it. A drive that gives no answer is asked once more when the ring
/// passes bytes.
fn reset_one(link: &mut dyn Link, cell: HeldCell) -> Result<bool, NotReady> {
    let reset =
        |link: &mut dyn Link| exchange(link, cell.ring, cell.drive, Command::ResetH8).is_some();
    if !(reset(link) || closes_again(link, cell.ring) && reset(link)) {
        let why = "it does not answer ResetH8";
        return Err(NotReady::new(cell, Unready::NoAnswer, why));
    }
    Ok(comes_round(link, cell.ring, &CHECK_SEQUENCE, QUIET))
}

/// Resets drives of a ring that passes bytes meanwhile.
fn reset_at_once(link: &mut dyn Link, cells: &[HeldCell]) -> Option<()> {
    let Some(ring) = cells.first().map(|cell| cell.ring) else {
        return Some(());
    };
    let drives = link.drives(ring);
    let mut exchanges = Vec::new();
    for cell in cells {
        exchanges.push(Exchange::new(drives, cell.drive, Command::ResetH8)?);
        exchanges.push(Exchange {
            bytes: CHECK_SEQUENCE.to_vec(),
            expected: CHECK_SEQUENCE.map(Expected::Byte).to_vec(),
            data: Vec::new(),
        });
    }
    exchange_all(link, drives, ring, &exchanges).map(|_| ())
}

/// What a cell held before [`set_up`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct HeldCell {
    /// In which ring, counted from 0.
    ring: usize,
    drive: u8,
    address: u16,
    /// What it held.
    data: u8,
}

impl HeldCell {
    fn read(&self) -> Command {
        Command::ReadByte {
            address: self.address,
        }
    }

    fn write(&self) -> Command {
        Command::WriteByte {
            address: self.address,
            data: self.data,
        }
    }
}

/// Sets the cells that a plan's header asks for, by telegrams, and reads them back. What they held before is added to
/// `before`, also where it fails on the way.
///
/// # Errors
/// The first cell that does not hold what it must, in a sentence.
fn set_up(plan: &Plan, link: &mut dyn Link, before: &mut Vec<HeldCell>) -> Result<(), NotReady> {
    for (ring, drives, address, bytes) in plan.memory_setups() {
        let mut cells = Vec::new();
        for drive in drives {
            let contents = (address..=u16::MAX).zip(bytes);
            cells.extend(contents.map(|(address, data)| HeldCell {
                ring,
                drive,
                address,
                data: *data,
            }));
        }
        let held: Vec<u8> = read_all(link, &cells)
            .into_iter()
            .collect::<Result<_, _>>()?;
        let other = cells
            .iter()
            .zip(held)
            .filter(|(cell, held)| cell.data != *held);
        let (other, old): (Vec<_>, Vec<_>) = other
            .map(|(cell, held)| {
                (
                    *cell,
                    HeldCell {
                        data: held,
                        ..*cell
                    },
                )
            })
            .unzip();
        before.extend(old);
        write_all(link, &other)?;
        holds_all(link, &other)?;
    }
    Ok(())
}

/// Restores the previous contents of cells, the last one first, and reads them back.
///
/// The check sequence (9.8) and all telegrams go out without a gap. A scenario may have left the ring in the error mode, or with drives
/// that monitor time-outs of 10 ms (9.9) until one of these cells is restored.
///
/// # Errors
/// The first cell that does not hold its previous contents, as a sentence.
fn restore(link: &mut dyn Link, before: &[HeldCell]) -> Result<(), NotReady> {
    for ring in 0..2 {
        let mut bytes = CHECK_SEQUENCE.to_vec();
        for cell in before.iter().rev().filter(|cell| cell.ring == ring) {
            let written = Exchange::new(link.drives(ring), cell.drive, cell.write());
            bytes.extend(written.into_iter().flat_map(|exchange| exchange.bytes));
        }
        if bytes.len() > CHECK_SEQUENCE.len() {
            let left = link.send_octets(ring, &bytes);
            settle(link, left);
        }
    }
    holds_all(link, before)
}

/// Lets time pass until what leaves until `left` has come round, or should have.
fn settle(link: &mut dyn Link, left: Instant) {
    let end = left + PATIENCE;
    while link.busy() && link.now() < end && link.wait(end) {}
}

/// Takes what was sent before a denial and is still on its way round: it belongs to this conversation and not to the next one.
pub(crate) fn come_home(link: &mut dyn Link) {
    let now = link.now();
    settle(link, now);
    for ring in 0..2 {
        while link.receive_octet(ring).is_some() {}
    }
}

/// Bits that the drive writes itself (14.2).
fn own_bits(address: u16) -> u8 {
    cell_at(address).map_or(0, |known| known.read_only_bits)
}

fn read(link: &mut dyn Link, cell: HeldCell) -> Result<u8, NotReady> {
    match exchange(link, cell.ring, cell.drive, cell.read()).as_deref() {
        Some([byte]) => Ok(*byte),
        _ => Err(NotReady::new(cell, Unready::NoAnswer, "no answer")),
    }
}

/// What each of these cells holds, those of a ring together. Where not all answer it is each for itself, and a sentence for those that do not.
fn read_all(link: &mut dyn Link, cells: &[HeldCell]) -> Vec<Result<u8, NotReady>> {
    let mut held = Vec::new();
    for of_ring in cells.chunk_by(|one, other| one.ring == other.ring) {
        match together(link, of_ring, HeldCell::read) {
            Some(data) => held.extend(data.concat().into_iter().map(Ok)),
            None => held.extend(of_ring.iter().map(|cell| read(link, *cell))),
        }
    }
    held
}

/// Writes to each of these cells: those of a ring together or, if not all drives answer, one by one.
///
/// # Errors
/// The first one that does not answer, in a sentence.
fn write_all(link: &mut dyn Link, cells: &[HeldCell]) -> Result<(), NotReady> {
    for of_ring in cells.chunk_by(|one, other| one.ring == other.ring) {
        if together(link, of_ring, HeldCell::write).is_some() {
            continue;
        }
        for cell in of_ring {
            if exchange(link, cell.ring, cell.drive, cell.write()).is_none() {
                return Err(NotReady::new(*cell, Unready::NoAnswer, "no answer"));
            }
        }
    }
    Ok(())
}

/// Sends a command for each of these cells of one ring, without waiting for each answer.
fn together(
    link: &mut dyn Link,
    cells: &[HeldCell],
    command: fn(&HeldCell) -> Command,
) -> Option<Vec<Vec<u8>>> {
    let ring = cells.first()?.ring;
    let drives = link.drives(ring);
    let exchange = |cell: &HeldCell| Exchange::new(drives, cell.drive, command(cell));
    let exchanges: Option<Vec<_>> = cells.iter().map(exchange).collect();
    exchange_all(link, drives, ring, &exchanges?)
}

/// Whether each of these cells holds what it must, but for bits that the drive writes itself (14.2).
///
/// # Errors
/// The first one that does not, in a sentence.
fn holds_all(link: &mut dyn Link, cells: &[HeldCell]) -> Result<(), NotReady> {
    for (cell, held) in cells.iter().zip(read_all(link, cells)) {
        let held = held?;
        if (held ^ cell.data) & !own_bits(cell.address) != 0 {
            let why = format!("{:02X} was written, {held:02X} is read", cell.data);
            return Err(NotReady::new(*cell, Unready::Differs, &why));
        }
    }
    Ok(())
}

#[cfg(test)]
#[path = "over_bus_tests.rs"]
mod tests;
