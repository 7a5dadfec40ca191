//! Jobs as telegrams, with the answers that they must get.

use super::planner::Planner;
use super::setup::number_bytes;
use super::types::{CellTest, NumberCheck, PlannedCell, RingAct, setups_of};
use crate::language::syntax::{CellPlace, JobKind, JobStep, Relation, Written};
use harness_bench::scenario::pattern::{Expected, MAX_CELLS, Pattern};
use harness_bench::scenario::problem::{Problem, TextSpan};
use harness_proto::nd21;
use harness_proto::nd21::cells::cell_at;
use harness_proto::nd21::units::Scale;
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::command::{Command, Kind, PAGE, Reply};
use harness_proto::novobus::memory;
use harness_proto::novobus::output::OutputChange;
use harness_proto::novobus::properties::{Properties, ReadLongAnswer};
use harness_proto::novobus::telegram::{Address, Telegram};

impl Planner {
    pub(crate) fn job(&self, job: &JobStep) -> Result<RingAct, Problem> {
        match job {
            JobStep::Recover(ring) => {
                self.ring(*ring, TextSpan::default())?;
                Ok(RingAct::Recover(*ring))
            }
            JobStep::Master { calls, once } => self.master(calls, *once),
            JobStep::Count(ring, number) => {
                self.ring(*ring, number.span)?;
                let drives = number.value(self.size(*ring))?;
                let drives = u8::try_from(drives).map_err(|_| {
                    Problem::new(
                        number.span,
                        format!("{drives} drives"),
                        "1 to 250 expected here",
                    )
                })?;
                Ok(RingAct::Count(*ring, drives))
            }
            JobStep::Exchange {
                drive,
                send,
                receive,
            } => {
                let (ring, k) = self.one(drive)?;
                let data = self.known(send, 2, ring)?;
                let word = u16::from_be_bytes([data[0], data[1]]);
                let answer = match receive {
                    Some(pattern) => self.data(pattern, 2, ring)?,
                    None => vec![Expected::Any; 2],
                };
                self.telegram(ring, k, drive.from.span, Some(word), &[], answer)
            }
            JobStep::Command {
                kind,
                drive,
                place,
                data,
                tolerance,
            } => {
                let (ring, k) = self.one(drive)?;
                let place = &place
                    .as_ref()
                    .map(|place| self.moved(place, ring))
                    .transpose()?;
                let command = self.command(*kind, (ring, k), place.as_ref(), data.as_ref())?;
                if let Some(place) = place {
                    reaches(&command, place)?;
                }
                let width = usize::from(command.kind().width());
                let mut read = vec![Expected::Any; 4];
                let mut cell = None;
                if let Some(data) = data.as_ref().filter(|_| command.kind().reads()) {
                    match (data, place) {
                        (Written::Number(expected), Some(place)) => {
                            let scale = scale_of(place, width)?;
                            self.written(data, Some(place), width, (ring, k))?;
                            let test = CellTest::Number {
                                scale,
                                relation: Relation::Equal,
                                expected: *expected,
                                tolerance: *tolerance,
                            };
                            cell = Some(PlannedCell::new(place, width, test));
                        }
                        _ => read = self.expected_data(data, place.as_ref(), width, (ring, k))?,
                    }
                }
                let form = self.read_long(ring, k);
                let answer = expected_answer(&command, &read, form);
                let reading = cell.map(|cell| NumberCheck {
                    drive: k,
                    bytes: data_places(&command, width, form),
                    cell,
                });
                let span = drive.from.span;
                self.telegram(ring, k, span, None, &command.encode(), answer)
                    .map(|action| with_reading(action, reading))
            }
        }
    }

