//! Tests when the link is awake for an answer.

use super::*;
use harness_bench::link::pump::{SLACK, STAY};
use harness_bench::link::{LinkFault, Octets};
use harness_bench::port::{PortAddress, PortSettings, open};
use harness_proto::novobus::sync::SYNCO;
use harness_sim::fault::Flips;
use std::io::Write as _;
use std::net::{TcpListener, TcpStream};
use std::time;

const DRIVES: u8 = 3;

/// A link with a ring of three on a socket, and the end of that socket that is the ring's.
fn link() -> (StreamLink, TcpStream) {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = listener.local_addr().expect("an address").to_string();
    let settings = PortSettings {
        address: PortAddress::Tcp(address),
        format: Rate::default().into(),
        marks: false,
        low_latency: false,
    };
    let wire = open(&settings).expect("a wire");
    let (ring, _) = listener.accept().expect("a client");
    let link = StreamLink::new(
        vec![(wire, DRIVES)],
        Vec::new(),
        Rate::default(),
        Arc::default(),
    );
    (link, ring)
}

/// The last byte is back when it has passed all drives; each takes a byte time (ND21 8.2).
#[test]
fn who_waits_is_awake_for_the_last_byte() {
    let (mut link, _ring) = link();
    assert_eq!(link.pump.awaited(link.now()), None, "nothing is under way");
    let free = link.send_octets(0, &[0x88, 0xFF]);
    let home = free + link.byte_time() * u64::from(DRIVES);
    assert_eq!(link.pump.awaited(Instant::START), Some(home));
    assert_eq!(link.pump.awaited(home), Some(home));
    assert_eq!(
        link.pump.awaited(home + STAY),
        None,
        "it is late: who knows when it comes"
    );
}

/// An announced answer is due before SYNCO that was sent behind it.
#[test]
fn who_waits_says_for_what() {
    let (mut link, _ring) = link();
    let free = link.send_octets(0, &[0x88, SYNCO, SYNCO]);
    let home = free + link.byte_time() * u64::from(DRIVES);
    let said = home - link.byte_time() * 2;
    link.attend(0, said);
    assert_eq!(link.pump.awaited(Instant::START), Some(said));
    assert_eq!(link.pump.awaited(said + STAY), Some(home));
    link.begin();
    assert_eq!(link.pump.awaited(Instant::START), None);
}

/// The link does not stay awake for a byte that has arrived.
#[test]
fn what_has_come_is_not_waited_for() {
    let (mut link, mut ring) = link();
    let end = link.send_octets(0, &[0x88]) + Span::from_millis(60_000);
    ring.write_all(&[0x8B]).expect("room");
    while link.receive_octet(0).is_none() {
        assert!(link.now() < end && link.wait(end), "{:?}", link.trouble());
    }
    assert_eq!(link.pump.awaited(Instant::START), None);
}

/// A byte counts as lost later if the computer was late: the byte may already be in the buffer, or the ring stood still as well.
#[test]
fn who_was_away_waits_for_lost_bytes_as_much_longer() {
    let (mut link, _ring) = link();
    link.send_octets(0, &[0x80]);
    let calm = link.pump.round(&link.pump.ports[0]);
    let now = time::Instant::now();
    link.pump
        .late
        .woken(now, now + time::Duration::from_secs(8));
    let away = link.pump.round(&link.pump.ports[0]);
    assert!(away > calm + SLACK, "{away}, {calm} before");
}

/// A byte that arrived while the ports were not polled is not lost, however long that was.
#[test]
fn who_was_away_looks_before_a_byte_counts_as_lost() {
    let (mut link, mut ring) = link();
    let free = link.send_octets(0, &[0x80]);
    ring.write_all(&[0x80]).expect("room");
    let over = free + link.pump.round(&link.pump.ports[0]);
    while link.now() <= over {
        std::thread::sleep(time::Duration::from_millis(5));
    }
    assert!(link.busy(), "nobody has looked");
    assert!(link.wait(link.now() + Span::from_millis(60_000)));
    assert!(!link.busy());
    assert_eq!(link.receive_octet(0).map(|(_, byte)| byte.byte), Some(0x80));
    // A missing byte counts as lost at the first poll behind its time, without a sleep.
    let free = link.send_octets(0, &[0x80]);
    let over = free + link.pump.round(&link.pump.ports[0]);
    while link.now() <= over {
        std::thread::sleep(time::Duration::from_millis(5));
    }
    assert!(link.busy(), "nobody has looked");
    assert!(link.wait(link.now() + Span::from_millis(60_000)));
    assert!(!link.busy(), "it is lost");
}

