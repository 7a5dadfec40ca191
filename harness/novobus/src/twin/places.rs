//! Which byte received stands for which byte sent.

use super::comparison::Symptom;
use harness_proto::line::Received;
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::role::{Role, roles};
use harness_proto::novobus::sync::PAUSE;
use harness_proto::time::{Instant, Span};

/// The longest run of one byte in which each counts: more than the 25 zeros of 9.7.
const LONGEST_RUN: usize = 32;

/// The bytes that are answered, by their places among those sent, and their roles.
pub(crate) fn answered(size: RingSize, sent: &[(u8, bool)]) -> (Vec<usize>, Vec<Role>) {
    answering(&roles(size, sent), sent).unzip()
}

/// The same of bytes whose roles are known: a PAUSE where a sync byte is due is swallowed (ND21 9.2).
pub(crate) fn answering<'a>(
    roles: &'a [Role],
    sent: &'a [(u8, bool)],
) -> impl Iterator<Item = (usize, Role)> + 'a {
    let pairs = roles.iter().zip(sent).enumerate();
    pairs
        .filter(|(_, (role, (byte, _)))| (**role, *byte) != (Role::Idle, PAUSE))
        .map(|(place, (role, _))| (place, *role))
}

/// The bytes that the model answers, of those that a ring answers where every drive listens. A drive that is silent while it tests itself
/// (ND21 11.8) loses the bytes of that time. An answer comes one `way` round the ring after the start of its byte.
pub(super) fn heard(
    (places, roles): (Vec<usize>, Vec<Role>),
    starts: &[Instant],
    expected: &[(Instant, Received)],
    way: Span,
) -> (Vec<usize>, Vec<Role>) {
    if expected.len() >= places.len() {
        return (places, roles);
    }
    let comes = |place: usize| {
        let due = starts[place] + way;
        expected.binary_search_by_key(&due, |(at, _)| *at).is_ok()
    };
    let all = places.iter().copied().zip(roles.iter().copied());
    let kept: (Vec<_>, Vec<_>) = all.filter(|(place, _)| comes(*place)).unzip();
    match kept.0.len() == expected.len() {
        true => kept,
        false => (places, roles),
    }
}

/// Up to where each byte received is known to stand for a byte sent, in a ring that does not give back a byte for a byte: up to the
/// first one that meets a fault, or that is left out of a long run.
pub(super) fn known_places(
    sent: &[(u8, bool)],
    places: &[usize],
    roles: &[Role],
    expected: &[(Instant, Received)],
    received: &[(Instant, Received)],
) -> usize {
    let damaged = places.iter().position(|place| !sent[*place].1);
    let known = match damaged {
        Some(damaged) => damaged,
        // Without a fault it is the drives that lose bytes, or swallow or send some where they report an error.
        None if expected.len() == places.len() => places.len(),
        // Up to the error: a sync byte, or a byte of a command that is echoed, does not come back as it was.
        None => {
            let lost = |(index, role): (usize, &Role)| match role {
                Role::Foreign => true,
                Role::Sync | Role::Command { .. } => expected
                    .get(index)
                    .is_none_or(|(_, byte)| !byte.is(sent[places[index]].0)),
                _ => false,
            };
            let error = roles.iter().enumerate().position(lost);
            error.unwrap_or(roles.len())
        }
    };
    let short = |bytes: &[(Instant, Received)]| {
        let same = |run: &[(Instant, Received)]| run.iter().all(|byte| byte.1 == run[0].1);
        let long = bytes.windows(LONGEST_RUN + 1).position(same);
        long.map_or(usize::MAX, |from| from + LONGEST_RUN)
    };
    known.min(short(expected)).min(short(received))
}

/// Drives that report an error send for ever (9.9), and a real clock does not cut that off at a byte: of a long run of
/// one byte only the beginning is compared.
pub(super) fn collapsed(bytes: &[(Instant, Received)]) -> Vec<(Instant, Received)> {
    let mut kept: Vec<(Instant, Received)> = Vec::new();
    let mut run = 0;
    for byte in bytes {
        let same = kept.last().is_some_and(|last| last.1 == byte.1);
        run = if same { run + 1 } else { 1 };
        if run <= LONGEST_RUN {
            kept.push(*byte);
        }
    }
    kept
}

/// Whether a byte is another one, or one too many or too few.
pub(crate) fn what_of(
    expected: &[(Instant, Received)],
    received: &[(Instant, Received)],
    index: usize,
) -> Symptom {
    const ALIKE: usize = 4;
    fn rest(bytes: &[(Instant, Received)], from: usize) -> &[(Instant, Received)] {
        bytes.get(from..).unwrap_or_default()
    }
    match (expected.get(index), received.get(index)) {
        (_, None) => return Symptom::Missing,
        (None, _) => return Symptom::Surplus,
        (Some((_, wanted)), Some((_, found))) if wanted.byte == found.byte => {
            return Symptom::LineStatus;
        }
        _ => {}
    }
    let run = |a: &[(Instant, Received)], b: &[(Instant, Received)]| {
        a.len() >= ALIKE
            && b.len() >= ALIKE
            && a[..ALIKE].iter().zip(b).all(|(a, b)| a.1.byte == b.1.byte)
    };
    if run(rest(expected, index + 1), rest(received, index)) {
        Symptom::Missing
    } else if run(rest(expected, index), rest(received, index + 1)) {
        Symptom::Surplus
    } else {
        Symptom::Value
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ND21 11.8: a telegram is lost while a drive tests itself; each byte that comes back stands for its own byte of the next one.
    #[test]
    fn lost_bytes_have_no_role() {
        let starts: Vec<_> = (0..12)
            .map(|n| Instant::START + Span::from_millis(n))
            .collect();
        let (way, all) = (
            Span::from_millis(2),
            ((0..12).collect(), vec![Role::Idle; 12]),
        );
        let back = starts[6..]
            .iter()
            .map(|at| (*at + way, Received::good(0x80)));
        let (places, roles) = heard(all, &starts, &back.collect::<Vec<_>>(), way);
        assert_eq!((places, roles.len()), ((6..12).collect::<Vec<_>>(), 6));
    }
}
