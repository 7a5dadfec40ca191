//! The segment behind streams of clients, without I/O: how telegrams are known, line errors, several masters.

use super::language::Nordac;
use super::serve::{SegmentServer, bench};
use harness_bench::medium::ErrorMarks;
use harness_bench::scenario::plan::Plan;
use harness_bench::scenario::source::Source;
use harness_bench::serve::ServedBus;
use harness_bench::web::LiveView;
use harness_proto::time::{Instant, Span};

const STATUS: [u8; 6] = [0x10, 0x08, 0x02, 0x49, 0x53, 0x16];
const PRESENT: [u8; 6] = [0x10, 0x02, 0x08, 0x00, 0x0A, 0x16];
const DIAGNOSIS: [u8; 11] = [0x68, 5, 5, 0x68, 0x88, 0x82, 0x6C, 0x3C, 0x3E, 0xF0, 0x16];

struct Clients {
    server: SegmentServer,
    now: Instant,
}

impl Clients {
    fn new(clients: usize, marks: ErrorMarks) -> Self {
        Self::of(bench(Some(&[8]), None).expect("a bench"), clients, marks)
    }

    fn of(plan: Plan<Nordac>, clients: usize, marks: ErrorMarks) -> Self {
        let mut server = SegmentServer::new(plan, clients, marks);
        (0..clients).for_each(|seat| server.come(seat));
        let now = Instant::START;
        Self { server, now }
    }

    fn pass(&mut self, time: Span) {
        self.now += time;
        self.server.advance(self.now);
    }

    fn send(&mut self, seat: usize, octets: &[u8]) {
        self.server.receive(seat, octets).expect("no wrong mark");
    }

    /// Nothing comes within 10 ms.
    fn hears_nothing(&mut self, seat: usize) -> bool {
        self.heard(seat).is_empty()
    }

    /// What comes within 10 ms.
    fn heard(&mut self, seat: usize) -> Vec<u8> {
        self.pass(Span::from_millis(10));
        let octets = self.server.transmit(seat).to_vec();
        self.server.transmitted(seat, octets.len());
        octets
    }
}

/// A telegram is whole however it is cut, and two in one piece are two.
#[test]
fn telegrams_are_known_by_their_octets() {
    let mut clients = Clients::new(1, ErrorMarks::None);
    for cut in 0..STATUS.len() {
        clients.send(0, &STATUS[..cut]);
        assert!(clients.hears_nothing(0), "{cut}");
        clients.send(0, &STATUS[cut..]);
        assert_eq!(clients.heard(0), PRESENT, "{cut}");
    }
    clients.send(0, &[STATUS, STATUS].concat());
    assert_eq!(clients.heard(0), [PRESENT, PRESENT].concat());
}

/// What is no telegram is on the line as it came and is not answered; a telegram after it is.
#[test]
fn what_is_no_telegram_is_not_answered() {
    for garbage in [
        &[0x00][..],
        &[0xFF, 0x16, 0xE5],
        &[0x10, 0x08, 0x02, 0x49, 0x54, 0x16],
        &[0x68, 0x05, 0x06, 0x68],
        &[0x68, 0xFF],
        &[
            0x68, 0x05, 0x05, 0x68, 0x88, 0x82, 0x6C, 0x3C, 0x3E, 0xF1, 0x16,
        ],
        &[0xDC, 0x03, 0x02],
    ] {
        let mut clients = Clients::new(2, ErrorMarks::None);
        clients.send(0, garbage);
        assert!(clients.hears_nothing(0), "{garbage:X?}");
        clients.send(0, &STATUS);
        assert_eq!(clients.heard(0), PRESENT, "{garbage:X?}");
        assert_eq!(
            clients.heard(1),
            [garbage, &STATUS[..], &PRESENT[..]].concat()
        );
        // In one piece too.
        clients.send(0, &[garbage, &STATUS[..]].concat());
        assert_eq!(clients.heard(0), PRESENT, "{garbage:X?}");
    }
}

/// The begin of a telegram that does not go on leaves after 20 ms, and nothing waits for ever.
#[test]
fn a_telegram_that_does_not_go_on() {
    let mut clients = Clients::new(2, ErrorMarks::None);
    clients.send(0, &STATUS[..4]);
    assert!(clients.hears_nothing(1));
    assert!(clients.server.deadline() <= clients.now + Span::from_millis(10));
    clients.pass(Span::from_millis(10));
    assert_eq!(clients.heard(1), STATUS[..4]);
    clients.send(0, &STATUS[4..]);
    assert!(clients.hears_nothing(0));
    clients.pass(Span::from_millis(30));
    clients.send(0, &STATUS);
    assert_eq!(clients.heard(0), PRESENT);
}

