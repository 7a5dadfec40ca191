//! What the ring's fuzz targets reach: cells of the matrix of protocol transitions, and what each target names itself.

use super::{
    bus_end_watched, codec, detector_watched, drive, guard, hostile, jobs, links, ring_watched,
};
use crate::fuzz::{Feature, InputPieces, Notebook, Noting};
use crate::novobus::transitions::{Event, Reached, Transition, WITHOUT_TIME_OUT};

/// Notes the cells of the matrix.
fn cells(notes: &mut Notebook<'_>, reached: &Reached) {
    if notes.wanted() {
        for cell in Transition::reachable().filter(|cell| reached.contains(*cell)) {
            notes.note(|| of_cell(cell));
        }
    }
}

/// A cell of the matrix as a feature.
#[must_use]
pub fn of_cell(cell: Transition) -> Feature {
    Feature::new(cell.state.section(), cell.state.name(), cell.event.name())
}

/// The targets whose bodies are here.
pub const NOTING: [Noting; 9] = [
    Noting {
        name: "bus_end",
        body: |data, notes| cells(notes, &bus_end_watched(data)),
        pieces: bytes(1, 1),
        of: Some(|| Transition::reachable().count()),
    },
    Noting {
        name: "codec",
        body: codec::noted,
        pieces: bytes(0, 1),
        of: Some(codec::count),
    },
    Noting {
        name: "detector",
        body: |data, notes| cells(notes, &detector_watched(data)),
        pieces: bytes(1, 1),
        of: Some(|| WITHOUT_TIME_OUT),
    },
    Noting {
        name: "links",
        body: links::noted,
        pieces: bytes(1, 1),
        of: Some(links::count),
    },
    Noting {
        name: "ring",
        body: |data, notes| cells(notes, &ring_watched(data)),
        pieces: bytes(2, 1),
        of: Some(parity_only),
    },
    Noting {
        name: "drive",
        body: drive::noted,
        pieces: bytes(0, 4),
        of: None,
    },
    Noting {
        name: "master",
        body: hostile::noted,
        pieces: bytes(1, 1),
        of: None,
    },
    Noting {
        name: "jobs",
        body: jobs::noted,
        pieces: bytes(2, 6),
        of: None,
    },
    Noting {
        name: "guard",
        body: guard::noted,
        pieces: bytes(5, 1),
        of: None,
    },
];

const fn bytes(head: usize, record: usize) -> InputPieces {
    InputPieces::Bytes { head, record }
}

/// Of the line errors the inputs of `ring` can express parity alone.
fn parity_only() -> usize {
    let expressed =
        |cell: &Transition| !matches!(cell.event, Event::Framing | Event::Break | Event::Overrun);
    Transition::reachable().filter(expressed).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Nor does an input of `detector` know silence: counted by the names of events and sections.
    fn without_time_outs() -> usize {
        let expressed = |cell: &Transition| {
            let other = matches!(
                cell.event,
                Event::Framing | Event::Break | Event::Overrun | Event::Silence
            );
            !other && cell.state.section() != "9.9"
        };
        Transition::reachable().filter(expressed).count()
    }

    /// The figures of the corpus's README.
    #[test]
    fn how_many_there_are() {
        assert_eq!((without_time_outs(), parity_only()), (175, 288));
        assert_eq!(without_time_outs(), WITHOUT_TIME_OUT);
    }
}
