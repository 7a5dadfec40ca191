//! Questions to a ring that differed, whose answers show which drive is wrong: the address that the ring spells out behind an error
//! (ND21 9.7) with the drives' codes of errors (14.11.14), the addresses that drives have kept (9.2, 9.3), and the cells that do not hold
//! what is written to them (14.2.1).

use super::blame::Sighting;
use crate::language::plan::Exchange;
use crate::language::read::RingScenario;
use crate::twin::Conversation;
use harness_bench::scenario::source::Source;
use harness_proto::nd21::{own, ram};
use harness_proto::novobus::command::Command;
use harness_proto::novobus::role::Role;
use harness_proto::novobus::sync::SYNCO;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

/// How many SYNCO the master sends until the ring has spelled out an address: a ring of eight needs 17 zeros and a round.
const SPELLED_WITHIN: usize = 48;

/// How many equal bytes in a row are the address that is spelled out.
const SPELLED: usize = 12;

/// How many telegrams to the next drive are sent at least until the first drive is addressed.
const STEPS: u8 = 8;

/// The largest ring whose drives are asked.
const MOST_DRIVES: u8 = 8;

/// The most questions of each kind.
const MOST_ASKED: usize = 2;

/// The most cells that do not hold what is written to them; if there are more, the command is at fault.
const MOST_CELLS: usize = 16;

/// The cells that are tested if one of them differs, and a cell in each drive that tells its answers apart.
const TESTED: std::ops::RangeInclusive<u16> = ram::SCOPE_PUFFER..=*own::SPARE.end();
const MARK: u16 = *own::SPARE.start();

/// The high byte of the codes of the bus, and the low ones of line errors, of what is wrong in a command, and of the time-out
/// (14.11.14).
const OF_THE_BUS: u8 = 0x05;
const LINE_ERRORS: std::ops::RangeInclusive<u8> = 0x01..=0x03;
const OF_COMMANDS: std::ops::RangeInclusive<u8> = 0x05..=0x07;
const TIME_OUT: u8 = 0x08;

/// A drive that a question has shown to be wrong.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct PinnedDrive {
    pub drive: u8,
    /// The section of the broken rule.
    pub section: &'static str,
    /// What shows it, as a sentence.
    pub about: String,
    /// Whether it shows the drive, and not only the section.
    pub names_the_drive: bool,
}

impl fmt::Display for PinnedDrive {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.about)
    }
}

/// What is asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum QuestionKind {
    /// A drive went into the error mode where the model's did not: which one is it, and why?
    Refusal,
    /// A telegram with this address byte is for no drive, and was not left as it is: which drive takes it for its own?
    Nobody(u8),
    /// An address byte came back wrong, or a short address reached another drive: which drives have kept which sum?
    Address(u8),
    /// A cell does not hold what was written to it: is it the cell?
    Cell(u8),
}

/// A question, and the scenario that asks it.
#[derive(Clone, Debug)]
pub(crate) struct Question<'s> {
    kind: QuestionKind,
    sighting: &'s Sighting,
    drives: u8,
    pub entry: RingScenario,
}

/// The questions about sightings on a ring of `drives`, each sighting with the name of its scenario; those with the fewest bytes first.
#[must_use]
pub(crate) fn questions(drives: u8, sightings: &[(String, Sighting)]) -> Vec<Question<'_>> {
    if !(2..=MOST_DRIVES).contains(&drives) {
        return Vec::new();
    }
    let mut shortest: Vec<_> = sightings.iter().collect();
    shortest.sort_by_key(|(_, sighting)| sighting.length());
    let mut questions: Vec<Question<'_>> = Vec::new();
    let mut asked = BTreeSet::new();
    for (name, sighting) in shortest {
        let Some(kind) = QuestionKind::of(sighting, drives) else {
            continue;
        };
        let alike = |question: &&Question<'_>| {
            std::mem::discriminant(&question.kind) == std::mem::discriminant(&kind)
        };
        let most = if matches!(kind, QuestionKind::Cell(_)) {
            1
        } else {
            MOST_ASKED
        };
        if questions.iter().filter(alike).count() == most || !asked.insert(name) {
            continue;
        }
        let text = match kind {
            QuestionKind::Refusal => refusal(sighting, drives),
            QuestionKind::Nobody(byte) => taken(drives, byte),
            QuestionKind::Address(byte) => kept(drives, byte),
            QuestionKind::Cell(drive) => march(drives, drive),
        };
        let source = text.map(|text| Source {
            name: format!("{}{}-{name}", super::ASKED, kind.word()),
            text: text.into(),
        });
        let entry = source.and_then(|source| RingScenario::new(source, Some(drives)).ok());
        questions.extend(entry.map(|entry| Question {
            kind,
            sighting,
            drives,
            entry,
        }));
    }
    questions
}

