//! Telegrams as pcapng, link type 250 (`LINKTYPE_RTAC_SERIAL`): one interface a station, one packet a telegram.
//!
//! | block | content |
//! |---|---|
//! | section header | `shb_userappl` drivebench |
//! | interface | `if_name` the sender: `master`, `slave 8`; `if_tsresol` 9: nanoseconds |
//! | packet | the time when the last stop bit of the telegram had passed, since the start, cut off below; 12 bytes of header, the octets as they arrived |
//!
//! The event in the header is `DATA_RX_START`, or that of the first line error in the telegram; a comment names its octet: `byte 3: parity`.

use super::telegrams::{Said, said};
use crate::report::pcapng::{
    Block, COMMENT, END, ERRORS, HEADER, IF_NAME, IF_TSRESOL, INTERFACE, LINK_TYPE, NANOSECONDS,
    PACKET, RECEIVED,
};
use harness_sim::record::Trace;
use std::collections::BTreeSet;
use std::io::Write;

/// Writes the telegrams of a run.
///
/// # Errors
/// What the writer says.
pub fn write(traces: &[Trace], mut out: impl Write) -> std::io::Result<()> {
    let mut block = Block::default();
    block.section(&mut out)?;
    let telegrams: Vec<_> = traces.iter().flat_map(said).collect();
    let slaves: BTreeSet<u8> = telegrams.iter().filter_map(|own| own.from).collect();
    let senders: Vec<_> = std::iter::once(None)
        .chain(slaves.into_iter().map(Some))
        .collect();
    for sender in &senders {
        block.begin(INTERFACE);
        block.put(&LINK_TYPE.to_le_bytes());
        block.put(&[0; 6]);
        block.option(IF_NAME, super::table::station(*sender).as_bytes());
        block.option(IF_TSRESOL, &[NANOSECONDS]);
        block.option(END, &[]);
        block.end(&mut out)?;
    }
    for own in &telegrams {
        let interface = senders.iter().position(|sender| *sender == own.from);
        packet(&mut block, interface.unwrap_or_default(), own);
        block.end(&mut out)?;
    }
    out.flush()
}

fn packet(block: &mut Block, interface: usize, own: &Said) {
    let nanos = own.at.since_start().as_nanos();
    let event = own.error.and_then(|(_, error)| {
        let known = ERRORS.iter().find(|(other, _)| *other == error);
        known.map(|(_, event)| *event)
    });
    let seconds = u32::try_from(nanos / 1_000_000_000).unwrap_or(u32::MAX);
    let micros = u32::try_from(nanos % 1_000_000_000 / 1_000).unwrap_or(0);
    let length = u32::try_from(HEADER + own.octets.len()).unwrap_or(u32::MAX);
    let [h0, h1, h2, h3, l0, l1, l2, l3] = nanos.to_be_bytes();
    block.begin(PACKET);
    block.put(&u32::try_from(interface).unwrap_or(u32::MAX).to_le_bytes());
    block.put(&[h3, h2, h1, h0, l3, l2, l1, l0]);
    block.put(&length.to_le_bytes());
    block.put(&length.to_le_bytes());
    block.put(&seconds.to_be_bytes());
    block.put(&micros.to_be_bytes());
    block.put(&[event.unwrap_or(RECEIVED), 0, 0, 0]);
    block.put(&own.octets);
    block.pad();
    if let Some((place, error)) = own.error {
        block.option(COMMENT, format!("byte {place}: {error}").as_bytes());
        block.option(END, &[]);
    }
}
