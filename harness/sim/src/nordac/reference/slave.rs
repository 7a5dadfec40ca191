//! The PROFIBUS module as a second model: one function for a telegram, plain numbers and octets (EN 1, EN 2, NORDAC 3.1, 3.4.1).
//!
//! It knows whole telegrams and no octets on a line. Behind it stands an inverter of its own.

use super::bytes::OctetList;
use crate::nordac::InverterSetup;
use crate::nordac::inverter::{Inverter, Outputs};
use harness_proto::nordac::properties::Properties;
use harness_proto::nordac::{Answer, Pkw, PpoType};
use harness_proto::time::{Instant, Span};

/// Services by DSAP.
const RD_INP: u8 = 56;
const RD_OUTP: u8 = 57;
const GLOBAL_CONTROL: u8 = 58;
const GET_CFG: u8 = 59;
const SLAVE_DIAG: u8 = 60;
const SET_PRM: u8 = 61;
const CHK_CFG: u8 = 62;

/// What a service gives.
enum ServiceReply {
    /// SD1 with FC 03.
    Rs,
    /// E5.
    Sc,
    /// SD2 with SAPs.
    Data(OctetList),
    /// SD2 without SAPs; "data" or "data, and a diagnosis waits".
    Inputs(OctetList),
}

/// A request, taken apart.
struct Request<'a> {
    sa: u8,
    fc: u8,
    dsap: Option<u8>,
    ssap: Option<u8>,
    data: &'a [u8],
}

/// The model.
#[derive(Clone, Debug)]
pub struct ReferenceSlave {
    p: Properties,
    /// What is behind the module.
    pub inverter: Inverter,
    address: u8,
    ppo: PpoType,
    restarts: u32,
    /// W: Wait_Prm, C: Wait_Cfg, D: Data_Exch.
    state: char,
    /// SA and FCB of the last new request, and its reply.
    record: Option<(u8, bool)>,
    last: Option<OctetList>,
    master: Option<u8>,
    /// Its time, and when it expires.
    watchdog: Option<(Span, Instant)>,
    prm_fault: bool,
    cfg_fault: bool,
    sync_allowed: bool,
    freeze_allowed: bool,
    group: u8,
    synced: bool,
    waiting: Option<OctetList>,
    frozen: Option<OctetList>,
    outputs: OctetList,
    task: Pkw,
    shown: Option<(Pkw, Answer)>,
    due: Option<(u8, Pkw, Answer)>,
    /// The inputs at which inverter and module have lost each other.
    apart: Option<OctetList>,
    diagnosis_waits: bool,
    /// Bits from a request to its reply.
    delay: u64,
    /// What the last telegram's task was answered, if it had a new one.
    executed: Option<Answer>,
    repeated: bool,
}

impl ReferenceSlave {
    /// The model after power-up.
    #[must_use]
    pub fn new(setup: &InverterSetup) -> Self {
        let inverter = Inverter::new(setup, Instant::START);
        let settings = inverter.settings();
        Self {
            p: setup.properties,
            inverter,
            address: settings.address,
            ppo: settings.ppo,
            restarts: settings.restarts,
            state: 'W',
            record: None,
            last: None,
            master: None,
            watchdog: None,
            prm_fault: false,
            cfg_fault: false,
            sync_allowed: false,
            freeze_allowed: false,
            group: 0,
            synced: false,
            waiting: None,
            frozen: None,
            outputs: OctetList::zeros(settings.ppo.octets()),
            task: Pkw::default(),
            shown: None,
            due: None,
            apart: None,
            diagnosis_waits: false,
            delay: 11,
            executed: None,
            repeated: false,
        }
    }

    /// Its address now.
    #[must_use]
    pub const fn address(&self) -> u8 {
        self.address
    }

    /// W: Wait_Prm, C: Wait_Cfg, D: Data_Exch.
    #[must_use]
    pub const fn state(&self) -> char {
        self.state
    }

