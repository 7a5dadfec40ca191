//! The drive's side of the parameter channel (ND21 9.5, 9.6, chapter 10): command bytes in, answer
//! bytes out, in step. A command may be cut over several telegrams and several may share one.

use super::checksum::Checksum;
use super::command::{Field, Kind, Layout, PAGE, Reply, layout};
use super::error::BusError;
use super::error_mode::Marks;
use super::memory::Memory;
use super::output::OutputChange;
use super::properties::ReadLongAnswer;

/// What the channel holds between two bytes: nothing, or a command received in part.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub(super) struct ParameterChannel {
    partial: Option<Partial>,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash)]
struct Partial {
    layout: &'static Layout,
    /// Bytes of the command received, the command byte not counted.
    received: u8,
    address: u16,
    /// Data read or to be written, in memory order.
    data: [u8; 4],
    output: Option<OutputChange>,
    command_sum: Checksum,
    answer_sum: Checksum,
}

/// The meaning of the next byte of an incomplete command, for observers of a bus end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ParameterByte {
    /// The command.
    pub kind: Kind,
    /// What the byte is.
    pub field: Field,
    /// What is answered for it.
    pub reply: Reply,
    /// The address received, as far as it is.
    pub address: u16,
    /// The data received or read, in memory order.
    pub data: [u8; 4],
    /// The sum over the command so far (ND21 9.6).
    pub command_sum: Checksum,
    /// The sum over the answer so far.
    pub answer_sum: Checksum,
}

/// An answer byte with the marks of the manual's tables, and whether the drive resets after it.
pub(super) struct AnswerByte {
    pub(super) byte: u8,
    pub(super) marks: Marks,
    pub(super) reset: bool,
}

impl ParameterChannel {
    /// What the next byte of the command under way is; `None` where none is.
    #[inline]
    pub(super) fn next(&self) -> Option<ParameterByte> {
        let partial = self.partial.as_ref()?;
        let index = usize::from(partial.received);
        Some(ParameterByte {
            kind: partial.layout.kind,
            field: partial.layout.command[index],
            reply: partial.layout.answer[index],
            address: partial.address,
            data: partial.data,
            command_sum: partial.command_sum,
            answer_sum: partial.answer_sum,
        })
    }

    /// Takes one byte of the parameter channel of a drive that is addressed.
    pub(super) fn receive<M: Memory>(
        &mut self,
        byte: u8,
        read_long: ReadLongAnswer,
        memory: &mut M,
    ) -> Result<AnswerByte, BusError> {
        let Some(partial) = &mut self.partial else {
            let layout = layout(byte, read_long).ok_or(BusError::Command)?;
            self.partial = Some(Partial {
                layout,
                received: 0,
                address: PAGE,
                data: [0; 4],
                output: None,
                command_sum: Checksum::EMPTY.with(byte),
                answer_sum: Checksum::EMPTY.with(byte),
            });
            return Ok(AnswerByte {
                byte,
                marks: Marks::NONE,
                reset: false,
            });
        };
        let index = usize::from(partial.received);
        let field = partial.layout.command[index];
        partial.accept(field, byte, memory)?;
        let answer = partial.reply(partial.layout.answer[index], byte);
        partial.received += 1;
        partial.command_sum = partial.command_sum.with(byte);
        partial.answer_sum = partial.answer_sum.with(answer.byte);
        let reset = field == Field::Check && partial.layout.kind == Kind::ResetH8;
        if field == Field::Check {
            self.partial = None;
        }
        Ok(AnswerByte { reset, ..answer })
    }
}

impl Partial {
    /// Checks a byte against the place where it stands; reads fetch with the address complete, writes
    /// take effect with the right checking byte.
    fn accept<M: Memory>(
        &mut self,
        field: Field,
        byte: u8,
        memory: &mut M,
    ) -> Result<(), BusError> {
        match field {
            Field::AddrL => self.address = self.address & 0xFF00 | u16::from(byte),
            Field::AddrH => {
                self.address = self.address & 0x00FF | u16::from(byte) << 8;
                self.address_complete(memory)?;
            }
            Field::AddrInPage => {
                self.address = PAGE | u16::from(byte);
                self.address_complete(memory)?;
            }
            Field::Data(i) => self.data[usize::from(i)] = byte,
            Field::Code => {
                self.output = OutputChange::from_code(byte);
                if self.output.is_none() {
                    return Err(BusError::Parameter);
                }
            }
            Field::Fixed(expected) => {
                if byte != expected {
                    return Err(BusError::Parameter);
                }
            }
            Field::Check => {
                if byte != self.command_sum.plus() {
                    return Err(BusError::Checksum);
                }
                self.execute(memory);
            }
        }
        Ok(())
    }

    fn address_complete<M: Memory>(&mut self, memory: &mut M) -> Result<(), BusError> {
        let kind = self.layout.kind;
        if !memory.permits(kind, self.address) {
            return Err(BusError::Parameter);
        }
        if kind.reads() {
            for (offset, data) in (0..u16::from(kind.width())).zip(&mut self.data) {
                *data = memory.read(self.address.wrapping_add(offset));
            }
        }
        Ok(())
    }

    fn execute<M: Memory>(&mut self, memory: &mut M) {
        let kind = self.layout.kind;
        match kind {
            Kind::ReadByte | Kind::ReadWord | Kind::ReadLong => {}
            Kind::WriteByte | Kind::WriteWord => {
                for (offset, &data) in (0..u16::from(kind.width())).zip(&self.data) {
                    memory.write(self.address.wrapping_add(offset), data);
                }
            }
            Kind::And => {
                let data = memory.read(self.address) & self.data[0];
                memory.write(self.address, data);
            }
            Kind::Or => {
                let data = memory.read(self.address) | self.data[0];
                memory.write(self.address, data);
            }
            Kind::WriteIo => {
                if let Some(change) = self.output {
                    memory.write_output(change);
                }
            }
            Kind::ResetH8 => memory.reset(),
        }
    }

    fn reply(&self, reply: Reply, received: u8) -> AnswerByte {
        let (byte, marks) = match reply {
            Reply::Echo => (received, Marks::NONE),
            Reply::Data(i) => (self.data[usize::from(i)], Marks::ANSWER),
            Reply::Check => (self.answer_sum.minus(), Marks::CHECKSUM),
        };
        AnswerByte {
            byte,
            marks,
            reset: false,
        }
    }
}
