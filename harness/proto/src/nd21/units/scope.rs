//! The memory oscilloscope (ND21 14.10.6).

use super::{Ratio, Reason, UnitError};
use crate::ratio::round_div;

/// How many measurements a recording has, one byte each (ND21 14.10.6.2, E130).
pub const SCOPE_MEASUREMENTS: u32 = 256;

/// The shortest scan period in microseconds (ND21 14.10.6.2).
const STEP_US: u32 = 108;
/// The first cell of `scope_puffer` (ND21 14.2.1).
const BUFFER: u16 = 0xFDA0;

const PERIOD_WHAT: (&str, &str) = ("scan period in us", "14.10.6.2");
const DELAY_WHAT: (&str, &str) = ("trigger delay in us", "14.10.6.4");

/// `scope_timer0`: the scan period in us, 108 to 27648: 108 us x (`scope_timer0` + 1) (ND21 14.10.6.2;
/// the printed formula lacks the 1, E106).
#[must_use]
pub const fn scope_period_us(timer0: u8) -> u32 {
    STEP_US * (timer0 as u32 + 1)
}

/// `scope_timer0` of the scan period nearest to this one in us (ND21 14.10.6.2).
///
/// # Errors
/// Less than 108 us or more than 27648 us.
pub fn scope_timer0(period_us: u32) -> Result<u8, UnitError> {
    let (least, most) = (scope_period_us(0), scope_period_us(u8::MAX));
    let ratio = |us: u32| Ratio::of(i64::from(us), 1);
    let fail = |reason| UnitError::new(PERIOD_WHAT, ratio(period_us), reason);
    if period_us < least {
        return Err(fail(Reason::Below(ratio(least))));
    }
    let above = fail(Reason::Above(ratio(most)));
    if period_us > most {
        return Err(above);
    }
    let steps = round_div(i128::from(period_us), i128::from(STEP_US));
    u8::try_from(steps - 1).map_err(|_| above)
}

/// The length of a recording in us: 256 scan periods (ND21 14.10.6.2).
#[must_use]
pub const fn scope_window_us(timer0: u8) -> u32 {
    SCOPE_MEASUREMENTS * scope_period_us(timer0)
}

/// `scope_level`: the raw value of the trigger signal at which it triggers; bit 7 is inverted (ND21
/// 14.10.6.3). The scale is that of the signal.
#[must_use]
pub const fn trigger_level_from_raw(raw: u8) -> i8 {
    (raw ^ 0x80).cast_signed()
}

/// `scope_level` for a raw value of the trigger signal (ND21 14.10.6.3).
#[must_use]
pub const fn trigger_level_to_raw(level: i8) -> u8 {
    level.cast_unsigned() ^ 0x80
}

/// The two cells of the trigger delay (ND21 14.10.6.4).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct TriggerDelay {
    /// `scope_counter`: the scan periods from the trigger to the end.
    pub counter: u16,
    /// `scope_delay`: the scan periods that are recorded before the trigger.
    pub delay: u8,
}

/// Returns the cells for a recording that begins `us` microseconds after the trigger, or before it if negative (ND21
/// 14.10.6.4). The formula of `scope_counter` holds for both signs, as the example there shows (E131).
///
/// # Errors
/// Less than -255 scan periods, or more than 65279.
pub fn trigger_delay(us: i64, timer0: u8) -> Result<TriggerDelay, UnitError> {
    let period = Ratio::of(i64::from(scope_period_us(timer0)), 1);
    let received = Ratio::of(us, 1);
    let periods = received.steps(period);
    let least = Reason::Below(period.times(-0xFF));
    let most = Reason::Above(period.times(0xFFFF - 0x100));
    let below = UnitError::new(DELAY_WHAT, received, least);
    let above = UnitError::new(DELAY_WHAT, received, most);
    let delay = u8::try_from((-periods).max(0)).map_err(|_| below)?;
    let counter = u16::try_from(periods + 0x100).map_err(|_| above)?;
    Ok(TriggerDelay { counter, delay })
}

/// The address of measurement `n` of a complete recording, 0 the oldest: the buffer is a ring whose
/// newest byte `scope_pointer` counts (ND21 14.10.6.6).
#[must_use]
pub const fn scope_address(pointer: u8, n: u8) -> u16 {
    BUFFER + pointer.wrapping_add(n).wrapping_add(1) as u16
}

/// Which signal a cell of the buffer has: 1 at even addresses, 2 at odd ones (ND21 14.10.6.6).
#[must_use]
pub const fn scope_signal(address: u16) -> u8 {
    if address.is_multiple_of(2) { 1 } else { 2 }
}

#[cfg(test)]
mod tests {
    use super::super::{DriveType, momentary_current_to_raw};
    use super::*;

    /// ND21 14.10.6.2: with 0 a measurement every 108 us and 27,648 ms in all. The printed formula
    /// gives 0 (E106).
    #[test]
    fn time_base_of_14_10_6_2() {
        assert_eq!(scope_period_us(0), 108);
        assert_eq!(scope_window_us(0), 27_648);
        assert_eq!(scope_period_us(3), 432);
        for timer0 in 0..=u8::MAX {
            assert_eq!(scope_timer0(scope_period_us(timer0)), Ok(timer0));
        }
        assert!(scope_timer0(107).is_err());
        assert!(scope_timer0(27_649).is_err());
        assert_eq!(scope_timer0(170), Ok(1));
    }

    /// ND21 14.10.6.3: -7 A on a 5610 are H'E3, and H'63 in `scope_level`.
    #[test]
    fn trigger_threshold_of_14_10_6_3() {
        let level = momentary_current_to_raw(Ratio::whole(-7), DriveType::Nd5610).unwrap();
        assert_eq!(trigger_level_to_raw(level), 0x63);
        for raw in 0..=u8::MAX {
            assert_eq!(trigger_level_to_raw(trigger_level_from_raw(raw)), raw);
        }
    }

    /// ND21 14.10.6.4: -5 ms at 108 us are 46 scan points before and 210 after the trigger.
    #[test]
    fn trigger_delay_of_14_10_6_4() {
        let expected = TriggerDelay {
            counter: 0x00D2,
            delay: 0x2E,
        };
        assert_eq!(trigger_delay(-5_000, 0), Ok(expected));
        assert_eq!((expected.delay, expected.counter), (46, 210));
        let none = TriggerDelay {
            counter: 0x0100,
            delay: 0,
        };
        assert_eq!(trigger_delay(0, 9), Ok(none));
        let ends = [trigger_delay(-255 * 108, 0), trigger_delay(65_279 * 108, 0)];
        assert_eq!(ends.map(|end| end.unwrap().counter), [1, 0xFFFF]);
        assert!(trigger_delay(-256 * 108, 0).is_err());
        assert!(trigger_delay(65_280 * 108, 0).is_err());
        assert!(trigger_delay(i64::MIN, 0).is_err());
        assert!(trigger_delay(i64::MAX, 0).is_err());
    }

    /// ND21 14.10.6.6: from FDA0 + pointer + 1 to FE9F, then from FDA0 to FDA0 + pointer.
    #[test]
    fn data_ranges_of_14_10_6_6() {
        for pointer in 0..=u8::MAX {
            let newest = 0xFDA0 + u16::from(pointer);
            let order = (0..=u8::MAX).map(|n| scope_address(pointer, n));
            assert!(order.eq((newest + 1..=0xFE9F).chain(0xFDA0..=newest)));
        }
        assert_eq!((scope_signal(0xFDA0), scope_signal(0xFE9F)), (1, 2));
    }
}