    /// How many bits after a request its reply begins.
    #[must_use]
    pub const fn delay(&self) -> u64 {
        self.delay
    }

    /// The answer to the task of the last telegram, if it was a new one; it is sent later.
    #[must_use]
    pub const fn executed(&self) -> Option<Answer> {
        self.executed
    }

    /// Whether the last telegram was a repetition.
    #[must_use]
    pub const fn repeated(&self) -> bool {
        self.repeated
    }

    /// Time passes until `to`.
    pub fn advance(&mut self, to: Instant) {
        if let Some((_, expires)) = self.watchdog
            && expires <= to
        {
            self.inverter.advance(expires);
            self.wait_prm();
            if self.p.watchdog_action.word() == "stop" {
                self.inverter.watchdog_expired(expires);
            }
        }
        self.inverter.advance(to);
    }

    /// Inverter and module lose each other, or find each other.
    pub fn set_link(&mut self, at: Instant, lost: bool) {
        self.advance(at);
        if lost == self.apart.is_some() {
            return;
        }
        self.diagnosis_waits = true;
        if lost {
            self.apart = Some(self.live(at));
            self.inverter.link_lost(at);
        } else {
            self.apart = None;
            self.inverter.link_found(at);
        }
    }

    /// A telegram without gaps and parity errors has ended at `at`: the octets of the reply.
    pub fn telegram(&mut self, at: Instant, octets: &[u8]) -> Option<OctetList> {
        self.advance(at);
        self.executed = None;
        self.repeated = false;
        let (da, request) = taken_apart(octets)?;
        if request.sa == 127 || (da != self.address && da != 127) {
            return None;
        }
        let of_master = self.master == Some(request.sa);
        match request.fc & 0x0F {
            4 | 6 => {
                let counts = of_master && self.state == 'D' && request.ssap.is_some();
                if counts && request.dsap == Some(GLOBAL_CONTROL) {
                    self.feed_watchdog(at);
                    if request.data.len() == 2 {
                        self.global_control(at, request.data[0], request.data[1]);
                    }
                }
                None
            }
            _ if da == 127 => None,
            9 if octets.len() == 6 => Some(self.short(request.sa, 0)),
            3 | 5 | 0xE | 0xF if self.p.sda_ident_lsap.word() == "silent" => None,
            3 | 5 | 0xC..=0xF => Some(self.counted(at, &request)),
            _ => None,
        }
    }

    /// A request that is answered once, however often it comes.
    fn counted(&mut self, at: Instant, request: &Request<'_>) -> OctetList {
        let sends = matches!(request.fc & 0x0F, 0xC | 0xD);
        if sends && self.master == Some(request.sa) {
            self.feed_watchdog(at);
        }
        let (fcb, fcv) = (request.fc & 0x20 != 0, request.fc & 0x10 != 0);
        if fcv
            && self.record == Some((request.sa, fcb))
            && let Some(last) = &self.last
        {
            self.repeated = true;
            return *last;
        }
        self.record = (fcv || fcb).then_some((request.sa, fcb));
        let reply = if sends {
            self.service(at, request)
        } else {
            ServiceReply::Rs
        };
        let octets = match reply {
            ServiceReply::Rs => self.short(request.sa, 3),
            ServiceReply::Sc => OctetList::of(&[&[0xE5]]),
            ServiceReply::Inputs(data) => {
                let fc = if self.diagnosis_waits { 0x0A } else { 0x08 };
                long(request.sa, self.address, fc, &data)
            }
            ServiceReply::Data(data) => {
                let saps = [request.ssap.unwrap_or(0), request.dsap.unwrap_or(0)];
                let all = OctetList::of(&[&saps, &data]);
                long(request.sa | 0x80, self.address | 0x80, 0x08, &all)
            }
        };
        // The reply to the exchange that changes the address or the PPO type still comes from the old one.
        let settings = self.inverter.settings();
        self.last = Some(octets);
        if settings.restarts != self.restarts {
            self.begin_anew();
        }
        octets
    }

