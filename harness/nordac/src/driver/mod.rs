//! Typed calls to NORDAC inverters: start, exchange, parameters, on and off (NORDAC 3).
//!
//! The cyclic master is the crate profirust. It runs over a [`Line`], so guard and recorder lie below it. Services that it does not have are
//! asked for beside it, between two of its telegrams. A call blocks until its result is there; all slaves that were started exchange data
//! meanwhile. Nothing is exchanged between two calls: a caller that wants a motor to turn calls [`Driver::run`].

mod channel;
mod error;
mod motion;
mod phy;

pub(crate) use channel::WriteResult;
pub(crate) use error::{Error, fault_name};
pub(crate) use motion::{ReachedState, percent};
pub(crate) use phy::Timing;

use super::rig::interlock::InverterInterlock;
use harness_bench::link::{Line, Trouble};
use harness_proto::nordac::master::{Exchange, ExchangeError};
use harness_proto::nordac::{Answer, IDENT, Image, PpoType};
use harness_proto::profibus::dp::{Diagnosis, Service};
use harness_proto::profibus::fdl::BadTelegram;
use harness_proto::profibus::master::{Requests, SlaveReply};
use harness_proto::profibus::{Buffer, BusRate};
use harness_proto::time::{Instant, Span};
use phy::MasterLine;
use profirust::dp::{DpMaster, Peripheral, PeripheralEvent, PeripheralHandle, PeripheralOptions};
use profirust::fdl::{FdlActiveStation, ParametersBuilder};
use profirust::{Baudrate, time};
use std::fmt;

/// The bench's own address.
pub(crate) const MASTER: u8 = 2;

/// How often a request beside the master is sent until the slave counts as silent.
const TRIES: u8 = 2;

/// How many slots a start may take: the master listens for 10 of them before it claims the line.
const START_SLOTS: u64 = 40;
/// How much longer than these slots a start may take.
const START: Span = Span::from_millis(2_000);

/// How a driver uses its line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Options {
    pub(crate) timing: Timing,
    /// The watchdog of the slaves: without a request for this long a slave leaves the exchange (EN 2). In steps of 10 ms, up to 650 s.
    pub(crate) watchdog: Span,
}

impl Options {
    /// The usual watchdog: longer than a busy computer is late.
    pub(crate) const WATCHDOG: Span = Span::from_millis(1_000);

    /// The options of a line in virtual time.
    #[cfg(test)]
    pub(crate) fn simulated(rate: BusRate) -> Self {
        Self {
            timing: Timing::simulated(rate),
            watchdog: Self::WATCHDOG,
        }
    }
}

/// A slave that exchanges data.
struct Slave {
    address: u8,
    handle: PeripheralHandle,
    exchange: Exchange,
    /// How many exchanges there were.
    exchanges: u64,
    /// The answer of the parameter channel that has not been fetched.
    answer: Option<Result<Option<Answer>, ExchangeError>>,
    event: Option<PeripheralEvent>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct StartReport {
    pub(crate) ppo: PpoType,
    /// The slave's diagnosis when it began to exchange.
    pub(crate) diagnosis: Option<Diagnosis>,
    /// The words of its first replies.
    pub(crate) inputs: Image,
}

/// The master of a segment.
pub(crate) struct Driver<'l> {
    wire: MasterLine<'l>,
    station: FdlActiveStation,
    master: DpMaster<'static>,
    slaves: Vec<Slave>,
    options: Options,
    /// What must hold of parameters while it is used.
    interlocks: Vec<InverterInterlock>,
}

impl fmt::Debug for Driver<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let slaves: Vec<_> = self.slaves.iter().map(|slave| slave.address).collect();
        f.debug_struct("Driver")
            .field("slaves", &slaves)
            .finish_non_exhaustive()
    }
}

