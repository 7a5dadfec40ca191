//! What a line does to telegrams and replies: it loses, damages and delays them.

use super::{MOST_LOST, MOST_WAYS};
use crate::rig::observed::Turn;
use harness_proto::decode::Decoded;
use harness_proto::profibus::Telegram;

/// Whether nothing has come to the first of these telegrams, and to as few as a line loses in one attempt.
pub(super) fn are_few(turns: &[Turn]) -> bool {
    let silent = turns.iter().take_while(|own| own.came.is_empty()).count();
    (1..=MOST_LOST).contains(&silent)
}

/// The telegrams, if the first reply behind the next ones is that to the telegram at this place: it has reached the slaves late.
pub(super) fn late_reply(turns: &[Turn], place: usize) -> Option<Vec<Turn>> {
    let behind = turns[place..].iter().position(|own| !own.came.is_empty())?;
    let mut late = turns.to_vec();
    let next = &mut late[place + behind];
    let octets: Vec<u8> = next.came.iter().map(|own| *own as u8).collect();
    let Decoded::Value { used, .. } = Telegram::decode(&octets) else {
        return None;
    };
    let rest = next.came.split_off(used);
    let reply = std::mem::replace(&mut next.came, rest);
    let read = next.read;
    (late[place].came, late[place].read) = (reply, read);
    Some(late)
}

/// How many of the replies that were sent a line may have damaged so that this came, and what is left of them to come: it has lost octets one
/// behind the other, or changed them.
pub(super) fn damages(sent: &[Vec<u8>], came: &[u16]) -> Vec<(usize, Vec<Vec<u8>>)> {
    let numbered = sent.iter().enumerate();
    let octets: Vec<(usize, u16)> = numbered
        .flat_map(|(reply, own)| own.iter().map(move |octet| (reply, u16::from(*octet))))
        .collect();
    let pairs = octets.iter().zip(came);
    let whole = pairs.take_while(|(sent, came)| sent.1 == **came).count();
    let alike = |from: usize, came: &[u16]| {
        let sent = octets.get(from..from + came.len()).unwrap_or_default();
        let mut pairs = sent.iter().zip(came);
        sent.len() == came.len() && pairs.all(|(sent, came)| sent.1 == *came || *came >= 0x100)
    };
    let left = |from: usize| -> Vec<Vec<u8>> {
        let left = octets.get(from..).unwrap_or_default();
        let replies = left.chunk_by(|one, other| one.0 == other.0);
        let octets = |own: &[(usize, u16)]| own.iter().map(|own| own.1 as u8).collect();
        replies.map(octets).collect()
    };
    let touched = |from: usize, to: usize| {
        let own = octets.get(from..to).unwrap_or_default();
        own.chunk_by(|one, other| one.0 == other.0).count()
    };
    if octets.is_empty() {
        return Vec::new();
    }
    let rest = &came[whole..];
    let changed = !rest.is_empty() && whole < octets.len() && alike(whole + 1, &rest[1..]);
    let mut ways = Vec::new();
    // The loss begins where something else came, or with a reply before that.
    let begins = |own: &usize| *own == whole || *own == 0 || octets[*own - 1].0 != octets[*own].0;
    for from in (0..=whole).filter(begins) {
        let rest = &came[from..];
        // Where nothing else came, the end was lost: that it comes later was looked at.
        let first = if rest.is_empty() {
            octets.len()
        } else {
            from + 1
        };
        let behind = (first..=octets.len()).filter(|own| alike(*own, rest));
        ways.extend(behind.map(|own| (touched(from, own), left(own + rest.len()))));
    }
    ways.extend(changed.then(|| (1, left(came.len()))));
    ways.sort_by_key(|own| own.0 + own.1.len());
    ways.dedup();
    ways.truncate(MOST_WAYS);
    ways
}

/// Whether octets are telegrams without a line error, and nothing else.
pub(super) fn are_whole(octets: &[u16]) -> bool {
    let own: Vec<u8> = octets.iter().map(|own| *own as u8).collect();
    let mut rest = &own[..];
    while let Decoded::Value { used, .. } = Telegram::decode(rest) {
        rest = &rest[used..];
    }
    rest.is_empty() && octets.iter().all(|own| *own < 0x100)
}