    fn begin_anew(&mut self) {
        let settings = self.inverter.settings();
        self.address = settings.address;
        self.ppo = settings.ppo;
        self.restarts = settings.restarts;
        self.prm_fault = false;
        self.cfg_fault = false;
        self.diagnosis_waits = false;
        self.delay = 11;
        self.record = None;
        self.last = None;
        self.wait_prm();
    }

    fn service(&mut self, at: Instant, request: &Request<'_>) -> ServiceReply {
        let Request {
            sa,
            dsap,
            ssap,
            data,
            ..
        } = *request;
        let exchanges = self.state == 'D';
        let of_master = self.master == Some(sa);
        match (dsap, ssap) {
            (None, None) if exchanges && of_master => self.exchange(at, data),
            (None, _) | (_, None) => ServiceReply::Rs,
            (Some(SET_PRM), _) => self.set_prm(at, sa, data),
            (Some(CHK_CFG), _) => self.chk_cfg(of_master, data),
            _ if !data.is_empty() => ServiceReply::Rs,
            (Some(GET_CFG), _) => ServiceReply::Data(OctetList::of(&[self.ppo.cfg()])),
            (Some(SLAVE_DIAG), _) => ServiceReply::Data(self.slave_diag(of_master)),
            (Some(RD_INP), _) if exchanges => ServiceReply::Data(self.read_inputs(at)),
            (Some(RD_OUTP), _) if exchanges => ServiceReply::Data(self.outputs),
            _ => ServiceReply::Rs,
        }
    }

    fn set_prm(&mut self, at: Instant, sa: u8, data: &[u8]) -> ServiceReply {
        if self.state != 'W' && self.master != Some(sa) {
            return if self.p.foreign_prm.word() == "rs" {
                ServiceReply::Rs
            } else {
                ServiceReply::Sc
            };
        }
        self.prm_fault = false;
        let &[status, wd1, wd2, tsdr, high, low, group, ref user @ ..] = data else {
            self.prm_fault = true;
            self.wait_prm();
            return ServiceReply::Sc;
        };
        let (lock, unlock, watched) = (status & 0x80 != 0, status & 0x40 != 0, status & 8 != 0);
        if unlock {
            self.wait_prm();
        } else if !lock {
            self.take_delay(tsdr);
        } else {
            let wrong_user = !user.is_empty() && self.p.user_prm.word() == "fault";
            let no_time = watched && (wd1 == 0 || wd2 == 0);
            if (high, low) != (0x75, 0x31) || wrong_user || no_time {
                self.prm_fault = true;
                self.wait_prm();
                return ServiceReply::Sc;
            }
            self.take_delay(tsdr);
            self.state = 'C';
            self.master = Some(sa);
            self.sync_allowed = status & 0x20 != 0;
            self.freeze_allowed = status & 0x10 != 0;
            self.group = group;
            let time = Span::from_millis(10 * u64::from(wd1) * u64::from(wd2));
            self.watchdog = watched.then(|| (time, at + time));
        }
        ServiceReply::Sc
    }

    fn take_delay(&mut self, tsdr: u8) {
        if tsdr != 0 {
            self.delay = u64::from(tsdr.max(11));
        }
    }

    fn chk_cfg(&mut self, of_master: bool, data: &[u8]) -> ServiceReply {
        match self.state {
            'W' if self.p.chk_cfg_early.word() == "sc" => return ServiceReply::Sc,
            'W' => return ServiceReply::Rs,
            _ if !of_master => return ServiceReply::Rs,
            _ => self.cfg_fault = false,
        }
        if data != self.ppo.cfg() {
            self.cfg_fault = true;
            self.wait_prm();
        } else if self.state == 'C' {
            self.state = 'D';
            self.forget_data();
        }
        ServiceReply::Sc
    }

    fn wait_prm(&mut self) {
        self.state = 'W';
        self.master = None;
        self.watchdog = None;
        self.sync_allowed = false;
        self.freeze_allowed = false;
        self.group = 0;
        self.synced = false;
        self.frozen = None;
        self.forget_data();
    }

