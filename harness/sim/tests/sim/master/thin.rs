//! The thin path, end to end: one read on a ring of three.

use super::common::Couple;
use harness_proto::novobus::command::Command;
use harness_proto::novobus::master::{Job, MasterOptions, Outcome};

/// ND21 9.7, the telegram of the example; 10.1.
#[test]
fn one_read_on_a_ring_of_three() {
    let mut couple = Couple::plain(3, MasterOptions::default()).ready();
    couple.poke(1, 0xFE13, 0x88);
    let id = couple.submit(Job::new(1, Command::ReadByte { address: 0xFE13 }));
    couple.finish(40);
    let Some(Outcome::Read(data)) = couple.outcome(id) else {
        panic!("{:?}", couple.events);
    };
    assert_eq!(data.value(), Some(0x88));
    assert_eq!(couple.bytes()[..6], [0x88, 0xFE, 0xC0, 0x13, 0xFE, 0xD1]);
    assert_eq!(couple.master.counters().done, 1);
}
