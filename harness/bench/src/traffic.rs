//! The order of what channels carried.

use harness_proto::time::Instant;
use harness_sim::record::Channel;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// The bytes of every link in order of time; at one instant in order of links. Gives the link's place and the byte's.
pub fn in_time(links: &[Channel]) -> impl Iterator<Item = (usize, usize)> + '_ {
    let first = links.iter().enumerate().filter_map(|(place, link)| {
        let byte = link.octets().first()?;
        Some(Reverse((byte.at, place, 0)))
    });
    let mut heap: BinaryHeap<Reverse<(Instant, usize, usize)>> = first.collect();
    std::iter::from_fn(move || {
        let mut top = heap.peek_mut()?;
        let Reverse((at, place, index)) = *top;
        match links[place].octets().get(index + 1) {
            // A capture may be out of order: then its own order counts.
            Some(next) => *top = Reverse((next.at.max(at), place, index + 1)),
            None => drop(std::collections::binary_heap::PeekMut::pop(top)),
        }
        Some((place, index))
    })
}