    fn forget_data(&mut self) {
        self.waiting = None;
        self.outputs = OctetList::zeros(self.ppo.octets());
        self.task = Pkw::default();
        self.shown = None;
        self.due = None;
    }

    fn slave_diag(&mut self, of_master: bool) -> OctetList {
        if of_master || self.p.diag_flag_cleared_by.word() == "any-master" {
            self.diagnosis_waits = false;
        }
        let bit = |set: bool, number: u8| u8::from(set) << number;
        let extended = self.apart.is_some();
        let first = bit(self.state != 'D', 1)
            | bit(self.cfg_fault, 2)
            | bit(extended, 3)
            | bit(self.prm_fault, 6);
        let second = bit(self.state == 'W', 0)
            | bit(true, 2)
            | bit(self.watchdog.is_some(), 3)
            | bit(self.frozen.is_some(), 4)
            | bit(self.synced, 5);
        let master = self.master.unwrap_or(0xFF);
        let block: &[u8] = if extended { &[0x02, 0x04] } else { &[] };
        OctetList::of(&[&[first, second, 0, master, 0x75, 0x31], block])
    }

    fn exchange(&mut self, at: Instant, data: &[u8]) -> ServiceReply {
        if data.len() != self.ppo.octets() {
            if self.p.leave_dx_wrong_length.word() == "rs-and-wait-prm" {
                self.wait_prm();
            }
            return ServiceReply::Rs;
        }
        // Apart, module and inverter exchange nothing.
        if let (None, Some((exchanges, task, answer))) = (&self.apart, self.due) {
            self.due = Some((exchanges - 1, task, answer));
            if exchanges == 1 {
                self.shown = Some((task, answer));
                self.due = None;
            }
        }
        let inputs = match (&self.frozen, &self.apart) {
            (Some(frozen), _) => *frozen,
            (None, Some(kept)) => *kept,
            (None, None) => self.live(at),
        };
        if self.synced {
            self.waiting = Some(OctetList::of(&[data]));
        } else {
            self.put_out(at, data);
        }
        ServiceReply::Inputs(inputs)
    }

    /// Outputs become effective.
    fn put_out(&mut self, at: Instant, data: &[u8]) {
        self.outputs = OctetList::of(&[data]);
        if self.apart.is_some() {
            return;
        }
        if let (true, Some(octets)) = (self.ppo.has_pkw(), data.first_chunk::<8>()) {
            let task = Pkw::decode(*octets);
            let (new, old) = (task, self.task);
            self.task = task;
            let differs = match self.p.task_new_when.word() {
                "any-byte" => new != old,
                _ => new.pke != old.pke || new.ind != old.ind,
            };
            if differs {
                let answer = self.inverter.task(at, task, self.ppo);
                self.due = Some((self.p.pkw_latency, task, answer));
                self.executed = Some(answer);
            }
        }
        let words = &data[self.ppo.octets() - 2 * self.ppo.words()..];
        let word = |number: usize| {
            words
                .get(2 * number..2 * number + 2)
                .map_or(0, |w| u16::from(w[0]) << 8 | u16::from(w[1]))
        };
        let outputs = Outputs {
            stw: word(0),
            hsw: word(1),
            pzd3: word(2),
            pzd4: word(3),
        };
        self.inverter.take(at, &outputs);
    }

    /// The inputs as they are now.
    fn live(&self, at: Instant) -> OctetList {
        let mut all = OctetList::zeros(0);
        if self.ppo.has_pkw() {
            let answer = self.shown.map_or(Pkw::default(), |(task, answer)| {
                let now = match answer {
                    Answer::None | Answer::Error(_) => answer,
                    _ => self.inverter.current(at, task, self.ppo),
                };
                self.inverter.encode(now, task)
            });
            all.extend(&answer.encode());
        }
        let inputs = self.inverter.inputs(at);
        for word in [inputs.zsw, inputs.hiw, inputs.pzd3, inputs.pzd4, 0, 0]
            .iter()
            .take(self.ppo.words())
        {
            all.extend(&word.to_be_bytes());
        }
        all
    }

