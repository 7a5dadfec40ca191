//! The links between drives at which a bench acts and listens, as its file names them.

use harness_bench::file::values::LinkName;
use harness_bench::rig::Rig;
use harness_bench::rig::file::{Interposer, Transport};

/// The inner links at which the bench can put faults; those at its own ends need none.
pub(super) fn reached(rig: &Rig) -> Vec<(usize, usize)> {
    links(rig, rig.file.interposer.iter().map(at))
}

/// Those of them on which no byte can get a wrong parity bit: with an interposer that has one serial port for both directions.
pub(super) fn keeping_parity(rig: &Rig) -> Vec<(usize, usize)> {
    let one = |interposer: &&Interposer| {
        let port = &interposer.upstream;
        *port == interposer.downstream && port.transport == Transport::Serial
    };
    let interposers = rig.file.interposer.iter().filter(one).map(at);
    interposers
        .map(|(ring, link)| place(rig, ring, link))
        .collect()
}

/// The links on which bytes were seen: by ring and place.
pub(super) fn heard(rig: &Rig) -> Vec<(usize, usize)> {
    let taps = rig.file.tap.iter().map(|tap| (tap.ring, tap.link));
    links(rig, rig.file.interposer.iter().map(at).chain(taps))
}

/// The number of drives of a ring, counted from 0.
fn drives(rig: &Rig, ring: usize) -> u8 {
    rig.sizes().get(ring).copied().unwrap_or(0)
}

/// The number of its ring, and its link.
const fn at(interposer: &Interposer) -> (u8, LinkName) {
    (interposer.ring, interposer.link)
}

/// The ring and the place of a link between drives.
fn place(rig: &Rig, ring: u8, link: LinkName) -> (usize, usize) {
    let ring = usize::from(ring).saturating_sub(1);
    let place = link
        .from
        .map_or(0, |from| drives(rig, ring).saturating_sub(from));
    (ring, usize::from(place))
}

/// The master's own links and those between drives that are given by the number of their ring; all links of simulated rings.
fn links(rig: &Rig, inner: impl Iterator<Item = (u8, LinkName)>) -> Vec<(usize, usize)> {
    let inner: Vec<_> = inner.map(|(ring, link)| place(rig, ring, link)).collect();
    let all = (0..rig.sizes().len())
        .flat_map(|ring| (0..=usize::from(drives(rig, ring))).map(move |place| (ring, place)));
    let end =
        |(ring, place): &(usize, usize)| *place == 0 || *place == usize::from(drives(rig, *ring));
    all.filter(|place| rig.is_simulated() || end(place) || inner.contains(place))
        .collect()
}
