//! Worlds of a drive that counts.

use super::*;

/// What a line has left of a piece.
const DAMAGED: u8 = 250;

/// A drive that holds a number, which counts up each scan while it runs, and says it where it is asked.
#[derive(Clone, Debug, Default)]
struct CountingDrive {
    scans: u64,
    runs: bool,
    number: u8,
    /// Says its number at 100 by itself.
    alarm: bool,
    /// Whether it was told to do what nothing is known of.
    wanders: bool,
    /// At which numbers it was stopped, as a checksum.
    stops: u64,
    said: VecDeque<u8>,
}

/// 0 asks, 1 starts, 2 stops, 3 makes it wander; a higher number is set. 200 asks where a stream parts it.
impl RightDrive for CountingDrive {
    type Piece = u8;
    const SCAN: Span = Span::from_millis(1);

    fn due(&self) -> Option<Instant> {
        self.runs.then(|| ms(self.scans + 1))
    }

    fn advance(&mut self, to: Instant) {
        let to = to.since_start().units() / Self::SCAN.units();
        while self.scans < to {
            self.scans += 1;
            self.number = self.number.saturating_add(u8::from(self.runs));
            if self.runs && self.alarm && self.number == 100 {
                self.said.push_back(self.number);
            }
        }
    }

    fn hear(&mut self, _: Instant, piece: &u8) {
        match piece {
            0 => self.said.push_back(self.number),
            1 => self.runs = true,
            2 => {
                self.runs = false;
                self.stops = self.stops.wrapping_mul(1_000_003) + u64::from(self.number);
            }
            3 => self.wanders = true,
            200 => {}
            other => self.number = *other,
        }
    }

    fn hear_parted(&self, at: Instant, piece: &u8) -> Option<Self> {
        let mut drive = (*piece == 200).then(|| self.clone())?;
        drive.hear(at, &0);
        Some(drive)
    }

    fn is_damaged(came: &u8) -> bool {
        *came == DAMAGED
    }

    fn knows(&self) -> bool {
        !self.wanders
    }

    fn say(&mut self) -> Option<u8> {
        self.said.pop_front()
    }

    fn is(&self, said: &u8, came: &u8) -> bool {
        said == came
    }

    fn state(&self) -> u64 {
        let state = self.stops << 10 ^ u64::from(self.number) << 2;
        state | u64::from(self.runs) << 1 | u64::from(self.wanders)
    }
}

fn ms(millis: u64) -> Instant {
    Instant::START + Span::from_millis(millis)
}

/// What was sent can reach the drive up to 3 ms later, and what came was on the bus up to 1 ms before.
fn judged(alarm: bool, sent: &[(u64, u8)], came: &[(u64, u8)]) -> WorldsVerdict<u8> {
    judged_with(alarm, sent, came, 0)
}

/// The same where this many pieces may be lost.
fn judged_with(
    alarm: bool,
    sent: &[(u64, u8)],
    came: &[(u64, u8)],
    most_lost: usize,
) -> WorldsVerdict<u8> {
    let drive = CountingDrive {
        alarm,
        ..CountingDrive::default()
    };
    judge(vec![drive], &dialogue(sent, came, most_lost))
}

fn dialogue(sent: &[(u64, u8)], came: &[(u64, u8)], most_lost: usize) -> Dialogue<u8> {
    let timed = |list: &[(u64, u8)], before, after| -> Vec<_> {
        let piece = |(at, piece): &(u64, u8)| TimedPiece {
            earliest: ms(at - before),
            latest: ms(at + after),
            piece: *piece,
        };
        list.iter().map(piece).collect()
    };
    Dialogue {
        sent: timed(sent, 0, 3),
        came: timed(came, 1, 0),
        end: ms(300),
        lag: Span::from_millis(1),
        overtakes: false,
        asked: Vec::new(),
        complete: false,
        most_lost,
        loses_sent: false,
        most_steps: 50_000,
    }
}

/// What it holds does not depend on when it was set.
#[test]
fn a_value_is_compared_exactly_where_nothing_moves() {
    assert_eq!(
        judged(false, &[(10, 7), (20, 0)], &[(22, 7)]),
        WorldsVerdict::Right
    );
    let wrong = judged(false, &[(10, 7), (20, 0)], &[(22, 8)]);
    assert_eq!(wrong, WorldsVerdict::Wrong(0, Some(7)));
}

/// A value that moves is compared between the earliest and the latest start.
#[test]
fn a_value_that_moves_is_one_that_the_times_allow() {
    let reads = |number| judged(false, &[(10, 1), (50, 0)], &[(51, number)]);
    for number in [37, 40, 42] {
        assert_eq!(reads(number), WorldsVerdict::Right, "{number}");
    }
    for number in [25, 55] {
        assert_ne!(reads(number), WorldsVerdict::Right, "{number}");
    }
    // Two readings are those of one start.
    let both = |second| {
        judged(
            false,
            &[(10, 1), (50, 0), (60, 0)],
            &[(51, 38), (61, second)],
        )
    };
    assert_eq!(both(48), WorldsVerdict::Right);
    assert_ne!(both(38), WorldsVerdict::Right);
}