impl<'l> Driver<'l> {
    /// The master of a line. Nothing is sent before a slave is started or asked.
    #[must_use]
    pub(crate) fn new(line: Box<dyn Line + 'l>, options: Options) -> Self {
        let (station, master) = masters(options);
        Self {
            wire: MasterLine::new(line, options.timing, MASTER),
            station,
            master,
            slaves: Vec::new(),
            options,
            interlocks: Vec::new(),
        }
    }

    /// Looks at these interlocks from now on, before a motor is switched on and while time passes.
    pub(super) fn watch(&mut self, interlocks: Vec<InverterInterlock>) {
        self.interlocks = interlocks;
    }

    /// Looks at the interlocks that are due, as far as their slaves exchange data. What does not hold is trouble of the line from then on.
    fn look(&mut self) -> Result<(), Error> {
        let now = self.now();
        if self.interlocks.iter().all(|interlock| interlock.next > now) {
            return Ok(());
        }
        // A look reads parameters itself.
        let mut all = std::mem::take(&mut self.interlocks);
        let mut seen = all.iter_mut().filter(|interlock| interlock.next <= now);
        let broken = seen.find_map(|interlock| self.look_at(interlock).err());
        self.interlocks = all;
        match broken {
            Some(Error::Link(trouble)) => {
                self.wire.line_mut().fail(trouble.clone());
                Err(Error::Link(trouble))
            }
            other => other.map_or(Ok(()), Err),
        }
    }

    fn look_at(&mut self, interlock: &mut InverterInterlock) -> Result<(), Error> {
        interlock.seen_at(self.now());
        let is_started = self.place(interlock.slave).is_ok();
        let Some(parameter) = interlock.parameter().filter(|_| is_started) else {
            return Ok(());
        };
        match self.read(interlock.slave, &parameter) {
            Ok(number) => match interlock.broken(number) {
                Some(why) => Err(Error::Link(Trouble::Interlock(why))),
                None => Ok(()),
            },
            Err(error @ Error::Link(_)) => Err(error),
            Err(error) => Err(Error::Link(interlock.unread(&error.to_string()))),
        }
    }