    fn read_inputs(&self, at: Instant) -> OctetList {
        match (&self.frozen, &self.apart) {
            (Some(frozen), _) if self.p.rd_inp_under_freeze.word() == "frozen" => *frozen,
            (_, Some(kept)) => *kept,
            _ => self.live(at),
        }
    }

    fn global_control(&mut self, at: Instant, command: u8, group: u8) {
        if group != 0 && group & self.group == 0 {
            return;
        }
        let anyway = self.p.sync_without_request.word() == "obeyed";
        let (sync, freeze) = (self.sync_allowed || anyway, self.freeze_allowed || anyway);
        let has = |bit: u8| command & bit != 0;
        if has(0x02) {
            self.waiting = None;
            self.put_out(at, &OctetList::zeros(self.ppo.octets()));
        }
        if has(0x04) {
            self.frozen = None;
        } else if freeze && has(0x08) {
            self.frozen = Some(self.apart.unwrap_or_else(|| self.live(at)));
        }
        if has(0x10) || sync && has(0x20) {
            self.synced = !has(0x10);
            if let Some(data) = self.waiting.take() {
                self.put_out(at, &data);
            }
        }
        let settings = self.inverter.settings();
        if settings.restarts != self.restarts {
            self.begin_anew();
        }
    }

    fn feed_watchdog(&mut self, at: Instant) {
        if let Some((time, expires)) = &mut self.watchdog {
            *expires = at + *time;
        }
    }

    /// SD1 to `sa`.
    fn short(&self, sa: u8, fc: u8) -> OctetList {
        let sum = sa.wrapping_add(self.address).wrapping_add(fc);
        OctetList::of(&[&[0x10, sa, self.address, fc, sum, 0x16]])
    }
}

/// SD2.
fn long(da: u8, sa: u8, fc: u8, data: &[u8]) -> OctetList {
    let length = data.len() as u8 + 3;
    let mut all = OctetList::of(&[&[0x68, length, length, 0x68, da, sa, fc], data]);
    let sum = all[4..]
        .iter()
        .fold(0_u8, |sum, octet| sum.wrapping_add(*octet));
    all.extend(&[sum, 0x16]);
    all
}

/// DA without bit 7 and the rest of a request; `None` for what is no request in any form.
fn taken_apart(octets: &[u8]) -> Option<(u8, Request<'_>)> {
    let body = match *octets {
        [0x10, .., 0x16] if octets.len() == 6 => &octets[1..4],
        [0xA2, .., 0x16] if octets.len() == 14 => &octets[1..12],
        [0x68, length, again, 0x68, .., 0x16]
            if length == again && octets.len() == usize::from(length) + 6 =>
        {
            &octets[4..4 + usize::from(length)]
        }
        _ => return None,
    };
    let sum = body
        .iter()
        .fold(0_u8, |sum, octet| sum.wrapping_add(*octet));
    if octets[octets.len() - 2] != sum || body.len() > 249 {
        return None;
    }
    let &[da, sa, fc, ref data @ ..] = body else {
        return None;
    };
    if octets[0] == 0x68 && data.is_empty() {
        return None;
    }
    if fc & 0xC0 != 0x40 {
        return None;
    }
    let mut data = data;
    let mut sap = |flag: u8| {
        if flag & 0x80 == 0 {
            return Some(None);
        }
        let (sap, rest) = data.split_first()?;
        data = rest;
        (sap & 0xC0 == 0).then_some(Some(*sap))
    };
    let (dsap, ssap) = (sap(da)?, sap(sa)?);
    let request = Request {
        sa: sa & 0x7F,
        fc,
        dsap,
        ssap,
        data,
    };
    Some((da & 0x7F, request))
}
