//! Captures as other people's adapters, analysers and programs write them: a master 3, a NORDAC inverter 5, and other devices.

use super::capture;
use harness_bench::capture::{ImportedCapture, JudgedFrames, ReadSettings, read_with};
use harness_bench::scenario::verdict::Verdict;
use harness_proto::time::Span;

/// The time of an octet at 500 kbit/s, in nanoseconds.
pub(super) const OCTET: u64 = 22_000;
const MASTER: u8 = 3;
const SLAVE: u8 = 5;

/// A telegram with a variable length, with service access points where they are given.
fn telegram(da: u8, sa: u8, fc: u8, saps: &[u8], data: &[u8]) -> Vec<u8> {
    let ext = if saps.is_empty() { 0 } else { 0x80 };
    let body = [&[da | ext, sa | ext, fc], saps, data].concat();
    let sum = body.iter().fold(0_u8, |sum, byte| sum.wrapping_add(*byte));
    let length = u8::try_from(body.len()).expect("short");
    [&[0x68, length, length, 0x68][..], &body, &[sum, 0x16]].concat()
}

/// A request to a slave, and its reply, that of Slave_Diag with this ident number (EN 2).
fn diagnosis(slave: u8, fc: u8, ident: [u8; 2]) -> [Vec<u8>; 2] {
    let data = [0x02, 0x05, 0x00, 0xFF, ident[0], ident[1]];
    [
        telegram(slave, MASTER, fc, &[60, 62], &[]),
        telegram(MASTER, slave, 0x08, &[62, 60], &data),
    ]
}

fn exchange(slave: u8, fc: u8, inputs: &[u8]) -> [Vec<u8>; 2] {
    let outputs = [0, 0, 0, 0, 0, 0, 0, 0, 0x04, 0x7E, 0, 0];
    [
        telegram(slave, MASTER, fc, &[], &outputs[..inputs.len()]),
        telegram(MASTER, slave, 0x08, &[], inputs),
    ]
}

/// What a right inverter replies while it is switched on (NORDAC 3.2.2).
const INPUTS: [u8; 12] = [0, 0, 0, 0, 0, 0, 0, 0, 0x0B, 0x70, 0, 0];

/// From switch-on into the exchange: five requests and their replies.
pub(super) fn start() -> Vec<[Vec<u8>; 2]> {
    let prm = [0x80, 0, 0, 0x0B, 0x75, 0x31, 0];
    vec![
        diagnosis(SLAVE, 0x6D, [0x75, 0x31]),
        [telegram(SLAVE, MASTER, 0x5D, &[61, 62], &prm), vec![0xE5]],
        [
            telegram(SLAVE, MASTER, 0x7D, &[62, 62], &[0xF3, 0xF1]),
            vec![0xE5],
        ],
        exchange(SLAVE, 0x5D, &INPUTS),
        exchange(SLAVE, 0x7D, &INPUTS),
    ]
}

/// Telegrams with the time when each begins: idle time of 33 bits in front of requests, and of 22 bits in front of replies.
pub(super) fn timed(exchanges: &[[Vec<u8>; 2]]) -> Vec<(u64, Vec<u8>)> {
    let (mut at, mut all) = (1_000_000, Vec::new());
    for (telegram, pause) in exchanges.iter().flatten().zip([2, 4].into_iter().cycle()) {
        if telegram.is_empty() {
            continue;
        }
        all.push((at, telegram.clone()));
        at += OCTET * (telegram.len() as u64 + pause);
    }
    all
}

fn pcap(link_type: u32, packets: impl IntoIterator<Item = (u64, Vec<u8>)>) -> Vec<u8> {
    let mut file = [0xA1B2_3C4D_u32, 0x0004_0002, 0, 0, 0xFFFF, link_type]
        .map(u32::to_le_bytes)
        .concat();
    for (nanos, data) in packets {
        let length = data.len() as u32;
        let header = [
            (nanos / 1_000_000_000) as u32,
            (nanos % 1_000_000_000) as u32,
            length,
            length,
        ];
        file.extend(header.map(u32::to_le_bytes).concat());
        file.extend(data);
    }
    file
}

