//! The octets of requests, right and wrong.

/// The address of the drive.
pub(super) const ADDRESS: u8 = 8;

/// Mostly right parameters: byte 0 the status, 1 and 2 the watchdog, 3 the delay, 4 the group, 5 what is wrong.
pub(super) fn parameters(data: &[u8; 9]) -> Vec<u8> {
    let [status, wd1, wd2, tsdr, group, wrong, ..] = *data;
    let mut all = vec![status, wd1, wd2, tsdr, 0x75, 0x31, group];
    match wrong % 8 {
        5 => all[5] = wrong,
        6 => all.truncate(usize::from(wrong >> 5)),
        7 => all.push(wrong),
        _ => {}
    }
    all
}

/// A request: SD1 without data, SD2 with data.
pub(super) fn telegram(da: u8, sa: u8, fc: u8, sap: Option<u8>, data: &[u8]) -> Vec<u8> {
    let flag = if sap.is_some() { 0x80 } else { 0 };
    let mut body = vec![da | flag, sa | flag, fc];
    body.extend(sap.map(|sap| [sap, 62]).into_iter().flatten());
    body.extend(data);
    framed(&body)
}

fn framed(body: &[u8]) -> Vec<u8> {
    let sum = body
        .iter()
        .fold(0_u8, |sum, octet| sum.wrapping_add(*octet));
    let length = u8::try_from(body.len()).unwrap_or(u8::MAX);
    let mut all = match body.len() {
        3 => vec![0x10],
        _ => vec![0x68, length, length, 0x68],
    };
    all.extend(body);
    all.extend([sum, 0x16]);
    all
}

/// Any telegram: byte 0 chooses the form and what is wrong, the others are its octets.
pub(super) fn any_telegram(data: &[u8; 9]) -> Vec<u8> {
    let [form, da, sa, fc, rest @ ..] = *data;
    let usual = [0x49, 0x43, 0x4E, 0x4F, 0x44, 0x4C, 0x6D, 0x45][usize::from(fc % 8)];
    let fc = if form & 0x80 == 0 { usual } else { fc };
    let da = if form & 0x40 == 0 {
        ADDRESS | da & 0x80
    } else {
        da
    };
    match form % 8 {
        0 => framed(&[da, sa, fc]),
        1 => framed(&[&[da, sa, fc], &rest[..usize::from(form >> 3 & 3) + 1]].concat()),
        2 => {
            let mut sd3 = framed(&[&[da, sa, fc], &rest[..], &[0; 3]].concat());
            sd3.splice(..4, [0xA2]);
            sd3
        }
        3 => vec![0xDC, da, sa],
        4 => vec![0xE5],
        5 => {
            let mut wrong = framed(&[da, sa, fc]);
            wrong[usize::from(rest[0]) % 6] ^= rest[1];
            wrong
        }
        6 => {
            let mut wrong = framed(&[&[da, sa, fc], &rest[..]].concat());
            let place = usize::from(rest[0]) % wrong.len();
            wrong[place] ^= rest[1];
            wrong
        }
        _ => [form, da, sa, fc, rest[0], rest[1]][..usize::from(form >> 3) % 7].to_vec(),
    }
}
