//! Distils inputs: the few small ones that reach every protocol transition which all of them reach (ND21 9.1-9.9).

use harness_sim::transitions::{Reached, Transition, slug};
use std::fmt::Write as _;

/// How many bytes a line of a file holds.
const BYTES_A_LINE: usize = 16;

/// An input that is worth keeping.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Distilled {
    /// The input as the target takes it.
    pub input: Vec<u8>,
    /// What it reaches and those before it do not.
    pub new: Vec<Transition>,
}

impl Distilled {
    /// A name for its file, without ending: the section of the manual, the state and the event of the first transition that is new.
    #[must_use]
    pub fn name(&self) -> String {
        let Some(first) = self.new.first() else {
            return String::new();
        };
        let (section, state) = (first.state.section(), slug(first.state.name()));
        format!("{section}-{state}--{}", slug(first.event.name()))
    }

    /// The text of its file: what is new as comments, then the bytes.
    #[must_use]
    pub fn text(&self) -> String {
        let mut text = String::from("# reaches first:\n");
        // Writing to a String cannot fail.
        for cell in &self.new {
            let _infallible = writeln!(text, "#   {cell}");
        }
        for line in self.input.chunks(BYTES_A_LINE) {
            let digits: Vec<_> = line.iter().map(|byte| format!("{byte:02X}")).collect();
            let _infallible = writeln!(text, "{}", digits.join(" "));
        }
        text
    }
}

/// Chooses from `inputs`, beside those that reach `kept` already: again and again the one with the most new transitions a byte,
/// made as small as it can be without losing one of them. The same inputs in another order give the same.
///
/// # Panics
/// An input, or a part of one, breaks a rule of the target.
pub fn distil(body: fn(&[u8]) -> Reached, inputs: &[Vec<u8>], kept: &Reached) -> Vec<Distilled> {
    let mut sorted: Vec<_> = inputs.iter().collect();
    sorted.sort_by_key(|input| (input.len(), *input));
    sorted.dedup();
    let mut left: Vec<_> = sorted
        .into_iter()
        .map(|input| (input, body(input).beyond(kept)))
        .collect();
    let mut chosen = Vec::new();
    loop {
        left.retain(|(_, new)| new.count() > 0);
        // The first of equal ones is the shortest.
        let worth = |(input, new): &(&Vec<u8>, Reached)| new.count() * 10_000 / (input.len() + 1);
        let Some((input, wanted)) = left.iter().rev().max_by_key(|one| worth(one)) else {
            return chosen;
        };
        let input = shrunk(body, input, wanted);
        let reached = body(&input);
        let is_new = |cell: &Transition| wanted.contains(*cell);
        let new = Transition::reachable().filter(is_new).collect();
        for (_, new) in &mut left {
            *new = new.beyond(&reached);
        }
        chosen.push(Distilled { input, new });
    }
}

/// Leaves out what is not needed to reach `wanted`: halves first, single bytes last.
fn shrunk(body: fn(&[u8]) -> Reached, input: &[u8], wanted: &Reached) -> Vec<u8> {
    let mut input = input.to_vec();
    let mut size = input.len() / 2;
    while size > 0 {
        let mut place = 0;
        while place + size <= input.len() {
            let shorter = [&input[..place], &input[place + size..]].concat();
            if wanted.beyond(&body(&shorter)).count() == 0 {
                input = shorter;
            } else {
                place += size;
            }
        }
        size /= 2;
    }
    input
}

#[cfg(test)]
mod tests {
    use super::*;
    use harness_sim::fuzz::detector_watched;

    fn reach(inputs: &[Vec<u8>]) -> Reached {
        let mut all = Reached::default();
        inputs
            .iter()
            .for_each(|input| all.join(&detector_watched(input)));
        all
    }

    #[test]
    fn nothing_is_lost_and_nothing_is_idle() {
        let inputs = vec![
            // SYNCO; SYNCO and PAUSE, with bytes that add nothing; a zero; an address byte.
            vec![0, 0x80],
            vec![0, 0x80, 0x80, 0x80, 0x81, 0x80, 0x81],
            vec![0, 0],
            vec![0, 0x88, 0xFF, 0x00],
        ];
        let distilled = distil(detector_watched, &inputs, &Reached::default());
        let chosen: Vec<_> = distilled.iter().map(|one| one.input.clone()).collect();
        assert_eq!(reach(&chosen), reach(&inputs));
        let wanted = [
            vec![0, 0x88, 0xFF, 0x00],
            vec![0, 0],
            vec![0, 0x80],
            vec![0x80, 0x81],
        ];
        assert_eq!(chosen, wanted);
        let mut reversed = inputs.clone();
        reversed.reverse();
        assert_eq!(
            distil(detector_watched, &reversed, &Reached::default()),
            distilled
        );
        assert_eq!(distil(detector_watched, &inputs, &reach(&inputs)), []);
    }

    #[test]
    fn a_file_says_what_it_is_for_and_can_be_read_back() {
        let one = distil(detector_watched, &[vec![0, 0x80]], &Reached::default()).remove(0);
        assert_eq!(one.name(), "9.2-sync-byte-due-no-address-byte-seen--synco");
        let text = one.text();
        assert!(
            text.contains("#   sync byte due, no address byte seen: SYNCO\n"),
            "{text}"
        );
        let read = super::super::input::input("a.hex", text.as_bytes());
        assert_eq!(read.as_ref(), Ok(&one.input));
    }
}
