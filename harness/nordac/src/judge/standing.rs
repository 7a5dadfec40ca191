//! Whose telegrams are judged: other devices stand on the same line.

use harness_bench::capture::runs::TelegramRun;
use harness_proto::nordac::IDENT;
use harness_proto::profibus::Telegram;
use harness_proto::profibus::dp::{Service, SetPrm};
use harness_proto::profibus::fdl::Pdu;
use std::collections::BTreeMap;

/// Whether a slave is judged.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Standing {
    /// It is a NORDAC: by its diagnosis, or by what a master set it up as.
    #[default]
    Known,
    /// The user says that it is one.
    Named,
    /// The user names others.
    NotNamed,
    Unknown,
    /// Its diagnosis has another ident number, but a master set it up as a NORDAC.
    Mistaken,
    /// Its diagnosis has this ident number.
    Foreign(u16),
}

impl Standing {
    pub(super) const fn is_judged(self) -> bool {
        !matches!(self, Self::NotNamed | Self::Foreign(_))
    }

    /// Why it is not judged.
    pub(super) fn why_not(self) -> Option<String> {
        match self {
            Self::NotNamed => Some("`--judge` does not name it".to_owned()),
            Self::Foreign(ident) => Some(format!(
                "its diagnosis has the ident number {ident:04X}, and a NORDAC has {IDENT:04X}; `--judge` with its address judges it"
            )),
            _ => None,
        }
    }

    /// Why what differs does not accuse it; `None` where it does.
    pub(super) const fn doubt(self) -> Option<&'static str> {
        match self {
            Self::Unknown => Some(
                "no diagnosis and no Set_Prm shows that this slave is a NORDAC; `--judge` with its address judges it",
            ),
            Self::Mistaken => Some(
                "its diagnosis never has the ident number 7531, so it may be another device at the address of a NORDAC; `--judge` with its \
                 address judges it",
            ),
            _ => None,
        }
    }
}

/// What a line shows of a slave.
#[derive(Clone, Copy, Debug, Default)]
struct SlaveSigns {
    /// An ident number of its diagnosis that is another one than that of a NORDAC.
    other: Option<u16>,
    /// Its diagnosis has had the ident number of a NORDAC.
    is_nordac: bool,
    /// A master has set it up as a NORDAC.
    set_up: bool,
}

/// The standing of all slaves of a line; `named` are those that the user names.
pub(super) fn standings(runs: &[TelegramRun], named: &[u8]) -> BTreeMap<u8, Standing> {
    let mut all: BTreeMap<u8, SlaveSigns> = BTreeMap::new();
    let mut asked: Option<Pdu> = None;
    for run in runs {
        let telegram = run.said().and_then(|said| said.telegram());
        let pdu = telegram.as_ref().and_then(Telegram::pdu).copied();
        let Some(slave) = run.from else {
            asked = pdu;
            if let Some(pdu) = pdu
                && Service::of(pdu.dsap()) == Some(Service::SetPrm)
            {
                let prm = SetPrm::decode(pdu.data());
                let shown = all.entry(pdu.da()).or_default();
                shown.set_up |= prm.is_some_and(|prm| prm.ident == IDENT);
            }
            continue;
        };
        let shown = all.entry(slave).or_default();
        let diagnosis =
            |pdu: &Pdu| pdu.da() == slave && Service::of(pdu.dsap()) == Some(Service::SlaveDiag);
        if asked.take().is_some_and(|request| diagnosis(&request))
            && let Some(number) = pdu.and_then(|reply| ident(reply.data()))
        {
            match number == IDENT {
                true => shown.is_nordac = true,
                false => shown.other = Some(number),
            }
        }
    }
    let standing = |slave: u8, shown: &SlaveSigns| match (named.is_empty(), shown) {
        (false, _) if named.contains(&slave) => Standing::Named,
        (false, _) => Standing::NotNamed,
        (
            true,
            SlaveSigns {
                is_nordac: true, ..
            },
        ) => Standing::Known,
        (
            true,
            SlaveSigns {
                other: Some(_),
                set_up: true,
                ..
            },
        ) => Standing::Mistaken,
        (
            true,
            SlaveSigns {
                other: Some(ident), ..
            },
        ) => Standing::Foreign(*ident),
        (true, SlaveSigns { set_up: true, .. }) => Standing::Known,
        (true, SlaveSigns { .. }) => Standing::Unknown,
    };
    named
        .iter()
        .for_each(|address| _ = all.entry(*address).or_default());
    let all = all.iter();
    all.map(|(slave, shown)| (*slave, standing(*slave, shown)))
        .collect()
}

/// The ident number of a diagnosis of any device (EN 2): of another length than a NORDAC's too.
fn ident(data: &[u8]) -> Option<u16> {
    let ident = data.get(4..6)?;
    ident.try_into().ok().map(u16::from_be_bytes)
}