impl QuestionKind {
    /// What to ask about a sighting.
    fn of(sighting: &Sighting, drives: u8) -> Option<Self> {
        let (wanted, _) = sighting.values;
        if let Some(byte) = sighting.to_nobody.filter(|_| !sighting.is_refused) {
            return Some(Self::Nobody(byte));
        }
        match sighting.role {
            Role::Foreign | Role::CheckSequence => None,
            _ if sighting.is_refused && wanted != 0 => Some(Self::Refusal),
            Role::Address { .. } => Some(Self::Address(sighting.byte)),
            _ if sighting.is_short => Some(Self::Address(0u8.wrapping_sub(drives + STEPS))),
            Role::Data {
                drive: Some(drive),
                address,
            } if TESTED.contains(&address) => Some(Self::Cell(drive)),
            _ => None,
        }
    }

    const fn word(self) -> &'static str {
        match self {
            Self::Refusal => "who-refuses",
            Self::Nobody(_) => "who-answers",
            Self::Address(_) => "who-kept",
            Self::Cell(_) => "which-cell",
        }
    }
}

impl Question<'_> {
    /// What the conversations of the played scenario show.
    #[must_use]
    pub(crate) fn answer(&self, conversations: &[Conversation]) -> Option<PinnedDrive> {
        match self.kind {
            QuestionKind::Refusal => self.refused(conversations),
            QuestionKind::Nobody(byte) => taken_by(self.drives, byte, conversations),
            QuestionKind::Address(byte) => kept_by(self.drives, byte, conversations),
            QuestionKind::Cell(drive) => cells(self.sighting, drive, conversations),
        }
    }

    /// The drive that the ring has spelled out is wrong where it cannot have been right: only the master's bytes have reached the first
    /// drive of the ring; a drive that is not addressed does not look at the bytes of a telegram (9.3); and no byte makes a drive report a
    /// time-out (9.9). Any other drive may have been sent something else by a drive in front of it.
    fn refused(&self, conversations: &[Conversation]) -> Option<PinnedDrive> {
        let pairs = pairs(conversations.last()?)?;
        let is_synco = |window: &[(u8, u8)]| window.iter().all(|(sent, _)| *sent == SYNCO);
        let asked = pairs.windows(SPELLED_WITHIN).rposition(is_synco)? + SPELLED_WITHIN;
        let tail = &pairs[asked - SPELLED..asked];
        let (_, drive) = tail[0];
        if tail.iter().any(|(_, spelled)| *spelled != drive) || drive >= self.drives {
            return None;
        }
        let code = code(&pairs[asked..], drive);
        let (rule, why) = broken(
            drive + 1 == self.drives,
            drive,
            code,
            &self.sighting.addressed,
        )?;
        let section = rule.unwrap_or(self.sighting.section);
        let code = code.map_or(String::new(), |code| {
            format!(" and reports the error {OF_THE_BUS:02X}{code:02X}")
        });
        Some(PinnedDrive {
            drive,
            section,
            about: format!(
                "the ring spells out drive {drive}, which refuses what the manual lets the master send{code}; {why}: {}",
                self.sighting.about
            ),
            names_the_drive: true,
        })
    }
}

/// The section of the rule that a drive has broken, and why it is the one, if the ring spells it out where the model is not in the error
/// mode: `code` is the low byte of its error's code, and `addressed` are the drives whose telegrams the refused bytes belong to. `None` for
/// the section of the byte itself.
fn broken(
    is_first: bool,
    drive: u8,
    code: Option<u8>,
    addressed: &[Option<u8>],
) -> Option<(Option<&'static str>, &'static str)> {
    let not_its_own = !addressed.is_empty() && !addressed.contains(&Some(drive));
    match code {
        Some(code) if LINE_ERRORS.contains(&code) => None,
        Some(TIME_OUT) => Some((Some("9.9"), "it reports a time-out")),
        Some(code) if OF_COMMANDS.contains(&code) && not_its_own => {
            Some((Some("9.3"), "the telegram is not addressed to it"))
        }
        _ if is_first => {
            let why = "it is the first of the ring, which only the master sends to";
            Some((None, why))
        }
        _ => None,
    }
}