    pub(crate) fn command(
        &self,
        kind: JobKind,
        drive: (usize, u8),
        place: Option<&CellPlace>,
        data: Option<&Written>,
    ) -> Result<Command, Problem> {
        let address = place.map_or(PAGE, |place| place.address);
        let [_, address_low] = address.to_be_bytes();
        let byte = || -> Result<u8, Problem> {
            match data {
                Some(data) => Ok(self.written(data, place, 1, drive)?[0]),
                None => Ok(0),
            }
        };
        let mask = || match data {
            Some(Written::Number(number)) => Err(Problem::new(
                number.span,
                "bits are not a number",
                "a byte expected here",
            )),
            _ => byte(),
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
                    Some(data) => self.written(data, place, 2, drive)?,
                    None => vec![0; 2],
                };
                Command::WriteWord {
                    address,
                    data: u16::from_be_bytes([word[0], word[1]]),
                }
            }
            JobKind::And => Command::And {
                address_low,
                data: mask()?,
            },
            JobKind::Or => Command::Or {
                address_low,
                data: mask()?,
            },
            JobKind::WriteIo => {
                let code = byte()?;
                let change = OutputChange::from_code(code).ok_or_else(|| {
                    Problem::new(
                        data.map_or(TextSpan::default(), Written::span),
                        format!("{code:02X} is not an output code"),
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

    /// A cell with what is added to its address.
    pub(crate) fn moved(&self, place: &CellPlace, ring: usize) -> Result<CellPlace, Problem> {
        let Some(offset) = &place.offset else {
            return Ok(place.clone());
        };
        let address = i64::from(place.address) + offset.value(self.size(ring))?;
        let address = u16::try_from(address).map_err(|_| {
            Problem::new(
                offset.span,
                format!("{address} is not an address"),
                "0000 to FFFF expected here",
            )
        })?;
        Ok(CellPlace {
            name: format!("{address:04X}"),
            address,
            cell: cell_at(address).filter(|cell| cell.address == address),
            offset: None,
            named: false,
            span: place.span,
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
    fn written(
        &self,
        data: &Written,
        place: Option<&CellPlace>,
        count: usize,
        (ring, drive): (usize, u8),
    ) -> Result<Vec<u8>, Problem> {
        match (data, place) {
            (Written::Bytes(pattern), _) => self.known(pattern, count, ring),
            (number, Some(place)) => {
                let scale = scale_of(place, count)?;
                number_bytes(Some(scale), number, self.units_of(ring, drive))
            }
            (_, None) => Ok(vec![0; count]),
        }
    }

    /// Exactly `count` bytes that are read.
    pub(crate) fn expected_data(
        &self,
        data: &Written,
        place: Option<&CellPlace>,
        count: usize,
        drive: (usize, u8),
    ) -> Result<Vec<Expected>, Problem> {
        if let Written::Bytes(pattern) = data {
            return self.data(pattern, count, drive.0);
        }
        let bytes = self.written(data, place, count, drive)?;
        Ok(bytes.into_iter().map(Expected::Byte).collect())
    }

    /// Exactly `count` known bytes.
    pub(crate) fn known(
        &self,
        pattern: &Pattern,
        count: usize,
        ring: usize,
    ) -> Result<Vec<u8>, Problem> {
        self.data(pattern, count, ring)?;
        pattern.expand_known(self.size(ring), MAX_CELLS)
    }

    /// Exactly `count` bytes.
    pub(crate) fn data(
        &self,
        pattern: &Pattern,
        count: usize,
        ring: usize,
    ) -> Result<Vec<Expected>, Problem> {
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
        span: TextSpan,
        process_data: Option<u16>,
        parameters: &[u8],
        answer: Vec<Expected>,
    ) -> Result<RingAct, Problem> {
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
        Ok(RingAct::Telegram(ring, bytes, expected, None))
    }
}

/// A telegram with one command for one drive, and the answer that it must get.
pub(crate) struct Exchange {
    /// What is sent.
    pub(crate) bytes: Vec<u8>,
    /// What must come back.
    pub(crate) expected: Vec<Expected>,
    /// Where in it the data stand that are read, in memory order.
    pub(crate) data: Vec<usize>,
}

impl Exchange {
    /// For a ring of `drives`; `None` where there is no such drive.
    pub(crate) fn new(drives: u8, drive: u8, command: Command) -> Option<Self> {
        let form = ReadLongAnswer::default();
        let ring = RingSize::new(u64::from(drives)).ok()?;
        let address = Address::Byte(ring.address_byte(drive).ok()?);
        let telegram = Telegram::new(address, None, &command.encode()).ok()?;
        let bytes = telegram.encode();
        let mut expected = vec![Expected::Byte(bytes[0]), Expected::Byte(drive)];
        expected.extend(expected_answer(&command, &[Expected::Any; 4], form));
        let width = match command.kind().reads() {
            true => usize::from(command.kind().width()),
            false => 0,
        };
        Some(Self {
            bytes,
            expected,
            data: data_places(&command, width, form),
        })
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

/// Where in the whole answer the data bytes stand, after the sync byte and the address byte.
fn data_places(command: &Command, width: usize, form: ReadLongAnswer) -> Vec<usize> {
    let replies: Vec<_> = command.answer_form(form).into_iter().collect();
    let place = |n: usize| {
        let is = |reply: &Reply| matches!(reply, Reply::Data(m) if usize::from(*m) == n);
        replies.iter().position(|(reply, _)| is(reply))
    };
    (0..width).filter_map(place).map(|i| i + 2).collect()
}

fn with_reading(action: RingAct, reading: Option<NumberCheck>) -> RingAct {
    match action {
        RingAct::Telegram(ring, bytes, expected, _) => {
            RingAct::Telegram(ring, bytes, expected, reading)
        }
        other => other,
    }
}

/// The scale of the number of `width` bytes that begins at a place.
fn scale_of(place: &CellPlace, width: usize) -> Result<Scale, Problem> {
    let of_cell = place.cell.and_then(|cell| cell.scale);
    let scales = [of_cell, place.scale()].into_iter().flatten();
    let mut fitting = scales.filter(|scale| usize::from(scale.size()) == width);
    fitting.next().ok_or_else(|| {
        let size = place.cell.map_or(1, |cell| usize::from(cell.size));
        Problem::new(
            place.span,
            format!(
                "`{}` has {}, the job has {}",
                place.name,
                bytes_in_words(size),
                bytes_in_words(width)
            ),
            "a cell of this length expected here, or bytes behind the `=`",
        )
    })
}

pub(crate) fn reaches(command: &Command, place: &CellPlace) -> Result<(), Problem> {
    if memory::in_range(command.kind(), place.address) {
        return Ok(());
    }
    let layout = command.layout(ReadLongAnswer::default());
    Err(Problem::new(
        place.span,
        format!(
            "{} does not reach {:04X}",
            layout.printed_name, place.address
        ),
        format!(
            "all of {} in {} expected here (ND21 {})",
            bytes_in_words(usize::from(command.kind().width())),
            ranges(command.kind()),
            layout.section
        ),
    ))
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
