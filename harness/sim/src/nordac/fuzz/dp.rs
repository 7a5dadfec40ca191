//! The data of DP services and of PPOs: what is read is written as it was.

use crate::fuzz::{Feature, LONGEST, Notebook};
use harness_proto::nordac::words::State;
use harness_proto::nordac::{Answer, Image, Pkw, PpoType};
use harness_proto::profibus::dp::{CfgByte, Diagnosis, GlobalControl, SetPrm};

/// The input as the data of every service: Set_Prm, Chk_Cfg, Slave_Diag, Global_Control, and Data_Exchange in each PPO type.
///
/// # Panics
/// What was read is not written as it was, or was read although it has no such length.
pub fn dp(data: &[u8]) {
    noted(data, &mut Notebook::none());
}

/// The same, and what the octets are is noted.
///
/// # Panics
/// As [`dp`].
pub(super) fn noted(data: &[u8], notes: &mut Notebook<'_>) {
    let data = &data[..data.len().min(LONGEST).min(244)];
    parameters(data, notes);
    configuration(data, notes);
    if let Some(diagnosis) = Diagnosis::decode(data) {
        // A master of FF is none.
        assert_eq!(*diagnosis.encode(), *data);
        notes.note(|| Feature::new("EN 2", "Slave_Diag", format!("{} octets", data.len())));
    }
    match GlobalControl::decode(data) {
        Some(control) => {
            assert_eq!(control.encode(), *data);
            assert!(control.is_for(0xFF) && (control.group == 0 || !control.is_for(0)));
            notes.note(|| {
                Feature::new("EN 2", "Global_Control", format!("{:02X}", control.command))
            });
        }
        None => assert!(data.len() != 2),
    }
    for ppo in PpoType::ALL {
        exchange(ppo, data, notes);
    }
}

fn parameters(data: &[u8], notes: &mut Notebook<'_>) {
    let Some(prm) = SetPrm::decode(data) else {
        assert!(data.len() < 7);
        return;
    };
    assert_eq!(prm.encode().as_deref(), Some(data));
    let watchdog = prm.watchdog_tens_of_ms();
    assert_eq!(watchdog.is_some(), prm.has(SetPrm::WATCHDOG));
    notes.note(|| Feature::new("EN 2", "Set_Prm", format!("{:02X}", prm.status & 0xF8)));
}

fn configuration(data: &[u8], notes: &mut Notebook<'_>) {
    for octet in data {
        if let Some(module) = CfgByte::decode(*octet) {
            assert_eq!(module.encode(), Some(*octet));
            assert!((1..=32).contains(&module.octets()));
        }
    }
    let Some(ppo) = PpoType::from_cfg(data) else {
        return;
    };
    let octets = data.iter().filter_map(|octet| CfgByte::decode(*octet));
    assert_eq!(octets.map(CfgByte::octets).sum::<usize>(), ppo.octets());
    notes.note(|| Feature::new("3.1", "Chk_Cfg", ppo.to_string()));
}

fn exchange(ppo: PpoType, data: &[u8], notes: &mut Notebook<'_>) {
    let Some(image) = Image::decode(ppo, data) else {
        assert_ne!(data.len(), ppo.octets());
        return;
    };
    assert_eq!(*image.encode(ppo), *data);
    if let Some(state) = State::of_zsw(image.first()) {
        notes.note(|| Feature::new("3.2.2", "a status word", state.short()));
    }
    if !ppo.has_pkw() {
        return;
    }
    let pkw = image.pkw;
    assert_eq!(Pkw::decode(pkw.encode()), pkw);
    assert_eq!(pkw.task().ak(), pkw.ak());
    match pkw.answer() {
        None => assert!(matches!(pkw.ak(), 3 | 8..=15)),
        Some(Answer::None) => assert_eq!(pkw.ak(), 0),
        Some(answer) => {
            let again = answer.to(pkw);
            assert_eq!(
                (again.ak(), again.number(), again.ind),
                (pkw.ak(), pkw.number(), pkw.ind)
            );
            assert_eq!(again.low_word(), pkw.low_word());
            notes.note(|| Feature::new("3.4.1", "an answer", format!("{}", answer.ak())));
        }
    }
}
