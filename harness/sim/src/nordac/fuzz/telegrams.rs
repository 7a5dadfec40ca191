//! The octets of requests, right and wrong.

use harness_proto::profibus::Buffer;

/// The address of the drive.
pub(super) const ADDRESS: u8 = 8;

/// The octets of these parts, which are fewer than a telegram may have.
pub(super) fn octets(parts: &[&[u8]]) -> Buffer {
    let mut all = Buffer::new();
    for part in parts {
        assert!(all.extend(part), "more octets than a telegram may have");
    }
    all
}

/// Mostly right parameters: byte 0 the status, 1 and 2 the watchdog, 3 the delay, 4 the group, 5 what is wrong.
pub(super) fn parameters(data: &[u8; 9]) -> Buffer {
    let [status, wd1, wd2, tsdr, group, wrong, ..] = *data;
    let ident = if wrong % 8 == 5 { wrong } else { 0x31 };
    let all = [status, wd1, wd2, tsdr, 0x75, ident, group, wrong];
    octets(&[match wrong % 8 {
        6 => &all[..usize::from(wrong >> 5).min(7)],
        7 => &all,
        _ => &all[..7],
    }])
}

/// A request: SD1 without data, SD2 with data.
pub(super) fn telegram(da: u8, sa: u8, fc: u8, sap: Option<u8>, data: &[u8]) -> Buffer {
    match sap {
        Some(sap) => framed([da | 0x80, sa | 0x80, fc], &[sap, 62], data),
        None => framed([da, sa, fc], &[], data),
    }
}

/// A telegram with these addresses and FC, and the octets behind them.
fn framed(head: [u8; 3], saps: &[u8], data: &[u8]) -> Buffer {
    let [da, sa, fc] = head;
    let length = u8::try_from(3 + saps.len() + data.len()).unwrap_or(u8::MAX);
    let start: &[u8] = match length {
        3 => &[0x10, da, sa, fc],
        _ => &[0x68, length, length, 0x68, da, sa, fc],
    };
    let sum = [&head[..], saps, data]
        .into_iter()
        .flatten()
        .fold(0_u8, |sum, octet| sum.wrapping_add(*octet));
    octets(&[start, saps, data, &[sum, 0x16]])
}

/// Any telegram: byte 0 chooses the form and what is wrong, the others are its octets.
pub(super) fn any_telegram(data: &[u8; 9]) -> Buffer {
    let [form, da, sa, fc, rest @ ..] = *data;
    let usual = [0x49, 0x43, 0x4E, 0x4F, 0x44, 0x4C, 0x6D, 0x45][usize::from(fc % 8)];
    let fc = if form & 0x80 == 0 { usual } else { fc };
    let da = if form & 0x40 == 0 {
        ADDRESS | da & 0x80
    } else {
        da
    };
    let head = [da, sa, fc];
    // With one octet changed.
    let wrong = |right: Buffer| {
        let mut wrong = right.to_vec();
        let place = usize::from(rest[0]) % wrong.len();
        wrong[place] ^= rest[1];
        octets(&[&wrong])
    };
    match form % 8 {
        0 => framed(head, &[], &[]),
        1 => framed(head, &[], &rest[..usize::from(form >> 3 & 3) + 1]),
        2 => {
            let sd2 = framed(head, &rest, &[0; 3]);
            octets(&[&[0xA2], &sd2[4..]])
        }
        3 => octets(&[&[0xDC, da, sa]]),
        4 => octets(&[&[0xE5]]),
        5 => wrong(framed(head, &[], &[])),
        6 => wrong(framed(head, &[], &rest)),
        _ => octets(&[&[form, da, sa, fc, rest[0], rest[1]][..usize::from(form >> 3) % 7]]),
    }
}