/// The same bytes again, SYNCO until the ring has spelled out an address, and the codes of all drives.
fn refusal(sighting: &Sighting, drives: u8) -> Option<String> {
    let mut text = sighting.again(drives)?;
    text.push_str(&format!("> {SYNCO:02X}*{SPELLED_WITHIN}\nrecover\n"));
    for drive in 0..drives {
        for address in [ram::ERRORCODE, ram::ERRORCODE + 1] {
            line(&mut text, drives, drive, Command::ReadByte { address })?;
        }
    }
    Some(text)
}

/// Adds a line that sends a command and expects nothing.
fn line(text: &mut String, drives: u8, drive: u8, command: Command) -> Option<()> {
    text.push('>');
    for byte in Exchange::new(drives, drive, command)?.bytes {
        text.push_str(&format!(" {byte:02X}"));
    }
    text.push('\n');
    Some(())
}

/// The bytes sent and received, as many from the end as have come: only PAUSE, which nothing here sends at the end, has no answer.
fn pairs(conversation: &Conversation) -> Option<Vec<(u8, u8)>> {
    let sent = conversation.sent_in(0);
    let came = &conversation.received;
    let unanswered = sent.len().checked_sub(came.len())?;
    let sent = sent[unanswered..].iter().map(|(byte, _)| *byte);
    let answers = came.iter().map(|(_, _, answer)| answer.byte);
    Some(sent.zip(answers).collect())
}

/// The low byte of a drive's code of an error of the bus.
fn code(pairs: &[(u8, u8)], drive: u8) -> Option<u8> {
    let byte = |cell: u16| {
        let [high, low] = cell.to_be_bytes();
        pairs.windows(6).find_map(|window| match window {
            [_, (_, address), (0xC0, _), (l, _), (h, data), _]
                if (*h, *l, *address) == (high, low, drive) =>
            {
                Some(*data)
            }
            _ => None,
        })
    };
    (byte(ram::ERRORCODE) == Some(OF_THE_BUS))
        .then(|| byte(ram::ERRORCODE + 1))
        .flatten()
}

/// What drives keep of an address byte (9.2): the place in the ring counted from the master, and 1, are added to it.
fn kept_sum(drives: u8, byte: u8, drive: u8) -> u8 {
    byte.wrapping_add(drives - drive)
}

/// How many telegrams to the next drive it takes until each drive is addressed (9.2).
fn steps(drives: u8, byte: u8) -> Vec<usize> {
    let step = |drive| 256 - usize::from(kept_sum(drives, byte, drive));
    (0..drives).map(step).collect()
}

/// Reads a cell that is different in each drive, by a short address after an address byte: each drive answers when the sum that it kept has
/// become 0. A SYNCO behind each telegram changes no sum (9.2).
const READ: [u8; 4] = [0xC0, MARK.to_be_bytes()[1], MARK.to_be_bytes()[0], 0];

/// The command byte of WriteByte (10.2).
const WRITE_BYTE: u8 = 0x82;

/// Writes another byte to a cell of each drive.
fn marks(drives: u8) -> String {
    let mark = |drive: u8| format!("write-byte {drive} {MARK:04X} = {:02X}\n", drive + 1);
    (0..drives).map(mark).collect()
}

/// A telegram with this address byte, which reads the mark of a drive that takes it for its own.
fn read_behind(byte: u8) -> [u8; 6] {
    let [command, low, high, _] = READ;
    let sum = command.wrapping_add(low).wrapping_add(high);
    [0x88, byte, command, low, high, sum]
}

fn taken(drives: u8, byte: u8) -> Option<String> {
    let mut text = header(
        "Who answers to an address byte that is for no drive",
        drives,
    );
    text.push_str(&marks(drives));
    let sent: String = read_behind(byte)
        .iter()
        .map(|byte| format!(" {byte:02X}"))
        .collect();
    text.push_str(&format!(">{sent} {SYNCO:02X}*{drives}\nrecover\n"));
    Some(text)
}

/// The drive whose mark came, if the address byte came back as that of no drive: then each drive has added 1 to it (9.3).
fn taken_by(drives: u8, byte: u8, conversations: &[Conversation]) -> Option<PinnedDrive> {
    let pairs = pairs(conversations.last()?)?;
    let asked = read_behind(byte);
    let answer = pairs
        .windows(asked.len())
        .find(|window| window.iter().map(|(sent, _)| *sent).eq(asked))?;
    let [_, (_, address), .., (_, data), _] = answer else {
        return None;
    };
    let drive = data.checked_sub(1).filter(|drive| *drive < drives)?;
    (*address == byte.wrapping_add(drives)).then(|| PinnedDrive {
        drive,
        section: "9.3",
        about: format!(
            "the address byte {byte:02X} is for no drive, and drive {drive} answers to it"
        ),
        names_the_drive: true,
    })
}

