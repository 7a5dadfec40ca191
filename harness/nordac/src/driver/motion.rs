//! Motors: setpoints, and the state machine step by step (NORDAC 3.2, 3.3).

use super::error::OUTPUT_OFF;
use super::{Driver, Error};
use harness_proto::nordac::words::{FULL, State, stw, zsw};
use harness_proto::nordac::{Image, ParameterRef};
use harness_proto::time::Span;

/// How long a slave may need for a state that it reaches at once.
const AT_ONCE: Span = Span::from_millis(1_000);

/// How long its frequency may stand still while it is on a ramp: at the longest ramp of 1600 s it changes every 0.1 s.
const STANDS: Span = Span::from_millis(2_000);

/// The state that a call has led to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ReachedState {
    /// The control words that were sent, one for each step.
    pub(crate) steps: [u16; 3],
    /// The last inputs.
    pub(crate) inputs: Image,
}

impl ReachedState {
    /// The control words that were sent.
    pub(crate) fn words(&self) -> impl Iterator<Item = u16> {
        self.steps.into_iter().filter(|word| *word != 0)
    }
}

/// What a setpoint or actual value is in percent of the maximum frequency (NORDAC 3.2.3).
#[must_use]
pub(crate) fn percent(word: u16) -> f64 {
    f64::from(word.cast_signed()) * 100.0 / f64::from(FULL)
}