/// With marks an octet goes out with wrong parity, and the slave does not answer (EN 1).
#[test]
fn marks_carry_parity_errors() {
    let mut clients = Clients::new(2, ErrorMarks::InBand);
    let [a, b, c, d, e, f] = STATUS;
    clients.send(0, &[a, b, 0xFF, 0x00, c, d, e, f]);
    assert!(clients.hears_nothing(0));
    let heard = clients.heard(1);
    assert_eq!(heard, [a, b, 0xFF, 0x00, c, d, e, f]);
    clients.send(0, &STATUS);
    assert_eq!(clients.heard(0), PRESENT);
}

/// At 500 kbit/s a reply begins 11 bits after its request, and 33 idle bits stand in front of the request.
#[test]
fn times_are_those_of_the_line() {
    let mut clients = Clients::new(1, ErrorMarks::None);
    clients.send(0, &DIAGNOSIS);
    // 33 + 11 x 11 + 11 bits, and the first octet of the reply, at 2 us a bit.
    let first = Span::from_micros(2 * (33 + 121 + 11 + 11));
    clients.pass(first.saturating_sub(Span::from_micros(1)));
    assert!(clients.server.transmit(0).is_empty());
    clients.pass(Span::from_micros(1));
    assert_eq!(clients.server.transmit(0), [0x68]);
}

/// A client that sends more than the line carries is held back, and one that does not read loses octets that are counted.
#[test]
fn memory_is_bounded() {
    let mut clients = Clients::new(1, ErrorMarks::None);
    let mut taken = 0;
    while clients.server.room(0) >= STATUS.len() && taken < 1_000_000 {
        clients.send(0, &STATUS);
        taken += STATUS.len();
    }
    assert!(taken < 30_000, "{taken}");
    for _ in 0..1000 {
        clients.send(0, &STATUS);
        clients.pass(Span::from_millis(50));
    }
    assert!(clients.server.transmit(0).len() <= 64 << 10);
    for _ in 0..12_000 {
        clients.send(0, &STATUS);
        clients.pass(Span::from_millis(1));
    }
    assert!(clients.server.lost(0) > 0);
    assert!(clients.server.transmit(0).len() <= 64 << 10);
}

/// Tokens that a master gives to itself are counted in a row below the others; one to another station has a row of its own.
#[test]
fn a_page_counts_tokens_of_a_lone_master() {
    let mut clients = Clients::new(1, ErrorMarks::None);
    clients.server.watch(true);
    let first = [0xDC, 2, 2];
    let other = [0xDC, 3, 2];
    for telegram in [&first[..], &STATUS, &first, &first, &other] {
        clients.send(0, telegram);
        clients.pass(Span::from_millis(10));
    }
    let rows = clients.server.news().rows;
    let said: Vec<_> = rows
        .iter()
        .map(|row| (row.fold, row.words.as_str()))
        .collect();
    assert_eq!(said.len(), 4, "{said:?}");
    assert!(said[..3].iter().all(|said| said.0 == 0), "{said:?}");
    assert!(said[2].1.starts_with("token  2 gives it to 3"), "{said:?}");
    assert_eq!(said[3], (3, "token 2\u{2192}2"));
}

/// The header's slaves are there beside those of the command line; without either there is slave 8.
#[test]
fn slaves_of_header_and_command_line() {
    use harness_bench::scenario::source::Source;
    let header = Source::new(
        "setup",
        "slave 9 ppo 2\nslave 20 parameter 1621 = 3\nrate 1500\n",
    );
    let addresses = |plan: &harness_bench::scenario::plan::Plan<super::language::Nordac>| {
        let slaves = plan.setup.slaves.iter();
        slaves.map(|slave| slave.address).collect::<Vec<_>>()
    };
    let plan = bench(Some(&[8, 20]), Some(&header)).expect("a bench");
    assert_eq!(addresses(&plan), [8, 20, 9]);
    assert_eq!(plan.setup.rate.name(), "1500");
    assert_eq!(addresses(&bench(None, None).expect("a bench")), [8]);
    assert_eq!(
        addresses(&bench(None, Some(&header)).expect("a bench")),
        [9, 20]
    );
    let mut server = SegmentServer::new(plan, 1, ErrorMarks::None);
    for (line, answer) in [
        ("? slave 8 parameter 1621 = 2", "ok"),
        ("? slave 20 parameter 1621 = 3", "ok"),
        ("? slave 9 parameter 1621 = 0", "ok"),
    ] {
        let found = server.control(line).expect("an answer").to_string();
        assert_eq!(found, answer, "{line}");
    }
    assert_eq!(server.control("  # nothing"), None);
}