fn kept(drives: u8, byte: u8) -> Option<String> {
    let mut text = header(
        "The sums of an address byte that the drives have kept",
        drives,
    );
    text.push_str(&marks(drives));
    let most = steps(drives, byte).into_iter().max()?;
    if steps(drives, byte).contains(&256) {
        return None;
    }
    let [command, low, high, _] = READ;
    let sum = command.wrapping_add(low).wrapping_add(high);
    text.push_str(&format!("> 82 {byte:02X} C0\n"));
    text.push_str(&format!(
        "> [E8 {command:02X} {low:02X} {high:02X} {sum:02X} {SYNCO:02X}]*{}\n> {SYNCO:02X}*{}\nrecover\n",
        most + 1,
        drives
    ));
    Some(text)
}

/// Drives that answer at another step than the sum that they must have kept says. Where the address byte comes back wrong, the one of them
/// that is the nearest to the master has added wrong: a drive keeps the sum that it sends (9.3), and those behind it add to that. Where the
/// address byte is right, a single drive takes short addresses wrong.
fn kept_by(drives: u8, byte: u8, conversations: &[Conversation]) -> Option<PinnedDrive> {
    let pairs = pairs(conversations.last()?)?;
    // Each drive has taken its own mark, so that the marks tell the answers apart.
    let marked = |drive: u8| {
        pairs.windows(4).any(|window| {
            let [_, (_, address), (command, _), (data, _)] = window else {
                return false;
            };
            (*address, *command, *data) == (drive, WRITE_BYTE, drive + 1)
        })
    };
    if !(0..drives).all(marked) {
        return None;
    }
    let sent = [0x82, byte, 0xC0];
    let mut asked = pairs.windows(sent.len());
    let asked = asked.position(|window| window.iter().map(|(sent, _)| *sent).eq(sent))?;
    let came: Vec<u8> = pairs[asked..].iter().map(|(_, came)| *came).collect();
    let steps = steps(drives, byte);
    let data = |step: usize| came.get(6 * step - 3..)?.get(..5);
    // Where two drives answer at once, one of them refuses what the other has sent.
    let answers = |drive: u8, step: usize| {
        data(step).is_some_and(|answer| answer[3] == drive + 1 || answer[4] == 0)
    };
    let before_errors =
        |step: usize| (1..=step).all(|step| data(step).is_some_and(|answer| answer[0] == 0xE8));
    let moved = |drive: u8| {
        let step = steps[usize::from(drive)];
        before_errors(step).then(|| !answers(drive, step))
    };
    let all: Vec<Option<bool>> = (0..drives).map(moved).collect();
    let wrong: Vec<u8> = (0..drives)
        .filter(|drive| all[usize::from(*drive)] == Some(true))
        .collect();
    let known = all.iter().filter(|moved| moved.is_some()).count() == all.len();
    let next_is_right = |drive: u8| {
        let next = all.get(usize::from(drive) + 1);
        next.is_none_or(|moved| *moved == Some(false))
    };
    let (drive, section) = match (
        came.get(1) == Some(&byte.wrapping_add(drives)),
        wrong.as_slice(),
    ) {
        (false, []) if known => (0, "9.3"),
        (false, [.., drive]) if wrong.len() == usize::from(*drive) + 1 && next_is_right(*drive) => {
            (*drive, "9.3")
        }
        (true, [drive]) if known => (*drive, "9.2"),
        _ => return None,
    };
    Some(PinnedDrive {
        drive,
        section,
        about: format!(
            "behind the address byte {byte:02X} drive {drive} keeps another sum than {:02X}, and every drive nearer to the master the right one",
            kept_sum(drives, byte, drive)
        ),
        names_the_drive: true,
    })
}

/// Twice with other values: each cell gets a byte, upwards, and is read; then the complement, downwards. In between one write and one read
/// more, so that a fault that repeats after a number of accesses meets other cells.
fn march(drives: u8, drive: u8) -> Option<String> {
    let mut text = header(
        "Each cell of the recording written and read with two values, twice",
        drives,
    );
    for (address, byte) in accesses() {
        let command = match byte {
            Some(data) => Command::WriteByte { address, data },
            None => Command::ReadByte { address },
        };
        line(&mut text, drives, drive, command)?;
    }
    text.push_str(&format!("> {SYNCO:02X}\n"));
    Some(text)
}

