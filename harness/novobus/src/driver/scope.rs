//! The memory oscilloscope over the bus (ND21 14.10.6).

use super::{Axis, Error, OpenRings};
use harness_proto::nd21::bits::scope_status::{ARMED, POSITIVE, STOPPED};
use harness_proto::nd21::ram;
use harness_proto::nd21::units::{
    SCOPE_MEASUREMENTS, TriggerDelay, scope_address, scope_signal, scope_window_us,
};
use harness_proto::time::Span;

/// What a recording waits for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Trigger {
    /// The low byte of the address of the signal.
    pub signal: u8,
    /// `scope_level` (14.10.6.3).
    pub level: u8,
    /// The positive flank, not the negative one.
    pub positive: bool,
    /// The cells of the delay (14.10.6.4).
    pub delay: TriggerDelay,
}

/// What is recorded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ScopeSettings {
    /// The low bytes of the addresses of signal 1 and 2 (14.10.6.1).
    pub signals: [u8; 2],
    /// `scope_timer0` (14.10.6.2).
    pub timer0: u8,
    /// The trigger condition; `None` records at once (14.10.6.7).
    pub trigger: Option<Trigger>,
}

/// A byte of a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Measurement {
    /// Of signal 1 or 2.
    pub signal: u8,
    /// What the cell held.
    pub byte: u8,
}

impl OpenRings<'_> {
    /// Programs the oscilloscope and starts a recording (14.10.6.6).
    ///
    /// # Errors
    /// See [`Error`].
    pub(crate) fn start_scope(&self, axis: Axis, scope: &ScopeSettings) -> Result<(), Error> {
        // "The signal selecting must be made with a blocked recording" (14.10.6.1).
        self.write_byte(axis, ram::SCOPE_STATUS, STOPPED)?;
        let [first, second] = scope.signals;
        self.write_byte(axis, ram::SCOPE_SIGNAL1, first)?;
        self.write_byte(axis, ram::SCOPE_SIGNAL2, second)?;
        self.write_byte(axis, ram::SCOPE_TIMER0, scope.timer0)?;
        let (status, delay) = match scope.trigger {
            Some(trigger) => {
                self.write_byte(axis, ram::SCOPE_TRIGGER, trigger.signal)?;
                self.write_byte(axis, ram::SCOPE_LEVEL, trigger.level)?;
                let flank = if trigger.positive { POSITIVE } else { 0 };
                (ARMED | flank, trigger.delay)
            }
            // Nothing runs down: it goes on until it is stopped (14.10.6.7).
            None => (
                0,
                TriggerDelay {
                    counter: 0,
                    delay: 0,
                },
            ),
        };
        self.write_byte(axis, ram::SCOPE_DELAY, delay.delay)?;
        self.write_word(axis, ram::SCOPE_COUNTER, delay.counter)?;
        self.write_byte(axis, ram::SCOPE_STATUS, status)
    }

    /// Waits for the end of a recording, at most `patience` beside its own length, and fetches it, the oldest
    /// measurement first.
    ///
    /// # Errors
    /// [`Error::TimeOut`] where nothing triggered it: then it has been stopped; others see [`Error`].
    pub(crate) fn finish_scope(
        &self,
        axis: Axis,
        scope: &ScopeSettings,
        patience: Span,
    ) -> Result<Vec<Measurement>, Error> {
        let length = Span::from_micros(scope_window_us(scope.timer0).into());
        let stop = || self.write_byte(axis, ram::SCOPE_STATUS, STOPPED);
        match scope.trigger {
            None => {
                self.run(length);
                stop()?;
            }
            Some(trigger) => {
                let periods = u64::from(trigger.delay.counter) + u64::from(trigger.delay.delay);
                let all =
                    Span::from_units(length.units() / u64::from(SCOPE_MEASUREMENTS)) * periods;
                let what = "the trigger of the oscilloscope";
                let end = self.poll_byte(axis, ram::SCOPE_STATUS, patience + all, what, |byte| {
                    Ok(byte & STOPPED != 0)
                });
                if let Err(error) = end {
                    stop()?;
                    return Err(error);
                }
            }
        }
        let pointer = self.read_byte(axis, ram::SCOPE_POINTER)?;
        let count = u16::try_from(SCOPE_MEASUREMENTS).unwrap_or(u16::MAX);
        let bytes = self.read_bytes(axis, ram::SCOPE_PUFFER, count)?;
        let oldest_first = (0..=u8::MAX).map(|n| scope_address(pointer, n));
        let measurements = oldest_first.filter_map(|address| {
            Some(Measurement {
                signal: scope_signal(address),
                byte: *bytes.get(usize::from(address - ram::SCOPE_PUFFER))?,
            })
        });
        Ok(measurements.collect())
    }
}
