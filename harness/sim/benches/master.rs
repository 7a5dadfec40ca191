//! What a master costs: processor time a byte, the master alone. What a ring had answered is played back to
//! it, byte for byte; so the figure holds telegrams, checks, jobs submitted and results fetched, and no
//! simulated drive.
//!
//! `queue` is the baseline: the same bytes through a queue as long as the ring, compared and thrown away.
//! On the line a byte takes 286 us; a master with 200 ns a byte leaves room for a thousand rings.

use divan::counter::ItemsCount;
use harness_proto::line::{Rate, Received};
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::command::Command;
use harness_proto::novobus::master::{CyclePace, Job, Master, MasterOptions};
use harness_proto::time::{Instant, Span};
use harness_sim::novobus::plain::PlainDrive;
use harness_sim::novobus::ring::Ring;
use std::collections::VecDeque;

const SIZES: [u64; 4] = [1, 6, 100, 250];
const BYTES: usize = 8192;
/// Jobs that wait at any time.
const QUEUED: usize = 300;

fn main() {
    divan::main();
}

/// What there is to do.
#[derive(Clone, Copy)]
enum Work {
    /// Position targets for one drive after the other (ND21 8.2, second table).
    Positions,
    /// Bytes read from one drive after the other.
    Reads,
    /// Nominal and actual values of all drives (ND21 8.2, first table), with reads woven in.
    Exchange,
    /// Nothing.
    Idle,
}

/// A master with its work, and what is known of the ring.
struct Player {
    master: Master,
    work: Work,
    drives: u64,
    jobs: u64,
    now: Instant,
    byte_time: Span,
}

impl Player {
    fn new(drives: u64, work: Work) -> Self {
        let size = RingSize::new(drives).expect("1 to 250");
        let mut master = Master::new(size, Rate::Baud38400, MasterOptions::default());
        if matches!(work, Work::Exchange) {
            let all: Vec<u8> = (0..size.drives()).collect();
            master
                .set_exchange(&all, CyclePace::Continuous)
                .expect("drives of the ring");
        }
        Self {
            master,
            work,
            drives,
            jobs: 0,
            now: Instant::START,
            byte_time: Rate::Baud38400.byte_time(),
        }
    }

    /// One byte time.
    fn turn(&mut self, received: Option<Received>) -> Option<u8> {
        if let Some(received) = received {
            self.master.handle_byte(self.now, received);
        }
        while self.master.poll_event().is_some() {}
        while !matches!(self.work, Work::Idle) && self.master.jobs() < QUEUED {
            let job = self.job();
            self.master.submit(job).expect("a job that can be done");
            self.jobs += 1;
        }
        let byte = self.master.poll_transmit(self.now);
        self.now += self.byte_time;
        byte
    }

    fn job(&self) -> Job {
        let (drive, command) = match self.work {
            Work::Positions => (
                self.jobs / 2,
                Command::WriteWord {
                    address: [0xFF1C, 0xFF1E][self.jobs as usize % 2],
                    data: 0x1234,
                },
            ),
            _ => (self.jobs, Command::ReadByte { address: 0xFE13 }),
        };
        Job::new((drive % self.drives) as u8, command)
    }
}

/// What a sound ring answers to this work, byte time for byte time.
fn answers(drives: u64, work: Work) -> Vec<Option<Received>> {
    let mut player = Player::new(drives, work);
    let size = RingSize::new(drives).expect("1 to 250");
    let mut ring = Ring::new(size, Rate::Baud38400, |_| PlainDrive::default());
    ring.stop_recording();
    let mut answers = Vec::with_capacity(BYTES);
    for _ in 0..BYTES {
        let received = ring.receive().and_then(|byte| byte.arrival());
        let byte = player.turn(received).expect("no gap");
        answers.push(received);
        let now = ring.now();
        ring.send(now, &[byte]);
        ring.run_until(now + player.byte_time);
    }
    assert_eq!(player.master.counters().disturbed, 0);
    answers
}

fn measure(bencher: divan::Bencher<'_, '_>, drives: u64, work: Work) {
    let answers = answers(drives, work);
    bencher
        .counter(ItemsCount::new(BYTES))
        .with_inputs(|| Player::new(drives, work))
        .bench_local_refs(|player| {
            let bytes = answers.iter().filter_map(|answer| player.turn(*answer));
            bytes.fold(0u8, |sum, byte| sum.wrapping_add(byte))
        });
}

#[divan::bench(args = SIZES)]
fn positions(bencher: divan::Bencher<'_, '_>, drives: u64) {
    measure(bencher, drives, Work::Positions);
}

#[divan::bench(args = SIZES)]
fn reads(bencher: divan::Bencher<'_, '_>, drives: u64) {
    measure(bencher, drives, Work::Reads);
}

#[divan::bench(args = SIZES)]
fn exchange(bencher: divan::Bencher<'_, '_>, drives: u64) {
    measure(bencher, drives, Work::Exchange);
}

#[divan::bench(args = SIZES)]
fn idle(bencher: divan::Bencher<'_, '_>, drives: u64) {
    measure(bencher, drives, Work::Idle);
}

#[divan::bench(args = SIZES)]
fn queue(bencher: divan::Bencher<'_, '_>, drives: u64) {
    let answers = answers(drives, Work::Positions);
    bencher
        .counter(ItemsCount::new(BYTES))
        .with_inputs(|| VecDeque::with_capacity(drives as usize + 2))
        .bench_local_refs(|queue| {
            let mut same = 0u64;
            for answer in divan::black_box(&answers) {
                if let (Some(answer), Some(sent)) = (answer, queue.pop_front()) {
                    same += u64::from(answer.is(sent));
                }
                if queue.len() <= drives as usize {
                    queue.push_back(answer.map_or(0x80, |answer| answer.byte));
                }
            }
            same
        });
}