/// EN 2: the diagnosis shows that a slave refuses Set_Prm or Chk_Cfg, not why. Why is said once, and `state` repeats it until it is over.
#[test]
fn why_a_slave_refuses_its_master_is_said() {
    let set_prm = |master: u8, data: &[u8]| request(master, &[&[0x3D, 0x3E], data].concat());
    let chk_cfg = |master: u8, cfg: &[u8]| request(master, &[&[0x3E, 0x3E], cfg].concat());
    let right = set_prm(2, &[0x80, 0, 0, 0x0B, 0x75, 0x31, 0]);
    let watchdog = |one, two| set_prm(2, &[0x88, one, two, 0x0B, 0x75, 0x31, 0]);
    let configurations: [(&[u8], &str); 4] = [
        (
            &[0xF3, 0xF1],
            "PPO1, to which the slave is set (1622), is F3 F1",
        ),
        (
            &[0xF3, 0xF5],
            "PPO2, to which the slave is set (1622), is F3 F5",
        ),
        (&[0xF1], "PPO3, to which the slave is set (1622), is F1"),
        (&[0xF5], "PPO4, to which the slave is set (1622), is F5"),
    ];
    for (place, (cfg, about)) in configurations.iter().enumerate() {
        let header = format!("slave 8 ppo {}\n", place + 1);
        let header = Source::from_bytes("setup".into(), header.into_bytes()).expect("a text");
        let plan = bench(None, Some(&header)).expect("a bench");
        let mut clients = Clients::of(plan, 1, ErrorMarks::None);
        let mut rows = vec![
            (chk_cfg(2, cfg), "the slave waits for Set_Prm".to_owned()),
            (
                set_prm(2, &[0x80, 0, 0, 0x0B, 0x75, 0x31]),
                "it has 6 octets".to_owned(),
            ),
            (
                set_prm(2, &[0x80, 0, 0, 0x0B, 0x75, 0x32, 0]),
                "ident number 7532, and a NORDAC vector has 7531".to_owned(),
            ),
            (
                watchdog(0, 5),
                "the watchdog on with the factors 0 and 5".to_owned(),
            ),
            (
                watchdog(5, 0),
                "the watchdog on with the factors 5 and 0".to_owned(),
            ),
            (
                set_prm(2, &[0x80, 0, 0, 0x0B, 0x75, 0x31, 0, 1, 2]),
                "2 octets of user parameters".to_owned(),
            ),
        ];
        let others = configurations.iter().map(|(other, _)| *other);
        for other in others
            .chain([&[][..], &[0xF3, 0xF1, 0xF1]])
            .filter(|other| other != cfg)
        {
            rows.push((right.clone(), String::new()));
            let shown: Vec<_> = other.iter().map(|octet| format!("{octet:02X}")).collect();
            let shown = if other.is_empty() {
                "empty".to_owned()
            } else {
                shown.join(" ")
            };
            let why = format!("its configuration is {shown}, and that of {about}");
            rows.push((chk_cfg(2, other), why));
        }
        rows.push((right.clone(), String::new()));
        rows.push((chk_cfg(2, cfg), String::new()));
        let locked = "of master 3 is refused: master 2 has locked the slave";
        rows.push((
            set_prm(3, &[0x80, 0, 0, 0x0B, 0x75, 0x31, 0]),
            format!("Set_Prm {locked}"),
        ));
        rows.push((chk_cfg(3, cfg), format!("Chk_Cfg {locked}")));
        rows.push((right.clone(), String::new()));
        for (telegram, why) in rows {
            for time in [0, 1] {
                clients.send(0, &telegram);
                assert!(!clients.heard(0).is_empty(), "{why}");
                let news = clients.server.remarks().concat();
                match why.is_empty() || time == 1 {
                    true => assert_eq!(news, ""),
                    false => assert!(
                        news.starts_with("slave 8: ") && news.contains(&why),
                        "{news}, not {why}"
                    ),
                }
                assert_eq!(news.lines().count(), usize::from(!news.is_empty()));
                let state = format!("{:?}", clients.server.control("state 8"));
                assert_eq!(state.contains("refused="), !why.is_empty(), "{state}");
                assert!(state.contains(&why), "{state}");
            }
        }
    }
}

/// A telegram of a master to slave 8 with SAPs.
fn request(master: u8, data: &[u8]) -> Vec<u8> {
    let body = [&[0x88, 0x80 | master, 0x4C], data].concat();
    let length = u8::try_from(body.len()).expect("short");
    let sum = harness_proto::profibus::fdl::check_sum(&body);
    [&[0x68, length, length, 0x68], &body[..], &[sum, 0x16]].concat()
}