/// Packets of link type 250 with an event.
fn serial(event: u8, telegrams: &[(u64, Vec<u8>)]) -> Vec<(u64, Vec<u8>)> {
    let header = [0, 0, 0, 0, 0, 0, 0, 0, event, 0, 0, 0];
    let packet = |(at, octets): &(u64, Vec<u8>)| (*at, [&header[..], octets].concat());
    telegrams.iter().map(packet).collect()
}

fn block(kind: u32, body: &[u8]) -> Vec<u8> {
    let mut body = body.to_vec();
    body.resize(body.len().next_multiple_of(4), 0);
    let length = (body.len() as u32 + 12).to_le_bytes();
    [&kind.to_le_bytes()[..], &length, &body, &length].concat()
}

/// A capture with interfaces, each with a name or none, and packets with the number of their interface.
fn pcapng(interfaces: &[&str], packets: &[(usize, u64, Vec<u8>)]) -> Vec<u8> {
    let section = [0x1A2B_3C4D_u32, 1, u32::MAX, u32::MAX]
        .map(u32::to_le_bytes)
        .concat();
    let mut file = block(0x0A0D_0D0A, &section);
    for name in interfaces {
        let mut body = [250_u32, 0].map(u32::to_le_bytes).concat();
        body.extend([9_u16, 1].map(u16::to_le_bytes).concat());
        body.extend([9, 0, 0, 0]);
        if !name.is_empty() {
            body.extend([2_u16, name.len() as u16].map(u16::to_le_bytes).concat());
            body.extend(name.as_bytes());
            body.resize(body.len().next_multiple_of(4), 0);
        }
        body.extend([0; 4]);
        file.extend(block(1, &body));
    }
    for (interface, nanos, data) in packets {
        let length = data.len() as u32;
        let header = [
            *interface as u32,
            (nanos >> 32) as u32,
            *nanos as u32,
            length,
            length,
        ];
        file.extend(block(
            6,
            &[&header.map(u32::to_le_bytes).concat()[..], data].concat(),
        ));
    }
    file
}

pub(super) fn settings(links: &[&str]) -> ReadSettings {
    ReadSettings {
        links: links
            .iter()
            .map(|link| link.parse().expect("a link"))
            .collect(),
        ..ReadSettings::default()
    }
}

pub(super) fn imported(file: &[u8], links: &[&str]) -> ImportedCapture {
    read_with(file, &settings(links)).unwrap_or_else(|error| panic!("{error}"))
}

pub(super) fn refused(file: &[u8], links: &[&str], words: &str) {
    let error = read_with(file, &settings(links))
        .expect_err(words)
        .to_string();
    assert!(error.contains(words), "{error}");
}

/// The verdict, how many replies were compared, and of how many; with what there is to say about it.
pub(super) fn judged(
    imported: &ImportedCapture,
    named: &[u8],
) -> ((Verdict, usize, usize), JudgedFrames) {
    let judged =
        capture::judged(&imported.capture.traces, None, (named, Span::ZERO)).expect("no setup");
    let (verdict, _) = imported.settle(judged.verdict);
    let count = (verdict, judged.compared, judged.replies);
    (count, judged)
}

pub(super) fn verdict(file: &[u8], links: &[&str]) -> (Verdict, usize, usize) {
    judged(&imported(file, links), &[]).0
}

pub(super) const PASSED: (Verdict, usize, usize) = (Verdict::Passed, 5, 5);

#[test]
fn octets_stand_behind_any_event() {
    let right = imported(&pcap(250, serial(0x02, &timed(&start()))), &["bus"]);
    assert_eq!(judged(&right, &[]).0, PASSED);
    for event in [0x00, 0x01, 0x06, 0x55] {
        let file = pcap(250, serial(event, &timed(&start())));
        assert_eq!(imported(&file, &["bus"]), right, "{event}");
    }
    // Octets alone, in a link type that says nothing of them.
    for link_type in [147, 162] {
        let file = pcap(link_type, timed(&start()));
        assert_eq!(imported(&file, &["bus"]), right);
        refused(&file, &[], "`--link bus`");
    }
    refused(
        &pcap(163, timed(&start())),
        &["bus"],
        "link type 163 is not read",
    );
    // What holds no octet is counted.
    let mut packets = serial(0x02, &timed(&start()));
    packets.extend(serial(0x00, &[(9_000_000, Vec::new())]));
    let found = imported(&pcap(250, packets), &["bus"]);
    assert_eq!(found.notes, ["1 packet not read: they hold no octet"]);
}