/// What a drive says by itself must come, and what it does not say must not.
#[test]
fn what_comes_unasked_is_what_a_drive_says_by_itself() {
    let asked = [(10, 1)];
    assert_eq!(judged(true, &asked, &[(112, 100)]), WorldsVerdict::Right);
    assert_eq!(
        judged(true, &asked, &[]),
        WorldsVerdict::Wrong(0, Some(100))
    );
    assert_ne!(judged(true, &asked, &[(150, 100)]), WorldsVerdict::Right);
    assert_ne!(
        judged(true, &asked, &[(112, 100), (113, 100)]),
        WorldsVerdict::Right
    );
    assert_eq!(judged(true, &[(10, 1), (60, 2)], &[]), WorldsVerdict::Right);
    assert_eq!(judged(true, &[], &[(10, 0)]), WorldsVerdict::Wrong(0, None));
}

/// What an adapter has lost explains that something has not come, and not that something else has.
#[test]
fn lost_pieces_explain_what_has_not_come() {
    let sent = [(10, 7), (20, 0), (40, 0), (60, 0)];
    let came = |lost: &[(u64, u8)], most| judged_with(false, &sent, lost, most);
    let one = [(22, 7), (62, 7)];
    assert_ne!(came(&one, 0), WorldsVerdict::Right);
    assert_eq!(came(&one, 1), WorldsVerdict::Right);
    assert_ne!(came(&one[1..], 1), WorldsVerdict::Right);
    assert_eq!(came(&one[1..], 2), WorldsVerdict::Right);
    assert_ne!(came(&[(22, 7), (62, 8)], 2), WorldsVerdict::Right);
    assert_ne!(came(&[(22, 7), (24, 7)], 2), WorldsVerdict::Right);
}

/// A line that loses what was sent, damages what was said, or parts what was sent.
#[test]
fn a_line_loses_damages_and_parts_pieces() {
    let places = |sent: &[(u64, u8)], came: &[(u64, u8)]| {
        let mut talk = dialogue(sent, came, 2);
        (talk.loses_sent, talk.complete) = (true, true);
        lost(CountingDrive::default(), &talk, &|| ()).ok()
    };
    let sent = [(10, 7), (30, 8), (50, 0), (70, 0)];
    assert_eq!(places(&sent, &[(52, 8), (72, 8)]), Some(vec![]));
    assert_eq!(places(&sent, &[(52, 7), (72, 7)]), Some(vec![1]));
    assert_eq!(places(&sent, &[(52, 8), (72, 7)]), None);
    assert_eq!(places(&sent, &[(52, DAMAGED), (72, 8)]), Some(vec![2]));
    assert_eq!(places(&sent, &[(52, DAMAGED), (72, 7)]), Some(vec![1, 2]));
    let parted = [(10, 7), (30, 200), (50, 0)];
    assert_eq!(places(&parted, &[(32, 7), (52, 7)]), Some(vec![]));
    assert_eq!(places(&parted, &[(52, 7)]), Some(vec![]));
    assert_eq!(places(&parted, &[(32, 9), (52, 7)]), None);
}

/// What was read before a piece was sent is no answer to it.
#[test]
fn an_answer_is_read_behind_its_question() {
    let judged = |asked: &[usize]| {
        let mut talk = dialogue(
            &[(10, 7), (11, 0), (12, 8), (13, 0)],
            &[(14, 8), (15, 8)],
            1,
        );
        talk.asked = asked.to_vec();
        talk.most_lost = 0;
        judge(vec![CountingDrive::default()], &talk)
    };
    assert_ne!(judged(&[4, 4]), WorldsVerdict::Right);
    let one = |asked| {
        let talk = dialogue(&[(10, 7), (11, 0), (12, 8)], &[(12, 7)], 0);
        judge(vec![CountingDrive::default()], &Dialogue { asked, ..talk })
    };
    assert_eq!(one(vec![2]), WorldsVerdict::Right);
    assert_ne!(one(vec![1]), WorldsVerdict::Right);
}

/// What came before nothing more is known is compared, although what was sent after it may have been on its way.
#[test]
fn what_is_not_known_later_excuses_nothing_before() {
    let sent = [(10, 7), (20, 0), (22, 3), (40, 0)];
    assert_eq!(
        judged(false, &sent, &[(22, 8)]),
        WorldsVerdict::Wrong(0, Some(7))
    );
    assert_eq!(
        judged(false, &sent, &[(22, 7), (42, 99)]),
        WorldsVerdict::Unknown
    );
}

/// Where there are more worlds than are kept, nothing is accused.
#[test]
fn too_many_worlds_accuse_nothing() {
    // Each start and each stop can be at four times, and the drive knows when it was stopped.
    let sent: Vec<_> = (0..40)
        .flat_map(|at| [(at * 7 + 1, 1), (at * 7 + 4, 2)])
        .collect();
    let talk = |number| judged(false, &sent, &[(290, number)]);
    assert_eq!(talk(200), WorldsVerdict::TooMany);
    // One that has heard each start and its stop at one time has counted nothing: a world is enough to explain that.
    let asked = [&sent[..], &[(285, 0)]].concat();
    let talk = |number| judged(false, &asked, &[(286, number)]);
    assert_eq!(talk(0), WorldsVerdict::Right);
    assert_ne!(talk(250), WorldsVerdict::Right);
}
