//! Parameters over the parameter channel (NORDAC 3.4).

use super::{Driver, Error};
use harness_proto::nordac::parameter::Flag;
use harness_proto::nordac::{Answer, ParameterRef};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum WriteResult {
    /// The slave answered with the value that it holds now.
    Holds(i64),
    /// The module restarted (NORDAC 2.6): it has left the exchange, and its answer is never seen.
    Restarted,
}

/// Parameters whose change lets the module restart: bus mode, PPO type, address, and those that load all factory settings.
const RESTARTS: [u16; 5] = [970, 1602, 1619, 1622, 1624];

impl Driver<'_> {
    /// Reads a parameter of a slave that was started.
    ///
    /// # Errors
    /// [`Error::Refused`], [`Error::WrongAnswer`], [`Error::NoAnswer`], [`Error::NoChannel`], [`Error::Left`], [`Error::Link`].
    pub(crate) fn read(&mut self, slave: u8, parameter: &ParameterRef) -> Result<i64, Error> {
        let place = self.channel(slave)?;
        self.slaves[place].exchange.read(parameter);
        let answer = self.answer(place, parameter)?;
        self.value(slave, parameter, answer, "read")
    }

    /// Writes a parameter of a slave that was started. Every change is stored in the inverter's EEPROM.
    ///
    /// # Errors
    /// [`Error::Differs`] if the answer has another value, and those of [`Self::read`].
    pub(crate) fn write(
        &mut self,
        slave: u8,
        parameter: &ParameterRef,
        number: i64,
    ) -> Result<WriteResult, Error> {
        let place = self.channel(slave)?;
        // Numbers that no parameter holds are found where they are read.
        let raw = parameter.parameter.raw_of(number).unwrap_or_default();
        self.slaves[place].exchange.write(parameter, raw);
        let answer = match self.answer(place, parameter) {
            Err(Error::Left { .. }) if RESTARTS.contains(&parameter.parameter.number) => {
                return Ok(WriteResult::Restarted);
            }
            other => other?,
        };
        let reads = self.value(slave, parameter, answer, "change")?;
        // Parameter 970 and 1602 do something, and keep nothing.
        if reads != number && !RESTARTS.contains(&parameter.parameter.number) {
            return Err(Error::Differs {
                slave,
                parameter: *parameter,
                wrote: number,
                reads,
            });
        }
        Ok(WriteResult::Holds(reads))
    }

    /// The place of a slave with a parameter channel.
    fn channel(&self, slave: u8) -> Result<usize, Error> {
        let place = self.place(slave)?;
        let ppo = self.slaves[place].exchange.ppo();
        match ppo.has_pkw() {
            true => Ok(place),
            false => Err(Error::NoChannel { slave, ppo }),
        }
    }

    /// Waits for the answer to the task that was begun.
    fn answer(&mut self, place: usize, parameter: &ParameterRef) -> Result<Answer, Error> {
        let slave = self.slaves[place].address;
        self.slaves[place].answer = None;
        let words = self.slaves[place].exchange.outputs.words;
        let mut image = self.exchange(slave, [words[0], words[1], words[2], words[3]])?;
        loop {
            match self.slaves[place].answer.take() {
                Some(Ok(Some(answer))) => return Ok(answer),
                Some(Ok(None)) => {
                    return Err(Error::WrongAnswer {
                        slave,
                        parameter: *parameter,
                        answer: image.pkw.to_string(),
                    });
                }
                Some(Err(_)) => {
                    return Err(Error::NoAnswer {
                        slave,
                        parameter: *parameter,
                    });
                }
                None => image = self.cycle(slave)?,
            }
        }
    }

    /// The number of an answer.
    fn value(
        &self,
        slave: u8,
        parameter: &ParameterRef,
        answer: Answer,
        what: &'static str,
    ) -> Result<i64, Error> {
        let known = parameter.parameter;
        let raw = match answer {
            Answer::Error(error) => {
                return Err(Error::Refused {
                    slave,
                    what,
                    parameter: *parameter,
                    error,
                });
            }
            Answer::Word(word) | Answer::ArrayWord(word) if !known.has(Flag::Long) => word.into(),
            Answer::Double(double) | Answer::ArrayDouble(double) if known.has(Flag::Long) => double,
            _ => {
                let answer = self.inputs(slave)?.pkw.to_string();
                return Err(Error::WrongAnswer {
                    slave,
                    parameter: *parameter,
                    answer,
                });
            }
        };
        Ok(known.number_of(raw))
    }
}