#[test]
fn the_user_says_what_an_interface_is() {
    let packets = |interface: usize| -> Vec<(usize, u64, Vec<u8>)> {
        let packets = serial(0x02, &timed(&start())).into_iter();
        packets
            .map(|(at, packet)| (interface, at, packet))
            .collect()
    };
    for (names, link) in [
        (&[""][..], "bus"),
        (&["COM3"], "bus"),
        (&["COM3"], "bus=COM3"),
        (&[""], "bus=0"),
        (&["bus"], "bus"),
        (&["bus"], "bus=bus"),
        (&["COM3", "COM4"], "bus=COM3"),
    ] {
        assert_eq!(
            verdict(&pcapng(names, &packets(0)), &[link]),
            PASSED,
            "{names:?} {link}"
        );
    }
    refused(
        &pcapng(&[""], &packets(0)),
        &[],
        "has no name: say what it carries",
    );
    refused(&pcapng(&["COM3"], &packets(0)), &[], "\"COM3\" is neither");
    refused(
        &pcapng(&["", ""], &packets(0)),
        &["bus"],
        "`--link \"bus=1\"`",
    );
    let other = imported(&pcapng(&["COM3", "COM4"], &packets(1)), &["bus=COM3"]);
    assert_eq!(
        other.notes,
        ["10 packets not read: their interface carries no link that is read"]
    );
    assert_eq!(judged(&other, &[]).0.0, Verdict::Inconclusive);
    // The same name twice, at the same time: two records of one line, or two lines.
    let both = [packets(0), packets(1)].concat();
    refused(
        &pcapng(&["bus", "bus"], &both),
        &[],
        "two interfaces are named \"bus\"",
    );
    let behind = packets(0).into_iter().enumerate();
    let behind = behind.map(|(place, packet)| (place / 6, packet.1, packet.2));
    assert_eq!(
        verdict(&pcapng(&["bus", "bus"], &behind.collect::<Vec<_>>()), &[]),
        PASSED
    );
}

/// Frames of CAN that tcpdump captures at `any`: after a header of 16 or 20 bytes that names the protocol. libpcap leaves the identifier in
/// the order of the computer, and other programs have that of networks.
#[test]
fn cooked_captures_of_can() {
    let frame = |id: u32, swapped: bool, data: &[u8]| {
        let id = if swapped {
            id.to_le_bytes()
        } else {
            id.to_be_bytes()
        };
        [&id[..], &[data.len() as u8, 0, 0, 0], data].concat()
    };
    let cooked = |version: u32, protocol: u8, interface: u8, inner: Vec<u8>| {
        let header = match version {
            113 => vec![0, 1, 1, 0x18, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, protocol],
            _ => vec![
                0, protocol, 0, 0, 0, 0, 0, interface, 1, 0x18, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0,
            ],
        };
        [header, inner].concat()
    };
    for (version, swapped) in [(113, false), (113, true), (276, false), (276, true)] {
        let packets = |second: u8| {
            [
                (
                    1_000,
                    cooked(version, 0x0C, 3, frame(0x201, swapped, &[0x3D, 0x1B, 0])),
                ),
                (
                    500_000,
                    cooked(
                        version,
                        0x0C,
                        second,
                        frame(0x181, swapped, &[0x1B, 1, 0, 0]),
                    ),
                ),
                (600_000, cooked(version, 0x08, 1, vec![0x45, 0])),
                (
                    700_000,
                    cooked(version, 0x0C, 3, frame(0x8000_0201, swapped, &[])),
                ),
                (800_000, cooked(version, 0x0D, 3, vec![0; 72])),
            ]
        };
        let found = imported(&pcap(version, packets(3)), &[]);
        let frames: Vec<_> = found.capture.traces[0].channels[0]
            .frames()
            .iter()
            .collect();
        let shown: Vec<_> = frames.iter().map(|frame| frame.frame.to_string()).collect();
        assert_eq!(
            shown,
            ["201#3D1B00", "181#1B010000", "00000201#"],
            "{version} {swapped}"
        );
        assert_eq!(frames[1].from, Some(1));
        let notes = [
            "1 packet not read: they are frames of CAN FD",
            "1 packet not read: they are of other networks than CAN",
        ];
        assert_eq!(found.notes, notes);
        if version == 276 {
            refused(
                &pcap(version, packets(4)),
                &[],
                "--link \"bus=interface 4\"",
            );
        }
        // Nothing panics where a packet is cut.
        let whole = pcap(version, packets(3));
        for length in 0..whole.len() {
            let _any = read_with(&whole[..length], &settings(&[]));
        }
    }
}