    /// The same master with all that it knows over another handle of its line: for a session, which lends the line to one request after
    /// another.
    #[must_use]
    pub(crate) fn onto<'b>(self, line: Box<dyn Line + 'b>) -> Driver<'b> {
        Driver {
            wire: self.wire.onto(line),
            station: self.station,
            master: self.master,
            slaves: self.slaves,
            options: self.options,
            interlocks: self.interlocks,
        }
    }

    /// Brings a slave into the exchange unless it is there, and returns its PPO type. A slave in the exchange goes on with its last words.
    ///
    /// # Errors
    /// See [`Self::start`].
    pub(crate) fn join(&mut self, slave: u8) -> Result<PpoType, Error> {
        if let Ok(place) = self.place(slave) {
            return Ok(self.slaves[place].exchange.ppo());
        }
        self.start(slave, None).map(|started| started.ppo)
    }

    #[must_use]
    pub(crate) fn now(&self) -> Instant {
        self.wire.line().now()
    }

    /// The slaves that were started.
    pub(crate) fn slaves(&self) -> impl Iterator<Item = u8> {
        self.slaves.iter().map(|slave| slave.address)
    }

    /// The PPO type of a slave, by its configuration (Get_Cfg); needs no start.
    ///
    /// # Errors
    /// [`Error::NoReply`], [`Error::Configuration`], [`Error::Link`].
    pub(crate) fn ppo(&mut self, slave: u8) -> Result<PpoType, Error> {
        let configuration = self.ask(slave, Service::GetCfg)?;
        PpoType::from_cfg(&configuration).ok_or_else(|| Error::Configuration {
            slave,
            configuration: configuration.to_vec(),
        })
    }

    /// The diagnosis of a slave; needs no start.
    ///
    /// # Errors
    /// [`Error::NoReply`], [`Error::NotStarted`] for data that are no diagnosis, [`Error::Link`].
    pub(crate) fn diagnosis(&mut self, slave: u8) -> Result<Diagnosis, Error> {
        let data = self.ask(slave, Service::SlaveDiag)?;
        Diagnosis::decode(&data).ok_or(Error::NotStarted {
            slave,
            ppo: PpoType::One,
            diagnosis: None,
        })
    }

    /// Asks a slave for data that it gives to any master.
    fn ask(&mut self, slave: u8, service: Service) -> Result<Buffer, Error> {
        self.settle()?;
        let silent = Error::NoReply {
            slave,
            service: service.name(),
        };
        let unusable = |_: BadTelegram| silent.clone();
        let mut requests = Requests::new(MASTER, slave).map_err(unusable)?;
        let request = requests.request(service, &[]).map_err(unusable)?;
        for _ in 0..TRIES {
            let reply = self.wire.ask(request)?;
            if let Some(SlaveReply::Data { data, .. }) =
                reply.and_then(|reply| requests.take(&reply))
            {
                return Ok(data);
            }
        }
        Err(silent)
    }

    /// Brings a slave into the exchange: Slave_Diag, Set_Prm, Chk_Cfg, Slave_Diag, Data_Exchange. The words are 0, so they are invalid
    /// (bit 10) and change nothing. `ppo` is asked for where it is not given.
    ///
    /// # Errors
    /// [`Error::NoReply`], [`Error::OtherDevice`], [`Error::Taken`], [`Error::Configuration`], [`Error::NotStarted`], [`Error::Link`].
    pub(crate) fn start(&mut self, slave: u8, ppo: Option<PpoType>) -> Result<StartReport, Error> {
        let found = self.diagnosis(slave)?;
        if found.ident != IDENT {
            let ident = found.ident;
            return Err(Error::OtherDevice { slave, ident });
        }
        let exchanging = !found.has(Diagnosis::NOT_READY);
        let other = found.master.filter(|master| *master != MASTER);
        if let Some(master) = other.filter(|_| exchanging) {
            return Err(Error::Taken { slave, master });
        }
        let ppo = match ppo {
            Some(ppo) => ppo,
            None => self.ppo(slave)?,
        };
        let place = self.admit(slave, ppo);
        self.wire.diagnosis = None;
        let end = self.now() + START + self.options.timing.slot_time() * START_SLOTS;
        while self.slaves[place].exchanges < 2 {
            self.step(end)?;
            let refused = matches!(
                self.slaves[place].event.take(),
                Some(
                    PeripheralEvent::ConfigError
                        | PeripheralEvent::ParameterError
                        | PeripheralEvent::Offline
                )
            );
            if refused || self.now() >= end {
                let diagnosis = self.wire.diagnosis;
                self.forget(place);
                return Err(Error::NotStarted {
                    slave,
                    ppo,
                    diagnosis,
                });
            }
        }
        let inputs = self.slaves[place].exchange.inputs().copied();
        Ok(StartReport {
            ppo,
            diagnosis: self.wire.diagnosis,
            inputs: inputs.unwrap_or_default(),
        })
    }

    /// Makes a slave known to the master, or as new where it is known. Returns its place.
    fn admit(&mut self, slave: u8, ppo: PpoType) -> usize {
        let peripheral = self.peripheral(slave, ppo, Some(&[]));
        let known = {
            let mut all = self.master.iter();
            all.find(|(_, peripheral)| peripheral.address() == slave)
                .map(|(handle, _)| handle)
        };
        let handle = match known {
            Some(handle) => {
                *self.master.get_mut(handle) = peripheral;
                handle
            }
            None => self.master.add(peripheral),
        };
        self.slaves.retain(|started| started.address != slave);
        self.slaves.push(Slave {
            address: slave,
            handle,
            exchange: Exchange::new(ppo),
            exchanges: 0,
            answer: None,
            event: None,
        });
        self.slaves.len() - 1
    }

    /// A slave for the master. Without user parameters it is only asked for its diagnosis, until it answers.
    fn peripheral(
        &self,
        slave: u8,
        ppo: PpoType,
        user_parameters: Option<&'static [u8]>,
    ) -> Peripheral<'static> {
        let rate = self.options.timing.rate;
        let options = PeripheralOptions {
            ident_number: IDENT,
            // The slot time is longer in any case.
            max_tsdr: u16::try_from(rate.max_tsdr_bits()).unwrap_or(u16::MAX),
            user_parameters,
            config: Some(ppo.cfg()),
            ..PeripheralOptions::default()
        };
        let image = || vec![0; ppo.octets()];
        Peripheral::new(slave, options, image(), image()).with_diag_buffer(vec![0; 16])
    }

    /// The last inputs of a slave.
    ///
    /// # Errors
    /// [`Error::NotRunning`].
    pub(crate) fn inputs(&self, slave: u8) -> Result<Image, Error> {
        let exchange = &self.slaves[self.place(slave)?].exchange;
        exchange.inputs().copied().ok_or(Error::NotRunning(slave))
    }

    /// Sends process words to a slave from now on, and returns the inputs of the first exchange that can show what they led to: the reply to
    /// the exchange that carries them does not (NORDAC 3.3).
    ///
    /// # Errors
    /// [`Error::NotRunning`], [`Error::Left`], [`Error::Link`].
    pub(crate) fn exchange(&mut self, slave: u8, words: [u16; 4]) -> Result<Image, Error> {
        let place = self.place(slave)?;
        let under_way = self.wire.awaits() == Some(slave);
        let started = &mut self.slaves[place];
        started.exchange.outputs.words[..4].copy_from_slice(&words);
        let outputs = started.exchange.outputs.encode(started.exchange.ppo());
        let peripheral = self.master.get_mut(started.handle);
        peripheral.pi_q_mut().copy_from_slice(&outputs);
        self.cycles(place, if under_way { 3 } else { 2 })
    }

    /// Runs one exchange more, and returns its inputs.
    ///
    /// # Errors
    /// See [`Self::exchange`].
    pub(crate) fn cycle(&mut self, slave: u8) -> Result<Image, Error> {
        let place = self.place(slave)?;
        self.cycles(place, 1)
    }

    /// Lets all slaves exchange data for a time.
    ///
    /// # Errors
    /// [`Error::Left`], [`Error::Link`].
    pub(crate) fn run(&mut self, time: Span) -> Result<(), Error> {
        let end = self.now() + time;
        while self.now() < end {
            self.look()?;
            self.step(end)?;
            self.all_exchange()?;
        }
        self.look()
    }

    /// Whether the line lets these words of a slave pass now, and if not why, in a sentence. Nothing is sent.
    ///
    /// # Errors
    /// [`Error::NotRunning`].
    pub(crate) fn denied(&self, slave: u8, outputs: &Image) -> Result<Option<String>, Error> {
        let started = &self.slaves[self.place(slave)?];
        let data = outputs.encode(started.exchange.ppo());
        let silent = |_: BadTelegram| Error::NotRunning(slave);
        let mut requests = Requests::new(MASTER, slave).map_err(silent)?;
        let request = requests.request(Service::DataExchange, &data);
        let octets = harness_proto::profibus::Telegram::Pdu(request.map_err(silent)?).encode();
        let line = self.wire.line();
        Ok(line.denied(0, harness_bench::medium::Out::Octets(&octets)))
    }

    fn place(&self, slave: u8) -> Result<usize, Error> {
        let mut started = self.slaves.iter();
        let place = started.position(|started| started.address == slave);
        place.ok_or(Error::NotRunning(slave))
    }

    /// Runs this number of exchanges with a slave.
    fn cycles(&mut self, place: usize, count: u64) -> Result<Image, Error> {
        let until = self.slaves[place].exchanges + count;
        while self.slaves[place].exchanges < until {
            self.step(Instant::NEVER)?;
            self.all_exchange()?;
        }
        let slave = self.slaves[place].address;
        self.inputs(slave)
    }

    /// Ends a request that is under way.
    fn settle(&mut self) -> Result<(), Error> {
        while self.wire.awaits().is_some() {
            self.step(Instant::NEVER)?;
            let waits = self.wire.awaits().map(|address| self.place(address));
            let waits = waits.and_then(Result::ok);
            if let Some(place) = waits {
                self.exchanges(place)?;
            }
        }
        Ok(())
    }

    fn all_exchange(&mut self) -> Result<(), Error> {
        (0..self.slaves.len()).try_for_each(|place| self.exchanges(place))
    }

    fn exchanges(&mut self, place: usize) -> Result<(), Error> {
        let started = &self.slaves[place];
        if started.exchanges == 0 || self.master.get_mut(started.handle).is_running() {
            return Ok(());
        }
        let slave = started.address;
        self.forget(place);
        Err(Error::Left {
            slave,
            not_activated: self.wire.not_activated.take(),
        })
    }

    /// Forgets a slave: the master, which starts a lost slave again by itself, is to leave it alone.
    fn forget(&mut self, place: usize) {
        let removed = self.slaves.remove(place);
        if self.slaves.is_empty() {
            self.wire.forget();
            (self.station, self.master) = masters(self.options);
        } else {
            let idle = self.peripheral(removed.address, removed.exchange.ppo(), None);
            *self.master.get_mut(removed.handle) = idle;
        }
    }

    /// Lets the master look at the line once, and time pass until it is to look again.
    fn step(&mut self, end: Instant) -> Result<(), Error> {
        let now = self.wire.clock();
        // Without a slave the master would look for one without end.
        if !self.slaves.is_empty() {
            self.station.poll(now, &mut self.wire, &mut self.master);
            self.take_events();
        }
        self.wire.check()?;
        self.wire.wait(end);
        self.wire.check()
    }

    /// Takes what the master has received, and gives it what goes out next.
    fn take_events(&mut self) {
        let Some((handle, event)) = self.master.take_last_events().peripheral else {
            return;
        };
        let Some(slave) = self.slaves.iter_mut().find(|slave| slave.handle == handle) else {
            return;
        };
        if event != PeripheralEvent::DataExchanged {
            slave.event = Some(event);
            return;
        }
        let peripheral = self.master.get_mut(handle);
        let data = Buffer::of(peripheral.pi_i()).unwrap_or_default();
        let diagnosis = false;
        let taken = slave
            .exchange
            .take(Some(SlaveReply::Data { diagnosis, data }));
        slave.exchanges += 1;
        match taken {
            Ok(exchanged) if exchanged.answer.is_some() => {
                slave.answer = Some(Ok(exchanged.answer));
            }
            Ok(_) => {}
            Err(error) => slave.answer = Some(Err(error)),
        }
        let outputs = slave.exchange.outputs.encode(slave.exchange.ppo());
        peripheral.pi_q_mut().copy_from_slice(&outputs);
    }
}

/// A master that listens before it sends: its station on the line, and its slaves, of which there are none yet.
fn masters(options: Options) -> (FdlActiveStation, DpMaster<'static>) {
    let Options { timing, watchdog } = options;
    let tens = (watchdog.as_nanos() / 10_000_000).clamp(1, 65_000);
    let parameters = ParametersBuilder::new(MASTER, baud(timing.rate))
        .slot_bits(timing.slot_bits())
        // The longest: the bench gives the token to no other master.
        .token_rotation_bits(16_777_960)
        .watchdog_timeout(time::Duration::from_millis(tens * 10))
        .build();
    let mut station = FdlActiveStation::new(parameters);
    station.set_online();
    let mut master = DpMaster::new(Vec::new());
    master.enter_operate();
    (station, master)
}

/// The rate as the master knows it.
const fn baud(rate: BusRate) -> Baudrate {
    match rate {
        BusRate::K9_6 => Baudrate::B9600,
        BusRate::K19_2 => Baudrate::B19200,
        BusRate::K93_75 => Baudrate::B93750,
        BusRate::K187_5 => Baudrate::B187500,
        BusRate::K500 => Baudrate::B500000,
        BusRate::K1500 => Baudrate::B1500000,
    }
}

#[cfg(test)]
mod tests;
