//! A conversation of a master with one slave on a line.
//!
//! The master repeats a request without a reply, and starts the slave again where that does not help, or where the slave has left the
//! exchange. Every request begins at its own time, so that a repetition does not shift what follows.

use super::Telegrams;
use super::file::CampaignStep;
use harness_bench::campaign::line::{Conversation, MasterPiece};
use harness_proto::decode::Decoded;
use harness_proto::line::Received;
use harness_proto::nordac::master::{Exchange, Startup};
use harness_proto::nordac::pkw::Index;
use harness_proto::nordac::{Image, PARAMETERS, PpoType};
use harness_proto::profibus::dp::DpState;
use harness_proto::profibus::fdl::Pdu;
use harness_proto::profibus::master::{Requests, SlaveReply};
use harness_proto::profibus::rate::SYN_BITS;
use harness_proto::profibus::{BusRate, Telegram};
use harness_proto::time::{Instant, Span};
use harness_sim::nordac::inverter::Outputs;
use harness_sim::nordac::{Drive, InverterSetup, Member};
use harness_sim::octet_segment::{LineFaultAt, LineHost, OctetSegment, Wish};
use std::fmt;

const MASTER: usize = 0;
const SLAVE: usize = 1;
const ADDRESSES: (u8, u8) = (2, 8);

const RATE: BusRate = BusRate::K500;

/// Bits after a request within which a reply must begin (slot time).
const SLOT_BITS: u64 = 300;

/// The time from one request to the next: long enough for all repetitions.
const CYCLE: Span = Span::from_millis(20);

/// How often the master starts the slave again in one step.
const MOST_STARTS: u8 = 2;

const MOST_EXCHANGES: u8 = 8;

/// Behind the last step: what is late arrives.
const REST: Span = Span::from_millis(50);

#[derive(Debug, PartialEq, Eq)]
pub(crate) enum StepEnd {
    /// The slave exchanges data.
    Started,
    Exchanged(Image),
    /// The answer of the parameter channel, as it stands in the inputs.
    Answered(String),
    Waited,
}

impl fmt::Display for StepEnd {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Started => f.write_str("started"),
            Self::Exchanged(image) => {
                write!(f, "ZSW {:04X} HIW {:04X}", image.first(), image.main())
            }
            Self::Answered(answer) => f.write_str(answer),
            Self::Waited => f.write_str("waited"),
        }
    }
}

/// What the slave holds at the end.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct SlaveState {
    dp: DpState,
    words: Outputs,
    zsw: u16,
    parameters: Vec<Option<i64>>,
}

/// Plays the steps, with a fault or without.
pub(super) fn converse(
    telegrams: &Telegrams,
    fault: Option<LineFaultAt>,
) -> Option<Conversation<Telegrams>> {
    let mut desk = CampaignDesk::new(telegrams)?;
    if let Some(fault) = fault {
        desk.line.inject(fault);
    }
    let ends = telegrams.steps.iter().map(|step| desk.step(*step));
    let ends = ends.collect();
    desk.run(desk.now + REST);
    let _late = desk.take_heard();
    let state = desk.state();
    Some(Conversation {
        ends,
        troubles: Vec::new(),
        starts: desk.starts,
        requests: desk.repeated,
        carried: desk.telegrams,
        state,
        log: desk.log,
        end: desk.now,
    })
}

struct CampaignDesk {
    line: OctetSegment<Member<Drive>>,
    requests: Requests,
    exchange: Exchange,
    ppo: PpoType,
    repeats: u8,
    now: Instant,
    repeated: u64,
    starts: u64,
    telegrams: Vec<(bool, Vec<u8>)>,
    log: Vec<MasterPiece<Vec<Received>>>,
}

impl CampaignDesk {
    fn new(telegrams: &Telegrams) -> Option<Self> {
        let ppo = telegrams.ppo;
        let none = Index::default();
        let setup = InverterSetup {
            parameters: vec![
                (1624, none, ADDRESSES.1.into()),
                (1621, none, 2),
                (1622, none, ppo.raw().into()),
            ],
            ..InverterSetup::default()
        };
        let drive = Drive::new(&setup, RATE, Instant::START);
        let stations = vec![Member::Host(LineHost::default()), Member::Drive(drive)];
        Some(Self {
            line: OctetSegment::new(RATE.format(), stations),
            requests: Requests::new(ADDRESSES.0, ADDRESSES.1).ok()?,
            exchange: Exchange::new(ppo),
            ppo,
            repeats: telegrams.repeats,
            now: Instant::START,
            repeated: 0,
            starts: 0,
            telegrams: Vec::new(),
            log: Vec::new(),
        })
    }

    fn state(&self) -> Option<SlaveState> {
        let drive = self.line.station(SLAVE).drive()?;
        let inverter = drive.inverter();
        let values = PARAMETERS.iter().flat_map(|parameter| {
            let sets = 0..parameter.sets();
            sets.map(move |set| inverter.parameter(parameter, Index { element: 0, set }))
        });
        Some(SlaveState {
            dp: drive.slave().state(),
            words: inverter.words(),
            zsw: inverter.inputs(self.now).zsw,
            parameters: values.collect(),
        })
    }