/// A caller that stalls while it polls for an answer counts as late, like one that is woken late.
#[test]
fn who_stands_still_while_awake_is_late() {
    let (mut link, _ring) = link();
    let long = Span::from_millis(60_000);
    while link.pump.awake.is_none() {
        // The computer may be late here too: then try again with the next byte.
        let free = link.send_octets(0, &[0x88]);
        let home = free + link.byte_time() * u64::from(DRIVES);
        while link.pump.awake.is_none() && link.now() < home + STAY {
            assert!(link.wait(home + long));
        }
    }
    std::thread::sleep(time::Duration::from_millis(20));
    assert!(link.wait(link.now() + long));
    let late = link.pump.lateness();
    assert!(late > Span::from_millis(15), "{late}");
}

/// A peer that sends without end is no line; its bytes must not fill the memory.
#[test]
fn a_flood_ends_the_link() {
    let (mut link, mut ring) = link();
    let flood = std::thread::spawn(move || while ring.write_all(&[0; 65_536]).is_ok() {});
    let end = link.now() + Span::from_millis(60_000);
    while link.trouble().is_none() && link.now() < end {
        link.wait(end);
        while link.receive_octet(0).is_some() {}
    }
    let trouble = link.trouble().map(ToString::to_string).unwrap_or_default();
    assert!(
        trouble.contains("more than a line of this rate"),
        "{trouble}"
    );
    drop(link);
    flood.join().expect("it ends with the socket");
}

/// A UART has one parity setting for both directions. A damaged byte waits until the byte in front of it has come back, where nothing stated
/// is broken by it and drives that monitor time-outs miss nothing (ND21 9.9).
#[test]
fn a_wrong_parity_bit_waits_for_a_silent_line() {
    let byte = Rate::default().byte_time();
    let parity = LinkFault::Flip(Flips {
        parity: true,
        ..Flips::default()
    });
    let start = |drives: u8, before: usize, pause: Span, tolerance: Span, fault: Option<_>| {
        let (mut link, _ring) = link();
        let mut port = link.pump.ports.remove(0);
        port.accounting.drives = drives;
        port.shares_parity = true;
        for _ in 0..before {
            port.send(Instant::START, 0x88, byte);
        }
        if let Some(fault) = fault {
            port.outgoing.suffer(fault);
        }
        let now = port.free + pause;
        port.pause(now, byte, tolerance);
        let at = port.free.max(now);
        port.send(now, 0xFE, byte);
        assert_eq!(port.queue.back().map(|queued| queued.0), Some(at));
        assert_eq!(port.free, at + byte, "what comes behind it is later too");
        at.since(Instant::START + byte * before as u64)
    };
    let (tolerance, none) = (TOLERANCE, Span::ZERO);
    let silent = byte * 3 + Span::from_millis(2);
    assert_eq!(start(3, 1, none, tolerance, Some(parity)), silent);
    let late = Span::from_micros(100);
    assert_eq!(start(3, 2, late, tolerance, Some(parity)), silent);
    // A sound byte, another fault, the first of a conversation, a large ring, exact times, a stated pause.
    assert_eq!(start(3, 1, none, tolerance, None), none);
    let replaced = Some(LinkFault::Replace(0x55));
    assert_eq!(start(3, 1, none, tolerance, replaced), none);
    assert_eq!(start(3, 0, none, tolerance, Some(parity)), none);
    let long = Span::from_millis(250);
    for drives in [13, 14, 250] {
        let wanted = byte * u64::from(drives) + Span::from_millis(2);
        let waits = wanted <= Span::from_millis(6);
        let silence = if waits { wanted } else { none };
        assert_eq!(
            start(drives, 1, none, long, Some(parity)),
            silence,
            "{drives} drives"
        );
    }
    assert_eq!(start(3, 1, none, Span::from_millis(2), Some(parity)), none);
    let pause = Span::from_millis(1);
    assert_eq!(start(3, 1, pause, tolerance, Some(parity)), pause);
}
