//! The time that the bench adds to the time on the wire, and its processor load, on rings that another process serves at the pace of
//! the line, 38400 bit/s (ND21 8.1).
//!
//! Each conversation is played in four ways: in virtual time, which is the wire's own; by a program that only writes to the socket and
//! reads from it, the baseline; by the same program where it never sleeps, which nothing can be faster than; and by the bench, with guard,
//! record, and everything else that a rig has. The program writes what was sent in virtual time, and what was sent behind an answer when
//! as much has come back. What the first adds is the system's, which wakes it for each answer; what the second adds, the served ring's. What
//! the bench adds to that is its own: less than nothing where it is awake when an answer comes, and the program has to be woken up. Beside
//! the program that never sleeps it is all that the bench does with an answer.
//!
//! They take turns, on rings of their own, so that what else the computer does slows down all; each figure is the middle one of
//! its own kind. A turn is repeated if the host of a virtual machine took its processors away meanwhile: after a stall of 10 ms or
//! more the bench sends SYNCO further ahead for a while, which is not what is measured here.

#![expect(clippy::print_stdout, reason = "figures are what it is for")]

#[path = "../tests/served/ring.rs"]
#[expect(dead_code, reason = "only tests write a rig file of it")]
mod ring;

use harness::buses::novobus::BUS;
use harness::buses::parse_rig as parse;
use harness::library::Entry;
use harness::port::PortAddress;
use harness::rig::{Rig, UseOptions};
use harness::scenario::run::AtMismatch;
use harness::scenario::source::Source;
use harness_proto::time::Span;
use harness_sim::record::LineByte;
use harness_sim::record::Trace;
use ring::Served;
use rustix::time::{ClockId, clock_gettime};
use std::io::{ErrorKind, Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

/// How often each is measured; the middle one counts.
const TIMES: usize = 11;

/// How often at most, where turns are taken again; those least disturbed count.
const AT_MOST: usize = 3 * TIMES;

/// The part of a turn from which on the processors that were taken away count.
const DISTURBED: f64 = 0.02;

/// How long it takes until a bench that stood still works as before.
const CALM: Duration = Duration::from_millis(1_500);

/// How long a served ring is given to see that its client has gone.
const TURN: Duration = Duration::from_millis(500);

/// Bytes of a conversation: a second on the wire.
const BYTES: usize = 3_491;

/// A conversation.
struct Case {
    name: &'static str,
    text: String,
}

/// Bytes that go out together, once `back` bytes have come back.
struct Chunk {
    back: usize,
    bytes: Vec<u8>,
}

fn cases(drives: u8) -> Vec<Case> {
    let header = |name: &str| format!("title {name}\nsource nd21 8.1\nring {drives}\n");
    let idle = "SYNCO without a gap";
    let reads = "reads, each behind the answer to the one before";
    let jobs = "jobs of the driver, each behind the end of the one before";
    // An answer takes a whole round, and a job with the count of the drives in front of it some more: on a long ring there is time for few.
    let questions = 2_000 / (usize::from(drives) + 8);
    vec![
        Case {
            name: idle,
            text: format!("{}> 80*{BYTES}\n< 80*{BYTES}\n", header(idle)),
        },
        Case {
            name: reads,
            text: header(reads) + &"read-byte 0 FE13\n".repeat(questions),
        },
        Case {
            name: jobs,
            text: header(jobs) + &"master read-byte 0 FE13 = xx\n".repeat(questions / 3 + 1),
        },
    ]
}

/// What the master sends in a conversation: behind a pause, or behind SYNCO with something to say, it has waited for what came until then.
fn chunks(trace: &Trace, byte_time: Span) -> Vec<Chunk> {
    let (Some(first), Some(last)) = (trace.channels.first(), trace.channels.last()) else {
        return Vec::new();
    };
    let mut chunks: Vec<Chunk> = Vec::new();
    let mut before = (harness_proto::time::Instant::START, 0x80);
    for byte in first.octets() {
        let sent = byte.sent.expect("no fault");
        let says = sent != 0x80 && before.1 == 0x80;
        if chunks.is_empty() || says || before.0 + byte_time < byte.at {
            let home = |other: &&LineByte| other.at + byte_time <= byte.at;
            chunks.push(Chunk {
                back: last.octets().iter().filter(home).count(),
                bytes: Vec::new(),
            });
        }
        chunks.last_mut().expect("one").bytes.push(sent);
        before = (byte.at, sent);
    }
    chunks
}

/// What this process has had of a processor.
fn processor() -> Duration {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    Duration::new(
        u64::try_from(time.tv_sec).unwrap_or(0),
        u32::try_from(time.tv_nsec).unwrap_or(0),
    )
}

/// The time that the host has stolen from a virtual machine's processors so far, in seconds (Linux, proc_stat(5)); 0 if it is not reported.
fn taken_away() -> f64 {
    let stat = std::fs::read_to_string("/proc/stat").unwrap_or_default();
    let all = stat.lines().find_map(|line| line.strip_prefix("cpu "));
    let steal = all.and_then(|all| all.split_whitespace().nth(7)?.parse::<f64>().ok());
    // In hundredths of a second.
    steal.unwrap_or(0.0) / 100.0
}

/// Seconds on the clock, and the share of a processor.
struct Took {
    clock: f64,
    share: f64,
}

impl Took {
    /// `clock` is what counts, where that is less than all that `act` does.
    fn of(act: impl FnOnce() -> Option<f64>) -> Self {
        let (before, begin) = (processor(), Instant::now());
        let counts = act();
        let clock = counts.unwrap_or(begin.elapsed().as_secs_f64());
        Self {
            clock,
            share: (processor() - before).as_secs_f64() / clock,
        }
    }
}

/// What each took in a turn.
struct Turn {
    bare: Took,
    awake: Took,
    bench: Took,
}

fn middle(all: &[Turn], of: impl Fn(&Turn) -> f64) -> f64 {
    let mut all: Vec<f64> = all.iter().map(of).collect();
    all.sort_by(f64::total_cmp);
    all[all.len() / 2]
}

/// The baseline: each chunk is written when what it is an answer to has come back.
fn bare(stream: &mut TcpStream, chunks: &[Chunk], awake: bool) -> Took {
    stream.set_nonblocking(awake).expect("a socket");
    Took::of(|| {
        let mut buffer = [0; 4_096];
        let (mut sent, mut came) = (0, 0);
        let mut read_until = |stream: &mut TcpStream, back| {
            while came < back {
                match stream.read(&mut buffer) {
                    Err(error) if error.kind() == ErrorKind::WouldBlock => std::hint::spin_loop(),
                    read => came += read.expect("bytes"),
                }
            }
        };
        for chunk in chunks {
            read_until(stream, chunk.back);
            stream.write_all(&chunk.bytes).expect("room");
            sent += chunk.bytes.len();
        }
        read_until(stream, sent);
        assert_eq!(came, sent, "what was sent comes home, and nothing else");
        None
    })
}

fn main() {
    // `cargo test --benches` only wants to know whether it starts.
    if std::env::args().any(|argument| argument == "--test") {
        return;
    }
    println!(
        "{:>6}  {:57} {:>9} {:>8} {:>8} {:>8} {:>8} {:>8} {:>7} {:>7} {:>5}",
        "drives",
        "conversation",
        "wire",
        "bare",
        "awake",
        "bench",
        "own",
        "own",
        "bare",
        "bench",
        "turns"
    );
    println!(
        "{:>6}  {:57} {:>9} {:>8} {:>8} {:>8} {:>8} {:>8} {:>7} {:>7} {:>5}",
        "", "", "ms", "added", "added", "added", "to bare", "to awake", "CPU", "CPU", ""
    );
    // `cargo bench --bench rig -- 1 3` for these alone.
    let asked: Vec<u8> = std::env::args()
        .filter_map(|argument| argument.parse().ok())
        .collect();
    let rings = if asked.is_empty() {
        vec![1, 3, 100, 250]
    } else {
        asked
    };
    for drives in rings {
        let serve = || Served::start("nd21", &[drives], "tcp", false, &[]);
        let (for_bare, for_bench) = (serve(), serve());
        for case in cases(drives) {
            let source = Source {
                name: "bench.scn".to_owned(),
                text: case.text.clone().into(),
            };
            let entry = Entry::new(source, Some(drives)).expect("a scenario");
            let mut link = entry.settled.simulate();
            let virtual_time = entry.settled.play(&mut *link, AtMismatch::Stop);
            assert!(virtual_time.finding.is_none(), "{:?}", virtual_time.finding);
            let wire = virtual_time.took.as_millis_f64() / 1e3;
            let chunks = chunks(&link.trace(0), entry.rate().byte_time());
            let (all, turns) =
                in_turns(address(&for_bare), &chunks, &rig(&for_bench), &entry.source);
            let added = |clock: f64| 100.0 * (clock / wire - 1.0);
            let own = |than: fn(&Turn) -> f64| {
                100.0 * middle(&all, |turn| turn.bench.clock - than(turn)) / wire
            };
            println!(
                "{drives:>6}  {:57} {:9.2} {:7.2}% {:7.2}% {:7.2}% {:7.2}% {:7.2}% {:6.2}% {:6.2}% {turns:>5}",
                case.name,
                wire * 1e3,
                added(middle(&all, |turn| turn.bare.clock)),
                added(middle(&all, |turn| turn.awake.clock)),
                added(middle(&all, |turn| turn.bench.clock)),
                own(|turn| turn.bare.clock),
                own(|turn| turn.awake.clock),
                100.0 * middle(&all, |turn| turn.bare.share),
                100.0 * middle(&all, |turn| turn.bench.share),
            );
            // A second client is turned away while the first one has not been seen to go.
            std::thread::sleep(TURN);
        }
    }
}

fn address(served: &Served) -> &str {
    match &served.endpoints[0] {
        PortAddress::Tcp(address) => address,
        _ => unreachable!("a socket"),
    }
}

/// The served ring as a rig.
fn rig(served: &Served) -> Rig {
    let text = format!(
        "schema = 1\n[rig]\nid = \"bench\"\n[ring.1]\ndrives = {}\ntransport = \"tcp\"\nport = \"{}\"\n\
         time_tolerance = \"100ms\"\n[health]\nbetween = false\n",
        served.sizes[0],
        address(served)
    );
    let rig = parse(&Source {
        name: "bench.toml".to_owned(),
        text: text.into(),
    });
    rig.expect("a rig")
}

/// The conversation by the bare program, asleep and awake, and on a rig in use, again and again: its own time, and what it cost of a processor.
/// The second value says how many turns it took.
fn in_turns(address: &str, chunks: &[Chunk], rig: &Rig, source: &Source) -> (Vec<Turn>, usize) {
    let mut stream = TcpStream::connect(address).expect("a server");
    stream.set_nodelay(true).expect("no delay");
    let commands = BUS.rigs.as_ref().expect("rigs of rings");
    let mut run = (commands.run)(rig, &UseOptions::default()).expect("a rig in use");
    let calm = |turn: &&(f64, _)| turn.0 < DISTURBED;
    let mut turn = || {
        let before = taken_away();
        let asleep = bare(&mut stream, chunks, false);
        let awake = bare(&mut stream, chunks, true);
        let bench = Took::of(|| {
            let played = run.play(source, None).expect("a healthy rig");
            assert!(played.outcome.finding.is_none(), "{:?}", played.outcome);
            Some(played.outcome.took.as_millis_f64() / 1e3)
        });
        let turn = Turn {
            bare: asleep,
            awake,
            bench,
        };
        let clocks = turn.bare.clock + turn.awake.clock + turn.bench.clock;
        ((taken_away() - before) / clocks, turn)
    };
    let mut all = Vec::new();
    while all.len() < AT_MOST && all.iter().filter(calm).count() < TIMES {
        let last = turn();
        if !calm(&&last) {
            std::thread::sleep(CALM);
        }
        all.push(last);
    }
    let turns = all.len();
    all.sort_by(|one, other| one.0.total_cmp(&other.0));
    all.truncate(TIMES);
    let all = all.into_iter().map(|(_, turn)| turn).collect();
    assert_eq!(run.trouble(), None);
    let _end = run.close(false);
    (all, turns)
}