impl Driver<'_> {
    /// Switches a slave on, by 047E and 047F, with a setpoint (NORDAC 3.3). The motor turns from now on.
    ///
    /// # Errors
    /// [`Error::Fault`], [`Error::Local`], [`Error::NotReached`], [`Error::Left`], [`Error::Link`].
    pub(crate) fn on(&mut self, slave: u8, setpoint: u16) -> Result<ReachedState, Error> {
        self.look()?;
        let seen = self.cycle(slave)?;
        self.ready_for_words(slave, &seen)?;
        let mut steps = [0; 3];
        if State::of_zsw(seen.first()) != Some(State::OperationEnabled) {
            steps[0] = stw::READY;
            let done = |image: &Image| bits(image) == State::ReadyToStart.bits();
            self.reach(slave, [stw::READY, 0, 0, 0], "ready to start", done)?;
        }
        steps[1] = stw::START;
        let words = [stw::START, setpoint, 0, 0];
        let inputs = self.reach(slave, words, "operation enabled", |image| {
            State::of_zsw(image.first()) == Some(State::OperationEnabled)
        })?;
        Ok(ReachedState { steps, inputs })
    }

    /// Stops a slave on its ramp and switches its output off: OFF1, 047E.
    ///
    /// # Errors
    /// [`Error::NotReached`], [`Error::Left`], [`Error::Link`].
    pub(crate) fn off(&mut self, slave: u8) -> Result<ReachedState, Error> {
        self.stopped(slave, stw::READY, is_off)
    }

    /// Switches the output of a slave off at once: OFF2, 047D. The motor coasts.
    ///
    /// # Errors
    /// See [`Self::off`].
    pub(crate) fn block(&mut self, slave: u8) -> Result<ReachedState, Error> {
        self.stopped(slave, stw::SAFE, is_off)
    }

    /// Stops a slave as fast as its quick stop time says (1615), and disables its start: OFF3, 047B.
    ///
    /// # Errors
    /// See [`Self::off`].
    pub(crate) fn quick_stop(&mut self, slave: u8) -> Result<ReachedState, Error> {
        self.stopped(slave, stw::QUICK_STOP, |image| {
            is_off(image) && bits(image) & (zsw::START_DISABLE | zsw::FAULT) != 0
        })
    }

    /// Acknowledges a fault, with the output kept off (OFF2): bit 7 from 0 to 1. Returns the number of the fault, 0 if there was none, where
    /// the parameter channel tells it.
    ///
    /// # Errors
    /// [`Error::NotReached`] while the cause of the fault is there. [`Error::Local`], [`Error::Left`], [`Error::Link`].
    pub(crate) fn acknowledge(&mut self, slave: u8) -> Result<(Option<i64>, ReachedState), Error> {
        let seen = self.exchange(slave, [stw::SAFE, 0, 0, 0])?;
        if seen.first() & zsw::BUS_CONTROL == 0 {
            return Err(Error::Local { slave });
        }
        let steps = [stw::SAFE, stw::SAFE | stw::ACKNOWLEDGE, 0];
        if bits(&seen) & zsw::FAULT == 0 {
            let steps = [stw::SAFE, 0, 0];
            let inputs = seen;
            return Ok((Some(0), ReachedState { steps, inputs }));
        }
        let fault = self.fault(slave)?;
        let words = [stw::SAFE | stw::ACKNOWLEDGE, 0, 0, 0];
        let inputs = self.reach(slave, words, "no fault", |image| {
            bits(image) & zsw::FAULT == 0
        })?;
        Ok((fault, ReachedState { steps, inputs }))
    }

    /// The number of the fault of a slave (1800), where it has a parameter channel.
    ///
    /// # Errors
    /// See [`Driver::read`].
    pub(crate) fn fault(&mut self, slave: u8) -> Result<Option<i64>, Error> {
        let Ok(parameter) = ParameterRef::parse("1800") else {
            return Ok(None);
        };
        match self.read(slave, &parameter) {
            Ok(number) => Ok(Some(number)),
            Err(Error::NoChannel { .. }) => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// Whether a slave obeys control words now.
    fn ready_for_words(&mut self, slave: u8, seen: &Image) -> Result<(), Error> {
        if bits(seen) & zsw::FAULT != 0 {
            let fault = self.fault(slave)?;
            return Err(Error::Fault { slave, fault });
        }
        match seen.first() & zsw::BUS_CONTROL {
            0 => Err(Error::Local { slave }),
            _ => Ok(()),
        }
    }

    /// Sends words until the status word shows what they lead to.
    fn reach(
        &mut self,
        slave: u8,
        words: [u16; 4],
        expected: &'static str,
        done: impl Fn(&Image) -> bool,
    ) -> Result<Image, Error> {
        let end = self.now() + AT_ONCE;
        let mut seen = self.exchange(slave, words)?;
        while !done(&seen) {
            if self.now() >= end {
                return Err(not_reached(slave, expected, words[0], &seen));
            }
            seen = self.cycle(slave)?;
        }
        Ok(seen)
    }

    /// Sends a word that stops, until the output is off. On a ramp it waits as long as the frequency changes.
    fn stopped(
        &mut self,
        slave: u8,
        word: u16,
        done: impl Fn(&Image) -> bool,
    ) -> Result<ReachedState, Error> {
        let mut seen = self.exchange(slave, [word, 0, 0, 0])?;
        let mut changed = (self.now(), seen.main());
        while !done(&seen) {
            if seen.main() != changed.1 {
                changed = (self.now(), seen.main());
            }
            if self.now() >= changed.0 + STANDS {
                return Err(not_reached(slave, OUTPUT_OFF, word, &seen));
            }
            seen = self.cycle(slave)?;
        }
        let steps = [word, 0, 0];
        Ok(ReachedState {
            steps,
            inputs: seen,
        })
    }
}

/// The bits of a status word that show a state.
const fn bits(image: &Image) -> u16 {
    image.first() & 0x4F
}

/// Whether the output is off. While a ramp runs down, the status word alone may not tell (`off1-zsw-while-ramping`).
const fn is_off(image: &Image) -> bool {
    image.first() & zsw::ENABLED == 0 && image.main() == 0
}

const fn not_reached(slave: u8, expected: &'static str, stw: u16, seen: &Image) -> Error {
    Error::NotReached {
        slave,
        expected,
        stw,
        zsw: seen.first(),
    }
}