    fn run(&mut self, to: Instant) {
        self.line.run_to(to);
        self.now = self.now.max(to);
    }

    fn step(&mut self, step: CampaignStep) -> Result<StepEnd, String> {
        for _ in 0..=MOST_STARTS {
            let done = match step {
                CampaignStep::Wait(time) => {
                    self.run(self.now + time);
                    Ok(StepEnd::Waited)
                }
                CampaignStep::Start => self.start().map(|()| StepEnd::Started),
                CampaignStep::Exchange(control, setpoint) => {
                    self.exchange.outputs.words[..2].copy_from_slice(&[control, setpoint]);
                    self.once().map(|(inputs, _)| StepEnd::Exchanged(inputs))
                }
                CampaignStep::Read(parameter) => {
                    self.exchange.read(&parameter);
                    self.task()
                }
                CampaignStep::Write(parameter, raw) => {
                    self.exchange.write(&parameter, raw);
                    self.task()
                }
            };
            match done {
                Ok(end) => return Ok(end),
                Err(_) => {
                    self.starts += 1;
                    // What goes out stays the same.
                    if let Err(why) = self.start()
                        && self.starts > u64::from(MOST_STARTS)
                    {
                        return Err(format!("gave up: {why}"));
                    }
                }
            }
        }
        Err("gave up: the slave does not stay in the exchange".to_owned())
    }

    /// From the diagnosis to the exchange.
    fn start(&mut self) -> Result<(), String> {
        let mut startup = Startup::new(self.ppo, None);
        while let Some(request) = startup
            .next(&mut self.requests)
            .map_err(|error| error.to_string())?
        {
            let reply = self.ask(&request);
            startup.take(reply).map_err(|error| error.to_string())?;
        }
        Ok(())
    }

    /// One exchange: its inputs, and an answer that has come with it.
    fn once(&mut self) -> Result<(Image, Option<String>), String> {
        let request = self.exchange.exchange(&mut self.requests);
        let reply = self.ask(&request.map_err(|error| error.to_string())?);
        let done = self.exchange.take(reply);
        let done = done.map_err(|error| error.to_string())?;
        let answer = done.answer.map(|_| done.inputs.pkw.to_string());
        Ok((done.inputs, answer))
    }

    /// Exchanges until the answer to a task has come.
    fn task(&mut self) -> Result<StepEnd, String> {
        for _ in 0..MOST_EXCHANGES {
            if let (_, Some(answer)) = self.once()? {
                return Ok(StepEnd::Answered(answer));
            }
        }
        Err("the task is not answered".to_owned())
    }

    /// Sends a request, again where no reply comes, and waits for the time of the next one.
    fn ask(&mut self, request: &Pdu) -> Option<SlaveReply> {
        let begin = self.now;
        let octets = Telegram::Pdu(*request).encode();
        let mut reply = None;
        for turn in 0..=self.repeats {
            self.repeated += u64::from(turn > 0);
            self.telegrams.push((false, octets.to_vec()));
            reply = self.send(&octets);
            if reply.is_some() {
                break;
            }
        }
        self.run(self.now.max(begin + CYCLE));
        reply
    }

    /// Sends, and takes what has come until the line is idle.
    fn send(&mut self, octets: &[u8]) -> Option<SlaveReply> {
        let slot = RATE.bit_time() * SLOT_BITS;
        let outgoing = octets.iter().copied().map(Into::into).collect();
        let wish = Wish {
            ready: self.now,
            idle_bits: SYN_BITS,
        };
        let _late = self.take_heard();
        let sent = octets.iter().copied().map(Received::good).collect();
        self.log.push(MasterPiece::Sent(self.now, sent));
        let host = self.line.station_mut(MASTER).host_mut()?;
        host.forget();
        host.send(wish, outgoing);
        let sent = self.now + RATE.bit_time() * SYN_BITS + RATE.octet_time() * octets.len() as u64;
        self.run(sent + slot);
        while self.line.is_busy() {
            self.run(self.now + slot);
        }
        let heard = self.take_heard();
        if heard.is_empty() {
            return None;
        }
        let octets: Vec<u8> = heard.iter().map(|octet| octet.byte).collect();
        self.telegrams.push((true, octets.clone()));
        // What comes after a whole telegram is not read.
        match Telegram::decode(&octets) {
            Decoded::Value { value, used }
                if heard[..used].iter().all(|octet| octet.error.is_none()) =>
            {
                self.requests.take(&value)
            }
            _ => None,
        }
    }

    fn take_heard(&mut self) -> Vec<Received> {
        let host = self.line.station_mut(MASTER).host_mut();
        let heard = host.map(|host| std::iter::from_fn(|| host.receive()).map(|(_, octet)| octet));
        let heard: Vec<_> = heard.into_iter().flatten().collect();
        if !heard.is_empty() {
            self.log.push(MasterPiece::Received(heard.clone()));
        }
        heard
    }
}