/// The cells in order, each with the byte that is written or `None` where it is read.
fn accesses() -> Vec<(u16, Option<u8>)> {
    // An odd factor gives each cell another byte, and cells side by side other bits.
    let value = |pass: u16, cell: u16| {
        let [_, byte] = ((cell - TESTED.start()) * (37 + 36 * pass) + 91 * pass).to_be_bytes();
        byte
    };
    let mut all = Vec::new();
    for pass in 0..2 {
        all.extend(TESTED.map(|cell| (cell, Some(value(pass, cell)))));
        all.extend(TESTED.map(|cell| (cell, None)));
        all.extend(TESTED.rev().map(|cell| (cell, Some(!value(pass, cell)))));
        all.extend(TESTED.map(|cell| (cell, None)));
        let first = *TESTED.start();
        all.extend([(first, Some(value(pass, first))), (first, None)]);
    }
    all
}

/// Cells that are wrong in both passes, and the same ones. If all are right, and a word was wrong that was written byte by byte, then the
/// command that reads words is.
fn cells(sighting: &Sighting, drive: u8, conversations: &[Conversation]) -> Option<PinnedDrive> {
    let accesses = accesses();
    let length = |byte: &Option<u8>| if byte.is_some() { 7 } else { 6 };
    let all: usize = accesses.iter().map(|(_, byte)| length(byte)).sum();
    let pairs = pairs(conversations.last()?)?;
    let asked = pairs.get(pairs.len().checked_sub(all + 1)?..)?;
    let came: Vec<u8> = asked.iter().map(|(_, came)| *came).collect();
    let mut wrong = [BTreeSet::new(), BTreeSet::new()];
    let mut held = BTreeMap::new();
    let mut at = 0;
    for (number, (cell, byte)) in accesses.iter().enumerate() {
        match byte {
            Some(byte) => {
                held.insert(*cell, *byte);
            }
            None if held.get(cell) != came.get(at + 4) => {
                wrong[number * 2 / accesses.len()].insert(*cell);
            }
            None => {}
        }
        at += length(byte);
    }
    let [first, second] = wrong;
    if first.is_empty() && second.is_empty() && sighting.word_of_bytes {
        return Some(PinnedDrive {
            drive,
            section: "10.1",
            about: format!(
                "each byte that WriteByte writes is read back by ReadByte, and not by the command that reads several: {}",
                sighting.about
            ),
            names_the_drive: false,
        });
    }
    let few = !first.is_empty() && first.len() <= MOST_CELLS;
    let named: Vec<String> = first.iter().map(|cell| format!("{cell:04X}")).collect();
    (few && first == second).then(|| PinnedDrive {
        drive,
        section: "14.2.1",
        about: format!(
            "written and read with four values, these cells do not hold what is written, and all others do: {}",
            named.join(" ")
        ),
        names_the_drive: false,
    })
}

fn header(title: &str, drives: u8) -> String {
    format!("title   {title}\nring    {drives}\nneeds   motion\n\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    const BAD_SYNC: u8 = 0x04;

    /// ND21 9.3, 9.7, 9.9: a drive that the ring spells out is wrong only if no other drive can have made it refuse.
    #[test]
    fn who_refuses_is_wrong_where_it_cannot_have_been_right() {
        let section = |drive, code, addressed: &[Option<u8>]| {
            broken(drive == 2, drive, code, addressed).map(|(section, _)| section)
        };
        assert_eq!(section(1, Some(TIME_OUT), &[]), Some(Some("9.9")));
        assert_eq!(section(1, Some(0x05), &[Some(0), None]), Some(Some("9.3")));
        // Its own telegram, which the drive in front of it may have changed.
        assert_eq!(section(1, Some(0x05), &[Some(1)]), None);
        assert_eq!(section(2, Some(0x05), &[Some(2)]), Some(None));
        assert_eq!(section(1, Some(BAD_SYNC), &[]), None);
        assert_eq!(section(2, Some(BAD_SYNC), &[]), Some(None));
        // A line error is the link's.
        assert_eq!(section(2, Some(0x02), &[]), None);
        assert_eq!(section(1, None, &[None]), None);
    }
}
