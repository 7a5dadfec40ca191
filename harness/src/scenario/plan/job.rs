//! Jobs as telegrams, with the answers that they must get.

use super::planner::Planner;
use super::types::{PlannedAction, setups_of};
use crate::scenario::pattern::{Expected, MAX_CELLS, Pattern};
use crate::scenario::problem::{Problem, Span, Spanned};
use crate::scenario::syntax::{Job, JobKind};
use harness_proto::nd21;
use harness_proto::novobus::command::{Command, Kind, PAGE, Reply};
use harness_proto::novobus::memory;
use harness_proto::novobus::output::OutputChange;
use harness_proto::novobus::properties::{Properties, ReadLongAnswer};
use harness_proto::novobus::telegram::{Address, Telegram};

impl Planner {
    pub(super) fn job(&self, job: &Job) -> Result<PlannedAction, Problem> {
        match job {
            Job::Recover(ring) => {
                self.ring(*ring, Span::default())?;
                Ok(PlannedAction::Recover(*ring))
            }
            Job::Exchange {
                drive,
                send,
                receive,
            } => {
                let (ring, k) = self.one(drive)?;
                let data = self.written(send, 2, ring)?;
                let word = u16::from_be_bytes([data[0], data[1]]);
                let answer = match receive {
                    Some(pattern) => self.data(pattern, 2, ring)?,
                    None => vec![Expected::Any; 2],
                };
                self.telegram(ring, k, drive.from.span, Some(word), &[], answer)
            }
            Job::Command {
                kind,
                drive,
                address,
                data,
            } => {
                let (ring, k) = self.one(drive)?;
                let command = self.command(*kind, ring, address.as_ref(), data.as_ref())?;
                if let Some(address) = address
                    && !memory::in_range(command.kind(), address.value)
                {
                    let layout = command.layout(ReadLongAnswer::default());
                    return Err(Problem::new(
                        address.span,
                        format!(
                            "{} does not reach {:04X}",
                            layout.printed_name, address.value
                        ),
                        format!(
                            "all of {} in {} expected here (ND21 {})",
                            bytes_in_words(usize::from(command.kind().width())),
                            ranges(command.kind()),
                            layout.section
                        ),
                    ));
                }
                let read = match data {
                    Some(pattern) if command.kind().reads() => {
                        self.data(pattern, usize::from(command.kind().width()), ring)?
                    }
                    _ => vec![Expected::Any; 4],
                };
                let answer = expected_answer(&command, &read, self.read_long(ring, k));
                self.telegram(ring, k, drive.from.span, None, &command.encode(), answer)
            }
        }
    }

    fn command(
        &self,
        kind: JobKind,
        ring: usize,
        address: Option<&Spanned<u16>>,
        data: Option<&Pattern>,
    ) -> Result<Command, Problem> {
        let address = address.map_or(PAGE, |address| address.value);
        let [_, address_low] = address.to_be_bytes();
        let byte = || -> Result<u8, Problem> {
            match data {
                Some(pattern) => Ok(self.written(pattern, 1, ring)?[0]),
                None => Ok(0),
            }
        };
        let [_, status] = nd21::ram::STATUS.to_be_bytes();
        let status_and = |data| Command::And {
            address_low: status,
            data,
        };
        let status_or = |data| Command::Or {
            address_low: status,
            data,
        };
        Ok(match kind {
            JobKind::ReadByte => Command::ReadByte { address },
            JobKind::ReadWord => Command::ReadWord { address },
            JobKind::ReadLong => Command::ReadLong { address },
            JobKind::WriteByte => Command::WriteByte {
                address,
                data: byte()?,
            },
            JobKind::WriteWord => {
                let word = match data {
                    Some(pattern) => self.written(pattern, 2, ring)?,
                    None => vec![0; 2],
                };
                Command::WriteWord {
                    address,
                    data: u16::from_be_bytes([word[0], word[1]]),
                }
            }
            JobKind::And => Command::And {
                address_low,
                data: byte()?,
            },
            JobKind::Or => Command::Or {
                address_low,
                data: byte()?,
            },
            JobKind::WriteIo => {
                let code = byte()?;
                let change = OutputChange::from_code(code).ok_or_else(|| {
                    Problem::new(
                        data.map_or(Span::default(), |pattern| pattern.span),
                        format!("{code:02X} is no output code"),
                        "00 to 03 expected here (ND21 10.4)",
                    )
                })?;
                Command::WriteIo(change)
            }
            JobKind::Reset => Command::ResetH8,
            JobKind::Go => status_and(!(nd21::bits::status::BLOCK | nd21::bits::status::STOP)),
            JobKind::Stop => status_or(nd21::bits::status::STOP),
            JobKind::Block => status_or(nd21::bits::status::BLOCK),
            JobKind::DeleteError => Command::WriteByte {
                address: nd21::ram::ERRORCODE,
                data: nd21::CONFIRM_ERROR,
            },
        })
    }

