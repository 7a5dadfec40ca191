//! Octets on the line: the codec of telegrams, and what a slave makes of octets with line errors and gaps.

use crate::fault::Flips;
use crate::fuzz::{Feature, LONGEST, Notebook};
use crate::nordac::{Drive, InverterSetup, Member};
use crate::octet_segment::{LineHost, Octet, OctetSegment, Wish};
use crate::record::LineByte;
use harness_proto::decode::Decoded;
use harness_proto::nordac::pkw::Index;
use harness_proto::profibus::fdl::{ED, SC};
use harness_proto::profibus::rate::MIN_TSDR_BITS;
use harness_proto::profibus::{BusRate, Telegram};
use harness_proto::time::{Instant, Span};

const RATE: BusRate = BusRate::K500;
const ADDRESS: i32 = 8;
/// Most octets of an input that go on the line.
const MOST: usize = 400;
/// Idle bits in front of an octet.
const PAUSES: [u64; 8] = [0, 0, 0, 0, 1, 32, 33, 40];

/// The whole input as octets of telegrams; and as pairs of octets for a slave: what is wrong with an octet (bits 2 to 0 the idle time in front of it, bit 3
/// parity, bit 4 stop bit), and the octet.
///
/// # Panics
/// A telegram is not written as it was read, or a slave sends something that is no single reply of its own.
pub fn fdl(data: &[u8]) {
    noted(data, &mut Notebook::none());
}

/// The same, and what the octets are is noted.
///
/// # Panics
/// As [`fdl`].
pub(super) fn noted(data: &[u8], notes: &mut Notebook<'_>) {
    let data = &data[..data.len().min(LONGEST)];
    codec(data, notes);
    line(data, notes);
}

/// Reads telegram after telegram.
fn codec(data: &[u8], notes: &mut Notebook<'_>) {
    let mut rest = data;
    loop {
        match Telegram::decode(rest) {
            Decoded::NeedMore => return,
            Decoded::Value { value, used } => {
                assert_eq!(*value.encode(), rest[..used], "written as it was read");
                for short in 0..used {
                    let prefix = Telegram::decode(&rest[..short]);
                    assert_eq!(prefix, Decoded::NeedMore, "{:02X?}", &rest[..short]);
                }
                notes.note(|| Feature::new("EN 1", "a telegram", kind(&value)));
                rest = &rest[used..];
            }
            Decoded::Bad { reason, offset } => {
                assert!(offset < rest.len() && !reason.about().is_empty());
                // More octets never change the reason, and fewer do not settle it.
                let settled = Telegram::decode(&rest[..=offset]);
                assert_eq!(settled, Decoded::Bad { reason, offset });
                assert_eq!(Telegram::decode(&rest[..offset]), Decoded::NeedMore);
                notes.note(|| Feature::new("EN 1", "no telegram", reason.about()));
                rest = &rest[1..];
            }
        }
    }
}

fn kind(telegram: &Telegram) -> String {
    match telegram {
        Telegram::Confirmation => "short confirmation".to_owned(),
        Telegram::Token { .. } => "token".to_owned(),
        Telegram::Pdu(pdu) => format!("{:?}, FC {:02X}", pdu.form(), pdu.fc().0),
    }
}

/// Puts octets on a line with one slave.
fn line(data: &[u8], notes: &mut Notebook<'_>) {
    let setup = InverterSetup {
        parameters: vec![(1624, Index::default(), ADDRESS)],
        ..InverterSetup::default()
    };
    let drive = Drive::new(&setup, RATE, Instant::START);
    let stations = vec![
        Member::Host(LineHost::default()),
        Member::Drive(Box::new(drive)),
    ];
    let mut line = OctetSegment::new(RATE.format(), stations);
    let octets: Vec<Octet> = data.chunks_exact(2).take(MOST).map(octet).collect();
    // Pauses of T_SYN and more part telegrams for which the slave has the time to reply.
    for part in octets.chunk_by(|_, next| next.pause < RATE.bit_time() * 33) {
        let ready = line.now();
        let wish = Wish {
            ready,
            idle_bits: 33,
        };
        if let Some(host) = line.station_mut(0).host_mut() {
            host.send(wish, part.to_vec());
        }
        line.run_until(ready + RATE.bit_time() * (33 + 1_000) + time_of(part));
        judge(&mut line, notes);
    }
}

fn octet(pair: &[u8]) -> Octet {
    Octet {
        byte: pair[1],
        flips: Flips {
            parity: pair[0] & 8 != 0,
            stop: pair[0] & 16 != 0,
            ..Flips::default()
        },
        pause: RATE.bit_time() * PAUSES[usize::from(pair[0] & 7)],
    }
}

fn time_of(octets: &[Octet]) -> Span {
    octets.iter().fold(Span::ZERO, |time, octet| {
        time + octet.pause + RATE.octet_time()
    })
}

/// What the slave has sent is nothing or one reply of its own, after min T_SDR.
fn judge(line: &mut OctetSegment<Member<Box<Drive>>>, notes: &mut Notebook<'_>) {
    let sent = line.take_record(1);
    let asked = line.take_record(0);
    let Some(first) = sent.first() else {
        return;
    };
    let begun = first.at - RATE.octet_time();
    // It is behind the end of some telegram; octets that follow a request do not take it back.
    let latest = begun - RATE.bit_time() * MIN_TSDR_BITS;
    let ends = |octet: &LineByte| octet.at <= latest && octet.received == Some(ED);
    assert!(asked.iter().any(ends), "{sent:02X?} behind {asked:02X?}");
    let octets: Vec<u8> = sent.iter().filter_map(|octet| octet.sent).collect();
    let address = line
        .station(1)
        .drive()
        .map_or(0, |drive| drive.slave().address());
    match Telegram::decode(&octets) {
        Decoded::Value { value, used } => {
            assert_eq!(used, octets.len(), "one reply");
            if let Telegram::Pdu(pdu) = &value {
                assert!(
                    !pdu.fc().is_request() && pdu.sa() == address,
                    "{octets:02X?}"
                );
            } else {
                assert_eq!(octets, [SC]);
            }
            notes.note(|| Feature::new("EN 1", "a reply", kind(&value)));
        }
        other => panic!("{octets:02X?}: {other:?}"),
    }
}
