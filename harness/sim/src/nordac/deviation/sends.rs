//! Drives that send another reply than they should.

use super::{Deviation, DpInjection, How};
use crate::deviation::rows;
use harness_proto::nordac::Pkw;
use harness_proto::nordac::words::zsw;
use harness_proto::profibus::dp::{Diagnosis, Service};
use harness_proto::profibus::fdl::{FcFunction, FrameControl};

/// A row: name, section, what it does, and how the reply is changed.
pub(super) static DEVIATIONS: &[Deviation] = rows! { DpInjection(Sends):
    "wrong-fcs" "EN 1" "FCS of a reply includes its FC twice." |_, r| r.raw(|octets| {
        if let [.., fcs, _] = &mut octets[..] { *fcs = fcs.wrapping_add(8); }
    });
    "no-end" "EN 1" "A reply has no last octet 16." |_, r| r.raw(|octets| if octets.len() > 1 { octets.pop(); });
    "addresses-exchanged" "EN 1" "DA and SA of a reply are those of the request." |_, r| r.edit(|p| std::mem::swap(&mut p.da, &mut p.sa));
    "saps-exchanged" "EN 1" "DSAP and SSAP of a reply are those of the request." |_, r| r.edit(|p| std::mem::swap(&mut p.dsap, &mut p.ssap));
    "no-saps" "EN 1" "A reply has no SAPs." |_, r| r.edit(|p| (p.dsap, p.ssap) = (None, None));
    "confirms-by-sd1" "EN 1" "A confirmation is an SD1 with FC 00." |s, r| if *r.octets == [0xE5] { r.plain(s.request.sa, s.address(), 0); };
    "refuses-by-silence" "EN 1" "No service activated is not answered." |_, r| if r.is_refused() { r.octets.clear(); };
    "refuses-by-sc" "EN 1" "No service activated is answered by a short confirmation." |_, r| if r.is_refused() { r.octets = vec![0xE5]; };
    "refuses-with-saps" "EN 1" "No service activated carries SAPs." |s, r| if r.is_refused() {
        r.edit(|p| (p.dsap, p.ssap) = (s.request.ssap, s.request.dsap));
    };
    "status-is-rs" "EN 1" "An FDL status request is answered with FC 03." |s, r| {
        if FrameControl(s.request.fc).function() == Some(FcFunction::FdlStatus) { r.edit(|p| p.fc = 3); }
    };
    "status-of-a-master" "EN 1" "An FDL status request is answered as by a master in the ring." |s, r| {
        if FrameControl(s.request.fc).function() == Some(FcFunction::FdlStatus) { r.edit(|p| p.fc = 0x30); }
    };
    "answers-global-control" "EN 1" "Global_Control is confirmed." |s, r| {
        if FrameControl(s.request.fc).function().is_some_and(FcFunction::is_sdn) { r.octets = vec![0xE5]; }
    };
    "answers-twice" "EN 1" "Each reply is sent twice." |_, r| r.times = 2;
    "answers-too-soon" "EN 1" "A reply begins 3 bits behind the request." |_, r| r.delay = 3;
    "answers-too-late" "EN 1" "A reply begins 400 bits behind the request." |_, r| r.delay = 400;
    "former-reply" "EN 1" "Each fifth reply is the one before it." |s, r| {
        if s.memory.answered % 5 == 4 { r.octets.clone_from(&s.memory.reply); }
    };
    "loses-each-fifth-reply" "EN 1" "Each fifth request is not answered." |s, r| {
        if s.memory.answered % 5 == 4 && !s.memory.reply.is_empty() && s.request.is(Service::SlaveDiag) { r.octets.clear(); }
    };
    "diagnosis-always-waits" "EN 2" "Data_Exchange is always answered with FC 0A." |s, r| {
        if r.image(s.ppo()).is_some() { r.edit(|p| p.fc = 0x0A); }
    };
    "diagnosis-never-waits" "EN 2" "Data_Exchange is always answered with FC 08." |s, r| {
        if r.image(s.ppo()).is_some() { r.edit(|p| p.fc = 0x08); }
    };
    "ident-low-byte-first" "EN 2" "The bytes of the ident number are exchanged." |s, r| r.diagnosis(s.request, |data| data.swap(4, 5));
    "always-ready" "EN 2" "Station_Not_Ready is always 0." |s, r| r.diagnosis(s.request, |data| data[0] &= !Diagnosis::NOT_READY);
    "hides-cfg-fault" "EN 2" "Cfg_Fault is always 0." |s, r| r.diagnosis(s.request, |data| data[0] &= !Diagnosis::CFG_FAULT);
    "hides-prm-fault" "EN 2" "Prm_Fault is always 0." |s, r| r.diagnosis(s.request, |data| data[0] &= !Diagnosis::PRM_FAULT);
    "hides-prm-req" "EN 2" "Prm_Req is always 0." |s, r| r.diagnosis(s.request, |data| data[1] &= !Diagnosis::PRM_REQ);
    "bit-2-of-diagnosis" "EN 2" "Bit 2 of the second octet of the diagnosis is 0." |s, r| r.diagnosis(s.request, |data| data[1] &= !Diagnosis::ALWAYS);
    "hides-watchdog" "EN 2" "WD_On is always 0." |s, r| r.diagnosis(s.request, |data| data[1] &= !Diagnosis::WD_ON);
    "hides-freeze" "EN 2" "Freeze_Mode is always 0." |s, r| r.diagnosis(s.request, |data| data[1] &= !Diagnosis::FREEZE);
    "hides-sync" "EN 2" "Sync_Mode is always 0." |s, r| r.diagnosis(s.request, |data| data[1] &= !Diagnosis::SYNC);
    "no-master" "EN 2" "The master of a diagnosis is always FF." |s, r| r.diagnosis(s.request, |data| data[3] = 0xFF);
    "master-0" "EN 2" "Without a master the diagnosis says 0." |s, r| r.diagnosis(s.request, |data| if data[3] == 0xFF { data[3] = 0; });
    "no-extension" "2.6" "The diagnosis has no extension." |s, r| r.diagnosis(s.request, |data| { data.truncate(6); data[0] &= !Diagnosis::EXT_DIAG; });
    "extension-bit-1" "2.6" "The extension reports Unit_Diag_Bit(1)." |s, r| r.diagnosis(s.request, |data| if data.len() == 8 { data[7] = 2; });
    "other-configuration" "EN 2" "Get_Cfg is answered with the octets in the other order." |s, r| if s.request.is(Service::GetCfg) { r.data(|data| data.reverse()); };
    "rd-inp-gives-outputs" "EN 2" "RD_Inp is answered with the outputs." |s, r| if s.request.is(Service::RdInp) {
        r.data(|data| *data = s.memory.outputs.encode(s.ppo()).to_vec());
    };
    "rd-outp-gives-inputs" "EN 2" "RD_Outp is answered with the inputs." |s, r| if s.request.is(Service::RdOutp) {
        r.data(|data| *data = s.memory.inputs.encode(s.ppo()).to_vec());
    };
    "reads-for-the-master-only" "EN 2" "RD_Inp and RD_Outp of other masters are refused." |s, r| {
        if (s.request.is(Service::RdInp) || s.request.is(Service::RdOutp)) && s.drive.slave().master() != Some(s.request.sa) {
            r.plain(s.request.sa, s.address(), 3);
        }
    };
    "set-slave-add-confirmed" "EN 2" "Set_Slave_Add is confirmed." |s, r| if s.request.is(Service::SetSlaveAdd) { r.octets = vec![0xE5]; };
    "pzd-one-exchange-late" "3.3" "Process words show the inverter one exchange late." |s, r| r.inputs(s.ppo(), |image| image.words = s.memory.inputs.words);
    "pzd-low-byte-first" "3.1" "The bytes of the process words are exchanged." |s, r| r.inputs(s.ppo(), |image| {
        image.words = image.words.map(u16::swap_bytes);
    });
    "pzd-order" "3.1" "Status word and actual value stand in the other order." |s, r| r.inputs(s.ppo(), |image| image.words.swap(0, 1));
    "pzd5-not-0" "3.1" "PZD5 repeats the status word." |s, r| r.inputs(s.ppo(), |image| image.words[4] = image.words[0]);
    "actual-value-without-sign" "3.2.5" "The actual value has no sign." |s, r| r.inputs(s.ppo(), |image| {
        image.words[1] = image.words[1].cast_signed().unsigned_abs();
    });
    "actual-value-is-the-setpoint" "3.2.5" "The actual value repeats the setpoint." |s, r| r.inputs(s.ppo(), |image| image.words[1] = s.memory.outputs.words[1]);
    "no-fault-bit" "3.2.2" "Bit 3 of the status word is always 0." |s, r| r.status_word(s.ppo(), |word| word & !zsw::FAULT);
    "never-enabled" "3.2.2" "Bit 2 of the status word is always 0." |s, r| r.status_word(s.ppo(), |word| word & !zsw::ENABLED);
    "always-enabled-shown" "3.2.2" "Bit 2 of the status word is always 1." |s, r| r.status_word(s.ppo(), |word| word | zsw::ENABLED);
    "hides-off2" "3.2.2" "Bit 4 of the status word is always 1." |s, r| r.status_word(s.ppo(), |word| word | zsw::NO_OFF2);
    "hides-off3" "3.2.2" "Bit 5 of the status word is always 1." |s, r| r.status_word(s.ppo(), |word| word | zsw::NO_OFF3);
    "no-start-disable" "3.2.2" "Bit 6 of the status word is always 0." |s, r| r.status_word(s.ppo(), |word| word & !zsw::START_DISABLE);
    "always-at-setpoint" "3.2.2" "Bit 8 of the status word is always 1." |s, r| r.status_word(s.ppo(), |word| word | zsw::AT_SETPOINT);
    "never-at-setpoint" "3.2.2" "Bit 8 of the status word is always 0." |s, r| r.status_word(s.ppo(), |word| word & !zsw::AT_SETPOINT);
    "no-bus-control" "3.2.2" "Bit 9 of the status word is inverted." |s, r| r.status_word(s.ppo(), |word| word ^ zsw::BUS_CONTROL);
    "directions-exchanged" "3.2.2" "Bits 11 and 12 of the status word are exchanged." |s, r| r.status_word(s.ppo(), |word| {
        word & !(zsw::CLOCKWISE | zsw::ANTICLOCKWISE) | word >> 1 & zsw::CLOCKWISE | word << 1 & zsw::ANTICLOCKWISE
    });
    "set-not-shown" "3.2.2" "Bits 14 and 15 of the status word are always 0." |s, r| r.status_word(s.ppo(), |word| word & 0x3FFF);
    "no-actual-value-2" "3.2.6" "PZD4 is always 0." |s, r| r.inputs(s.ppo(), |image| image.words[3] = 0);
    "answers-without-number" "3.4.1" "An answer does not carry the parameter number." |s, r| r.answer(s.ppo(), |answer| answer.pke &= 0xF000);
    "answers-without-index" "3.4.2" "IND of an answer is 0." |s, r| r.answer(s.ppo(), |answer| answer.ind = 0);
    "index-low-byte-cleared" "3.4.2" "The low byte of IND is 0 in an answer." |s, r| r.answer(s.ppo(), |answer| answer.ind &= 0xFF00);
    "spm-echoed" "3.4.1" "SPM of an answer is that of the task." |s, r| r.answer(s.ppo(), |answer| answer.pke |= s.memory.outputs.pkw.pke & 0x0800);
    "answers-in-pwe1" "3.4.3" "A word stands in PWE1." |s, r| r.answer(s.ppo(), |answer| answer.pwe = answer.pwe.rotate_left(16));
    "answers-low-byte-first" "3.4.3" "The bytes of PWE2 are exchanged." |s, r| r.answer(s.ppo(), |answer| {
        answer.pwe = answer.pwe & 0xFFFF_0000 | u32::from(answer.low_word().swap_bytes());
    });
    "values-of-one-more" "3.4.3" "Values are read one too high." |s, r| r.answer(s.ppo(), |answer| {
        if answer.ak() != 7 { answer.pwe = answer.pwe.wrapping_add(1); }
    });
    "array-answers-are-plain" "3.4.1" "An array value is answered as a plain one." |s, r| r.answer(s.ppo(), |answer| {
        if matches!(answer.ak(), 4 | 5) { answer.pke = (answer.pke & 0x0FFF) | (u16::from(answer.ak() - 3) << 12); }
    });
    "double-words-are-words" "3.4.1" "A double word is answered as a word." |s, r| r.answer(s.ppo(), |answer| {
        if matches!(answer.ak(), 2 | 5) {
            answer.pke -= 0x1000;
            answer.pwe &= 0xFFFF;
        }
    });
    "number-of-elements-is-a-word" "3.4.1" "The number of elements is answered as a word." |s, r| r.answer(s.ppo(), |answer| {
        if answer.ak() == 6 { answer.pke = answer.pke & 0x0FFF | 0x1000; }
    });
    "every-error-is-0" "3.4.1" "Each error has the number 0." |s, r| r.answer(s.ppo(), |answer| if answer.ak() == 7 { answer.pwe = 0; });
    "errors-are-not-reported" "3.4.1" "A task that is refused is answered with its own value." |s, r| r.answer(s.ppo(), |answer| {
        if answer.ak() == 7 { *answer = Pkw::of(1, answer.number(), answer.ind, s.memory.outputs.pkw.pwe); }
    });
    "invalid-task-is-101" "3.4.1" "Error 201 is answered as 101." |s, r| r.answer(s.ppo(), |answer| if answer.ak() == 7 && answer.pwe == 201 { answer.pwe = 101; });
    "answer-is-not-repeated" "3.4.1" "An answer is shown in one exchange only." |s, r| r.inputs(s.ppo(), |image| {
        if image.pkw == s.memory.inputs.pkw { image.pkw = Pkw::default(); }
    });
};
