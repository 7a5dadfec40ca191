//! Wrong masters.

use super::parts::Parts;
use crate::deviation::{Deviation, DeviationTable, rows};
use crate::fault::Flips;
use crate::octet_segment::Octet;
use harness_proto::nordac::words::stw;
use harness_proto::nordac::{Image, PpoType};
use harness_proto::profibus::Telegram;
use harness_proto::profibus::dp::Service;
use harness_proto::profibus::rate::SYN_BITS;
use harness_proto::time::Span;

/// A way in which a master breaks the bus standard or the manual.
pub type MasterDeviation = Deviation<DpMasterInjection>;

/// How a master is made to deviate.
#[derive(Clone, Copy)]
pub struct DpMasterInjection(How);

/// Where it deviates.
#[derive(Clone, Copy)]
enum How {
    /// It sends another request.
    Asks(fn(&mut Parts)),
    /// It sends the octets of its requests in another way.
    Sends(fn(&mut MasterLine)),
}

/// A telegram as a master sends it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MasterLine {
    /// The idle bits that it waits for.
    pub idle_bits: u64,
    /// The octets.
    pub octets: Vec<Octet>,
}

impl MasterLine {
    /// The octets of a right master.
    #[must_use]
    pub fn of(octets: &[u8]) -> Self {
        Self {
            idle_bits: SYN_BITS,
            octets: octets.iter().copied().map(Octet::from).collect(),
        }
    }
}

impl MasterDeviation {
    /// What the master sends in place of a telegram.
    #[must_use]
    pub fn sends(&self, octets: &[u8]) -> MasterLine {
        match self.injection.0 {
            How::Asks(asks) => {
                let telegram = Telegram::decode(octets).value();
                let pdu = telegram.as_ref().and_then(Telegram::pdu);
                let changed = pdu.map(Parts::of).and_then(|mut parts| {
                    asks(&mut parts);
                    parts.telegram()
                });
                MasterLine::of(
                    &changed.map_or(octets.to_vec(), |telegram| telegram.encode().to_vec()),
                )
            }
            How::Sends(sends) => {
                let mut line = MasterLine::of(octets);
                sends(&mut line);
                line
            }
        }
    }
}

/// Changes the process data of a Data_Exchange; of the two types with 12 octets the one with a parameter channel is taken.
fn outputs(parts: &mut Parts, change: impl FnOnce(&mut Image)) {
    let ppo = PpoType::ALL
        .into_iter()
        .find(|ppo| ppo.octets() == parts.data.len());
    if let Some(ppo) = ppo {
        parts.outputs(ppo, change);
    }
}

/// The deviations of a master.
pub static MASTER_DEVIATIONS: DeviationTable<DpMasterInjection> = DeviationTable(&[
    rows! { DpMasterInjection:
        "master-odd-parity" "EN 1" "Octets have odd parity." Sends |line| for octet in &mut line.octets {
            octet.flips = Flips { parity: true, ..Flips::default() };
        };
        "master-short-idle-time" "EN 1" "A request begins 20 bits behind the reply before it." Sends |line| line.idle_bits = 20;
        "master-gaps" "EN 1" "There are 100 us between the third and the fourth octet of a request." Sends |line| {
            if let Some(octet) = line.octets.get_mut(3) { octet.pause = Span::from_micros(100); }
        };
        "master-fcs-from-sd" "EN 1" "FCS counts the start octet too." Sends |line| {
            let count = line.octets.len();
            if count > 6 { line.octets[count - 2].byte = line.octets[count - 2].byte.wrapping_add(0x68); }
        };
        "master-length-with-fcs" "EN 1" "LE and LEr count FCS too." Sends |line| {
            if line.octets.first().is_some_and(|first| first.byte == 0x68) {
                line.octets[1].byte += 1;
                line.octets[2].byte += 1;
            }
        };
        "master-no-end" "EN 1" "A request has no last octet 16." Sends |line| {
            line.octets.pop();
        };
        "master-one-frame-count-bit" "EN 1" "Every counted request has the same frame count bit." Asks |p| if p.fc & 0x10 != 0 { p.fc |= 0x20; };
        "master-never-counts" "EN 1" "FCV is 0 in every request." Asks |p| p.fc &= 0x4F;
        "master-no-saps" "EN 2" "Requests have no SAPs." Asks |p| (p.dsap, p.ssap) = (None, None);
        "master-saps-exchanged" "EN 2" "DSAP and SSAP stand in the other order." Asks |p| std::mem::swap(&mut p.dsap, &mut p.ssap);
        "master-next-address" "EN 1" "Requests go to the next address." Asks |p| p.da = (p.da + 1) & 0x7F;
        "master-ident-low-byte-first" "EN 2" "The bytes of the ident number in Set_Prm are exchanged." Asks |p| p.prm(|data| data.swap(4, 5));
        "master-user-data" "EN 2" "Set_Prm has user data." Asks |p| p.prm(|data| data.push(0));
        "master-does-not-lock" "EN 2" "Set_Prm has no Lock." Asks |p| p.prm(|data| data[0] &= 0x7F);
        "master-watchdog-without-factor" "EN 2" "Set_Prm switches the watchdog on with a factor 0." Asks |p| p.prm(|data| {
            data[0] |= 0x08;
            data[1] = 0;
        });
        "master-configuration-reversed" "EN 2" "The octets of Chk_Cfg stand in the other order." Asks |p| if p.is(Service::ChkCfg) { p.data.reverse(); };
        "master-control-by-srd" "EN 2" "Global_Control is sent as SRD." Asks |p| if p.is(Service::GlobalControl) { p.fc = 0x6D; };
        "master-short-exchange" "EN 2" "Data_Exchange lacks its last word." Asks |p| if p.is(Service::DataExchange) {
            let length = p.data.len().saturating_sub(2);
            p.data.truncate(length);
        };
        "master-pzd-not-valid" "3.2.1" "Bit 10 of the control word is 0." Asks |p| outputs(p, |image| image.words[0] &= !stw::VALID);
        "master-words-low-byte-first" "3.1" "The bytes of the process words are exchanged." Asks |p| outputs(p, |image| image.words = image.words.map(u16::swap_bytes));
        "master-words-exchanged" "3.1" "Control word and setpoint stand in the other order." Asks |p| outputs(p, |image| image.words.swap(0, 1));
        "master-setpoint-of-8000" "3.2.3" "The setpoint takes 7FFF for 100 %." Asks |p| outputs(p, |image| {
            image.words[1] = (image.words[1].cast_signed().saturating_mul(2)).cast_unsigned();
        });
        "master-setpoint-without-sign" "3.2.3" "The setpoint has no sign." Asks |p| outputs(p, |image| {
            image.words[1] = image.words[1].cast_signed().unsigned_abs();
        });
        "master-word-in-pwe1" "3.4.3" "A word stands in PWE1." Asks |p| outputs(p, |image| if matches!(image.pkw.ak(), 2 | 7) {
            image.pkw.pwe = image.pkw.pwe.rotate_left(16);
        });
        "master-index-in-the-low-byte" "3.4.2" "The index stands in the low byte of IND." Asks |p| outputs(p, |image| image.pkw.ind = image.pkw.ind.swap_bytes());
        "master-number-of-the-menu" "3.4.1" "The thousand is missing from the parameter number." Asks |p| outputs(p, |image| if image.pkw.number() > 1000 {
            image.pkw.pke -= 1000;
        });
    },
]);