    /// The form in which a drive is set to answer `ReadLong`.
    fn read_long(&self, ring: usize, drive: u8) -> ReadLongAnswer {
        let mut properties = Properties::default();
        for setup in setups_of(&self.setups, ring, drive) {
            setup.apply_to(&mut properties);
        }
        properties.read_long
    }

    /// Exactly `count` bytes that are written, so that each must be known.
    fn written(&self, pattern: &Pattern, count: usize, ring: usize) -> Result<Vec<u8>, Problem> {
        self.data(pattern, count, ring)?;
        pattern.expand_known(self.size(ring), MAX_CELLS)
    }

    /// Exactly `count` bytes.
    fn data(&self, pattern: &Pattern, count: usize, ring: usize) -> Result<Vec<Expected>, Problem> {
        let found = pattern.expand(self.size(ring), MAX_CELLS)?;
        if found.len() == count {
            return Ok(found);
        }
        Err(Problem::new(
            pattern.span,
            format!(
                "{} where {} must stand",
                bytes_in_words(found.len()),
                bytes_in_words(count)
            ),
            format!("{} hexadecimal digits expected here", 2 * count),
        ))
    }

    /// A telegram with an address byte, and what the master receives for it.
    fn telegram(
        &self,
        ring: usize,
        drive: u8,
        span: Span,
        process_data: Option<u16>,
        parameters: &[u8],
        answer: Vec<Expected>,
    ) -> Result<PlannedAction, Problem> {
        let wrong = |message: String| Problem::new(span, message, "this drive");
        let address = self
            .ring(ring, span)?
            .address_byte(drive)
            .map_err(|error| wrong(error.to_string()))?;
        let bytes = Telegram::new(Address::Byte(address), process_data, parameters)
            .map_err(|error| wrong(error.to_string()))?
            .encode();
        let mut expected = vec![Expected::Byte(bytes[0]), Expected::Byte(drive)];
        expected.extend(answer);
        Ok(PlannedAction::Telegram(ring, bytes, expected))
    }
}

/// What comes back for a command where the data read are `read`, in memory order.
fn expected_answer(
    command: &Command,
    read: &[Expected],
    read_long: ReadLongAnswer,
) -> Vec<Expected> {
    let mut expected = Vec::new();
    for (reply, echo) in command.answer_form(read_long) {
        let so_far = u8::try_from(expected.len()).unwrap_or(u8::MAX);
        expected.push(match reply {
            Reply::Echo => Expected::Byte(echo),
            Reply::Data(n) => read.get(usize::from(n)).copied().unwrap_or(Expected::Any),
            Reply::Check => Expected::MinusChecksum(so_far),
        });
    }
    expected
}

fn bytes_in_words(count: usize) -> String {
    if count == 1 {
        "1 byte".to_owned()
    } else {
        format!("{count} bytes")
    }
}

/// The addresses that a command reaches, in words.
fn ranges(kind: Kind) -> String {
    let ranges: Vec<_> = memory::ranges(kind)
        .iter()
        .map(|range| format!("{:04X}-{:04X}", range.start(), range.end()))
        .collect();
    ranges.join(" or ")
}