/// The octets of a line in pieces of an adapter, each with the time when it was read.
fn pieces(octets: &[u8], size: usize) -> Vec<(u64, Vec<u8>)> {
    let pieces = octets.chunks(size).zip(1..);
    pieces
        .map(|(octets, place)| (place * 16_000_000, octets.to_vec()))
        .collect()
}

#[test]
fn pieces_of_an_adapter_are_joined() {
    let octets = timed(&start())
        .into_iter()
        .flat_map(|telegram| telegram.1)
        .collect::<Vec<_>>();
    for size in 2..=octets.len() {
        let file = pcap(250, serial(0x04, &pieces(&octets, size)));
        assert_eq!(verdict(&file, &["bus"]), PASSED, "{size}");
    }
    // An octet is lost: what it belonged to was not compared, and nothing passes.
    // A short confirmation leaves nothing behind, as a slave that does not reply.
    for lost in (0..octets.len()).filter(|place| octets[*place] != 0xE5) {
        let mut octets = octets.clone();
        octets.remove(lost);
        let file = pcap(250, serial(0x04, &pieces(&octets, 16)));
        let (found, all) = judged(&imported(&file, &["bus"]), &[]);
        // What the begin or the end of a capture cuts was not heard whole.
        let at_an_end = lost < start()[0][0].len() || lost + start()[4][1].len() >= octets.len();
        assert!(
            found.0 == Verdict::Inconclusive || at_an_end && found.1 < 5,
            "{lost}: {found:?} {:?}",
            all.differences
        );
    }
    // Pieces that were read sooner after each other than their octets take are not mixed.
    let mut near = pieces(&octets, 16);
    near.iter_mut()
        .zip(1..)
        .for_each(|((at, _), place)| *at = place * 125_000);
    for event in [0x02, 0x04] {
        assert_eq!(verdict(&pcap(250, serial(event, &near)), &["bus"]), PASSED);
    }
    // So where packets are cut by a snapshot length.
    let mut file = pcap(250, serial(0x02, &timed(&start())));
    file[24 + 12] += 1;
    assert_eq!(verdict(&file, &["bus"]).0, Verdict::Inconclusive);
}

