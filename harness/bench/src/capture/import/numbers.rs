//! Times and values as other programs write them.

/// Thirds of a nanosecond, signed: since the start of a capture, or since 1970. 97 years fit.
pub(super) type SignedTime = i64;

/// Picoseconds of a second.
const SECOND: i128 = 1_000_000_000_000;

/// A time in seconds: `0.000287`, `-1.5e-3`, with a comma in place of the point too.
pub(super) fn seconds(text: &str) -> Option<SignedTime> {
    let text = text.trim();
    let (negative, text) = match text.strip_prefix('-') {
        Some(rest) => (true, rest),
        None => (false, text.strip_prefix('+').unwrap_or(text)),
    };
    let (text, exponent) = match text.split_once(['e', 'E']) {
        Some((text, exponent)) => (text, exponent.parse::<i32>().ok()?),
        None => (text, 0),
    };
    let (whole, places) = text.split_once(['.', ',']).unwrap_or((text, ""));
    let digits = |text: &str| text.bytes().all(|digit| digit.is_ascii_digit());
    if (whole.is_empty() && places.is_empty()) || !digits(whole) || !digits(places) {
        return None;
    }
    if whole.len() > 15 || !(-30..=15).contains(&exponent) {
        return None;
    }
    let mut number: i128 = match whole {
        "" => 0,
        whole => whole.parse().ok()?,
    };
    for place in 0..12 {
        let digit = places.as_bytes().get(place).map_or(0, |digit| digit - b'0');
        number = number * 10 + i128::from(digit);
    }
    let power = 10_i128.checked_pow(exponent.unsigned_abs())?;
    let number = match exponent < 0 {
        true => number / power,
        false => number.checked_mul(power)?,
    };
    units(if negative { -number } else { number })
}

/// Picoseconds as a time, to the nearest.
pub(super) fn units(picoseconds: i128) -> Option<SignedTime> {
    let thirds = picoseconds.checked_mul(3)?;
    SignedTime::try_from((thirds + 500 * thirds.signum()) / 1_000).ok()
}

/// Seconds of a binary file.
pub(super) fn from_float(seconds: f64) -> Option<SignedTime> {
    const MOST: f64 = 3.0e9 * 365.25 * 86_400.0 * 90.0;
    let units = (seconds * 3.0e9).round();
    // A cast of a number in this range loses nothing.
    (units.is_finite() && units.abs() < MOST).then_some(units as SignedTime)
}

/// A date and time of ISO 8601, `2022-01-05T12:34:56.789+01:00`, since 1970.
pub(super) fn date(text: &str) -> Option<SignedTime> {
    let (date, time) = text.trim().split_once(['T', ' '])?;
    let number = |text: &str, digits: usize| {
        let valid = text.len() == digits && text.bytes().all(|digit| digit.is_ascii_digit());
        valid.then(|| text.parse::<i64>().ok())?
    };
    let mut parts = date.splitn(3, '-');
    let year = number(parts.next()?, 4)?;
    let month = number(parts.next()?, 2).filter(|month| (1..=12).contains(month))?;
    let day = number(parts.next()?, 2).filter(|day| (1..=31).contains(day))?;
    let zone = time.find(['Z', '+', '-']).unwrap_or(time.len());
    let (time, zone) = time.split_at(zone);
    let (hour, rest) = time.split_once(':')?;
    let (minute, second) = rest.split_once(':')?;
    let clock = number(hour, 2)? * 3_600 + number(minute, 2)? * 60;
    let away = match zone.split_at_checked(1) {
        None | Some(("Z", "")) => 0,
        Some((sign, text)) => {
            let (hours, minutes) = text.split_once(':').or_else(|| text.split_at_checked(2))?;
            let away = number(hours, 2)? * 3_600 + number(minutes, 2)? * 60;
            if sign == "-" { -away } else { away }
        }
    };
    let whole = days(year, month, day) * 86_400 + clock - away;
    seconds(second)?.checked_add(units(i128::from(whole) * SECOND)?)
}

/// Days from 1970-01-01 to a date of the Gregorian calendar.
fn days(year: i64, month: i64, day: i64) -> i64 {
    // Years that begin in March, so that the leap day is the last one.
    let year = if month > 2 { year } else { year - 1 };
    let month = (month + 9) % 12;
    let leap = year.div_euclid(4) - year.div_euclid(100) + year.div_euclid(400);
    year * 365 + leap + (month * 306 + 5) / 10 + day - 1 - 719_468
}

/// A byte in hexadecimal or binary digits: `0x1F`, `0b00011111`. `None` for any other radix: 16 and the character of a byte may look alike.
pub(super) fn byte(text: &str) -> Option<u8> {
    let text = text.trim();
    let (prefix, digits) = text.split_at_checked(2)?;
    let radix = match prefix {
        "0x" | "0X" => 16,
        "0b" | "0B" => 2,
        _ => return None,
    };
    let signed = digits.starts_with('+');
    u8::from_str_radix(digits, radix).ok().filter(|_| !signed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_in_seconds() {
        for (text, expected) in [
            ("0", Some(0)),
            ("0.000000001", Some(3)),
            ("-1.5", Some(-4_500_000_000)),
            ("1,25", Some(3_750_000_000)),
            ("2.5e-7", Some(750)),
            (".5", Some(1_500_000_000)),
            // 286.4583 us, a byte at 38400 bit/s.
            ("0.000286458333", Some(859_375)),
            ("1e99", None),
            ("9999999999999999999", None),
            ("", None),
            ("-", None),
            ("1.2.3", None),
            ("nan", None),
        ] {
            assert_eq!(seconds(text), expected, "{text:?}");
        }
        assert_eq!(from_float(0.000_001), Some(3_000));
        assert_eq!(from_float(f64::NAN), None);
        assert_eq!(from_float(1e300), None);
    }

    #[test]
    fn dates() {
        let second = 3_000_000_000;
        for (text, expected) in [
            ("1970-01-01T00:00:01Z", Some(second)),
            ("1970-01-02 00:00:00", Some(86_400 * second)),
            ("2000-03-01T00:00:00Z", Some(951_868_800 * second)),
            (
                "2022-01-05T12:34:56.5+01:00",
                Some(1_641_382_496 * second + second / 2),
            ),
            ("2022-13-05T12:34:56Z", None),
            ("0.001", None),
            ("2022-01-05", None),
            ("2022-01-05T1:2:3+", None),
        ] {
            assert_eq!(date(text), expected, "{text:?}");
        }
    }

    #[test]
    fn bytes_of_a_radix_that_loses_nothing() {
        assert_eq!(byte("0x1f"), Some(0x1F));
        assert_eq!(byte("0b00011111"), Some(0x1F));
        for text in ["16", "a", "\n", "", "0x", "0x100", "0x+1"] {
            assert_eq!(byte(text), None, "{text:?}");
        }
    }
}
