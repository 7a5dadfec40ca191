//! The requests of a master to one slave, and the replies to them: values in, values out.
//!
//! It sends nothing and waits for nothing. A caller sends what [`Requests`] gives, and hands it what comes back until it
//! [takes](Requests::take) something or the slot time ends.

use super::dp::{GlobalControl, Service};
use super::fdl::{BROADCAST, BadTelegram, FcFunction, FcStatus, LAST_ADDRESS, Sequence};
use super::{Buffer, Pdu, Telegram};
use crate::profibus::fdl::FrameControl;

/// The requests of a master to one slave: the frame count bit, and the last request.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Requests {
    master: u8,
    slave: u8,
    sequence: Sequence,
    last: Option<Pdu>,
}

/// What a slave replied.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(
    clippy::large_enum_variant,
    reason = "replies are kept without allocation"
)]
pub enum SlaveReply {
    /// E5.
    Confirmed,
    /// SD1 with FC 00: a station, OK.
    Present,
    /// SD1 with FC 03: no service activated.
    NotActivated,
    /// Data.
    Data {
        /// FC 0A: a diagnosis waits.
        diagnosis: bool,
        /// The data behind the SAPs.
        data: Buffer,
    },
    /// A reply with another status than a DP slave sends.
    Other(FrameControl),
}

impl Requests {
    /// Requests of station `master` to station `slave`.
    ///
    /// # Errors
    /// [`BadTelegram::Address`] for an address above 126.
    pub fn new(master: u8, slave: u8) -> Result<Self, BadTelegram> {
        if master > LAST_ADDRESS || slave > LAST_ADDRESS {
            return Err(BadTelegram::Address);
        }
        Ok(Self {
            master,
            slave,
            sequence: Sequence::None,
            last: None,
        })
    }

    /// The station that asks.
    #[must_use]
    pub const fn master(&self) -> u8 {
        self.master
    }

    /// The station that is asked.
    #[must_use]
    pub const fn slave(&self) -> u8 {
        self.slave
    }

    /// Begins a new sequence: the next request has FC 6x.
    pub fn restart(&mut self) {
        self.sequence = Sequence::None;
    }

    /// A request for the FDL status.
    ///
    /// # Errors
    /// None for addresses that [`new`](Self::new) accepts.
    pub fn status(&mut self) -> Result<Pdu, BadTelegram> {
        let control = FrameControl::request(FcFunction::FdlStatus, Sequence::None);
        let pdu = Pdu::new(self.slave, self.master, control, &[])?;
        self.last = Some(pdu);
        Ok(pdu)
    }

    /// A new request: high priority for a Data_Exchange and low for every other service, as public masters do it.
    ///
    /// # Errors
    /// [`BadTelegram::Length`] for more data than a telegram holds.
    pub fn request(&mut self, service: Service, data: &[u8]) -> Result<Pdu, BadTelegram> {
        let function = match service {
            Service::DataExchange => FcFunction::SrdHigh,
            Service::GlobalControl => FcFunction::SdnLow,
            _ => FcFunction::SrdLow,
        };
        let sequence = match service {
            Service::GlobalControl => Sequence::None,
            _ => self.sequence.next(),
        };
        let pdu = Pdu::with_saps(
            self.slave,
            self.master,
            FrameControl::request(function, sequence),
            service.sap(),
            service.master_sap(),
            data,
        )?;
        if service != Service::GlobalControl {
            self.sequence = sequence;
            self.last = Some(pdu);
        }
        Ok(pdu)
    }

    /// The last request again, with the same frame count bit: a slave that has executed it sends its reply again and executes nothing.
    #[must_use]
    pub const fn repeat(&self) -> Option<Pdu> {
        self.last
    }

    /// What a telegram replies to the last request; `None` if it is no reply of this slave to this master.
    #[must_use]
    pub fn take(&self, telegram: &Telegram) -> Option<SlaveReply> {
        let last = self.last?;
        let pdu = match telegram {
            Telegram::Confirmation => return Some(SlaveReply::Confirmed),
            Telegram::Token { .. } => return None,
            Telegram::Pdu(pdu) => pdu,
        };
        let fits = pdu.sa() == self.slave && pdu.da() == self.master && !pdu.fc().is_request();
        let saps = pdu.dsap() == last.ssap() && pdu.ssap() == last.dsap();
        let bare = pdu.dsap().is_none() && pdu.ssap().is_none();
        if !fits || !(saps || bare) {
            return None;
        }
        Some(match pdu.fc().status() {
            Some(FcStatus::Ok) if bare && pdu.data().is_empty() => SlaveReply::Present,
            Some(FcStatus::Rs) => SlaveReply::NotActivated,
            Some(status @ (FcStatus::DataLow | FcStatus::DataHigh)) if saps => SlaveReply::Data {
                diagnosis: status == FcStatus::DataHigh,
                data: Buffer::of(pdu.data()).unwrap_or_default(),
            },
            _ => SlaveReply::Other(pdu.fc()),
        })
    }
}

/// A command to all slaves; no slave replies.
///
/// # Errors
/// [`BadTelegram::Address`] for a master above 126.
pub fn command_all(master: u8, command: GlobalControl) -> Result<Pdu, BadTelegram> {
    let control = FrameControl::request(FcFunction::SdnLow, Sequence::None);
    let service = Service::GlobalControl;
    let saps = (service.sap(), service.master_sap());
    Pdu::with_saps(
        BROADCAST,
        master,
        control,
        saps.0,
        saps.1,
        &command.encode(),
    )
}