/// A slave of another vendor (EN 2) is not judged unless it is named; one that nothing shows to be an inverter is not accused.
#[test]
fn other_devices_on_the_line() {
    let other = |slave: u8| {
        [
            diagnosis(slave, 0x6D, [0x0C, 0x11]),
            exchange(slave, 0x5D, &[0xFF; 2]),
        ]
    };
    let both = [start(), other(9).to_vec()].concat();
    let found = imported(&pcap(250, serial(0x02, &timed(&both))), &["bus"]);
    let (count, all) = judged(&found, &[]);
    assert_eq!(count, PASSED);
    assert!(
        all.remarks[0].starts_with(
            "slave 9 is not judged (2 replies): its diagnosis has the ident number 0C11"
        ),
        "{:?}",
        all.remarks
    );
    assert_eq!(judged(&found, &[5]).0, PASSED);
    assert_eq!(judged(&found, &[5, 9]).0, (Verdict::Failed, 7, 7));
    assert_eq!(judged(&found, &[9]).0, (Verdict::Failed, 2, 2));
    assert_eq!(judged(&found, &[5, 77]).0, (Verdict::Inconclusive, 5, 5));
    // Only the exchange was heard: nothing shows whose it is.
    let unknown = [
        start(),
        [0x5D, 0x7D].map(|fc| exchange(9, fc, &[0xFF; 2])).to_vec(),
    ]
    .concat();
    let found = imported(&pcap(250, serial(0x02, &timed(&unknown))), &["bus"]);
    assert_eq!(judged(&found, &[]).0.0, Verdict::Inconclusive);
    assert_eq!(judged(&found, &[5, 9]).0.0, Verdict::Failed);
    // A master takes another device for an inverter; an inverter that sends another ident number once.
    let prm = [0x80, 0, 0, 0x0B, 0x75, 0x31, 0];
    let set_up = vec![[telegram(9, MASTER, 0x5D, &[61, 62], &prm), vec![0xE5]]];
    let mistaken = [start(), set_up, other(9).to_vec()].concat();
    let found = imported(&pcap(250, serial(0x02, &timed(&mistaken))), &["bus"]);
    assert_eq!(judged(&found, &[]).0.0, Verdict::Inconclusive);
    let wrong = [start(), vec![diagnosis(SLAVE, 0x5D, [0x75, 0x32])]].concat();
    let wrong = verdict(&pcap(250, serial(0x02, &timed(&wrong))), &["bus"]);
    assert_eq!(wrong.0, Verdict::Failed);
}

/// A tap does not show whether a request has reached the slave (EN 1): the master repeats it, and it is answered.
#[test]
fn a_request_without_a_reply_accuses_no_slave() {
    let lost = |exchange: &[Vec<u8>; 2]| [exchange[0].clone(), Vec::new()];
    let mut repeated = start();
    repeated.insert(4, lost(&repeated[4]));
    let mut skipped = start();
    skipped.insert(4, lost(&exchange(SLAVE, 0x7D, &INPUTS)));
    skipped.push(exchange(SLAVE, 0x5D, &INPUTS));
    for exchanges in [repeated, skipped] {
        let found = imported(&pcap(250, serial(0x02, &timed(&exchanges))), &["bus"]);
        let (count, all) = judged(&found, &[]);
        assert_eq!(count.0, Verdict::Inconclusive, "{:?}", all.differences);
    }
}

/// A request that a tap has damaged, and that the slave has read and answered, accuses no slave.
#[test]
fn a_request_that_a_tap_has_damaged_accuses_no_slave() {
    for number in (0..10).step_by(2) {
        let mut telegrams = serial(0x02, &timed(&start()));
        telegrams[number].1[8] = 0x08;
        let file = pcap(250, telegrams);
        let (count, all) = judged(&imported(&file, &["bus"]), &[]);
        let compared = count.0 == Verdict::Inconclusive || number == 0;
        assert!(
            compared && count.1 < 5,
            "{number}: {count:?} {:?}",
            all.differences
        );
        assert_eq!(all.differences, Vec::<String>::new());
    }
}

/// A reply that cannot be read is counted, and one that the end of the capture cuts is no fault.
#[test]
fn what_was_not_compared_is_counted() {
    let mut telegrams = serial(0x02, &timed(&start()));
    telegrams[7].1[8] = 0x08;
    let found = imported(&pcap(250, telegrams.clone()), &["bus"]);
    let (count, all) = judged(&found, &[]);
    assert_eq!(count, (Verdict::Inconclusive, 3, 4));
    assert!(
        all.remarks.contains(
            &"1 reply not compared: the reply or its request could not be read".to_owned()
        ),
        "{:?}",
        all.remarks
    );
    let mut telegrams = serial(0x02, &timed(&start()));
    let last = telegrams.last_mut().expect("a reply");
    last.1.truncate(20);
    assert_eq!(
        verdict(&pcap(250, telegrams), &["bus"]),
        (Verdict::Passed, 4, 4)
    );
}
