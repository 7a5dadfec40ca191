//! When the drives of a ring read telegrams: in the error mode they do not (ND21 9.7).

use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::role::{Role, roles};
use harness_sim::novobus::reference::{Cell, Drive};

/// For each byte that the master sends, whether the drives of the manual were all in the normal mode when it was sent (ND21 9.7, 9.8). The
/// flag of a byte says whether it went round undamaged; behind a damaged one the drives are in the error mode until a check sequence.
pub(crate) fn calm(size: RingSize, sent: &[(u8, bool)]) -> Vec<bool> {
    let mut drives = vec![Drive::new(); usize::from(size.drives())];
    let roles = roles(size, sent);
    let mut damaged = false;
    let all = sent.iter().zip(roles);
    all.map(|(&(byte, whole), role)| {
        let was_calm = !damaged && !drives.iter().any(Drive::in_error);
        damaged = (damaged || !whole) && role != Role::CheckSequence;
        let first = Some(Cell { byte, error: false });
        drives.iter_mut().fold(first, |cell, drive| {
            let byte = drive.receive(cell?)?;
            Some(Cell { byte, error: false })
        });
        was_calm
    })
    .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flags(bytes: &[(u8, bool)]) -> String {
        let size = RingSize::new(3).expect("a size");
        let flag = |calm: bool| if calm { '.' } else { 'E' };
        calm(size, bytes).into_iter().map(flag).collect()
    }

    fn good(bytes: &[u8]) -> Vec<(u8, bool)> {
        bytes.iter().map(|byte| (*byte, true)).collect()
    }

    /// ND21 9.6, 9.7: a wrong checking byte, which only the addressed drive notices, and everything behind it.
    #[test]
    fn behind_a_refused_command_no_byte_is_calm() {
        let refused = [0x88, 0xFE, 0xC0, 0x13, 0xFE, 0xD2, 0x88, 0xFD];
        assert_eq!(flags(&good(&refused)), "......EE");
        let right = [0x88, 0xFE, 0xC0, 0x13, 0xFE, 0xD1, 0x88, 0xFD];
        assert_eq!(flags(&good(&right)), "........");
    }

    /// ND21 9.8: up to the check sequence after 17 zeros.
    #[test]
    fn a_check_sequence_ends_it() {
        let mut sent = good(&[0x80, 0x08]);
        sent.extend(good(&[0; 17]));
        sent.extend(good(&[0xFF, 0x44, 0x72, 0x4C, 0x41, 0x80]));
        let flags = flags(&sent);
        assert_eq!(flags, format!("..{}.", "E".repeat(22)));
    }

    #[test]
    fn behind_a_damaged_byte_no_byte_is_calm() {
        assert_eq!(flags(&[(0x80, true), (0x80, false), (0x80, true)]), "..E");
    }
}
