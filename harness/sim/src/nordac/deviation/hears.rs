//! Drives that answer another request than the one on the line.

use super::{Deviation, DpInjection, How};
use crate::deviation::rows;
use harness_proto::nordac::words::stw;
use harness_proto::profibus::dp::{Diagnosis, DpState, GlobalControl, Service, SetPrm};
use harness_proto::profibus::fdl::{BROADCAST, FcFunction, FrameControl};

/// Whether the FC is an SRD.
fn is_srd(fc: u8) -> bool {
    FrameControl(fc).function().is_some_and(FcFunction::is_srd)
}

/// A row: name, section, what it does, how the request is changed, and how the reply if it is changed too.
pub(super) static DEVIATIONS: &[Deviation] = rows! { DpInjection:
    "answers-broadcasts" "EN 1" "A request to station 127 is answered." Hears |s, p| {
        if p.da == BROADCAST && !p.is(Service::GlobalControl) { p.da = s.address(); }
    };
    "answers-the-next-address" "EN 1" "Requests to the next address are answered too." Hears |s, p| {
        if p.da == s.address() + 1 { p.da = s.address(); }
    };
    "executes-repetitions" "EN 1" "A repeated request is executed again." Hears |_, p| p.as_new();
    "one-frame-count-bit" "EN 1" "Every counted request is taken for a repetition of the first." Hears |_, p| {
        if p.fc & 0x10 != 0 { p.fc |= 0x30; }
    };
    "repetition-from-any-master" "EN 1" "A repetition is recognised by the frame count bit alone." Both |s, p| {
        if p.fc & 0x10 != 0 && is_srd(p.fc) && p.is(Service::SlaveDiag) && let Some(master) = s.drive.slave().master() { p.sa = master; }
    }, |s, r| r.edit(|p| p.da = s.request.sa);
    "no-fdl-status" "EN 1" "An FDL status request is not answered." Hears |_, p| {
        if FrameControl(p.fc).function() == Some(FcFunction::FdlStatus) { p.times = 0; }
    };
    "low-priority-only" "EN 1" "SRD high is not answered." Hears |_, p| {
        if FrameControl(p.fc).function() == Some(FcFunction::SrdHigh) { p.times = 0; }
    };
    "any-ident" "EN 2" "Set_Prm is accepted with any ident number." Hears |_, p| p.prm(|data| {
        data[4] = 0x75;
        data[5] = 0x31;
    });
    "short-set-prm" "EN 2" "Set_Prm is accepted without its group." Hears |_, p| {
        if p.is(Service::SetPrm) && p.data.len() == 6 { p.data.push(0); }
    };
    "watchdog-factor-0" "EN 2" "A watchdog factor of 0 counts as 1." Hears |_, p| p.prm(|data| {
        data[1] = data[1].max(1);
        data[2] = data[2].max(1);
    });
    "no-watchdog" "EN 2" "The watchdog never expires." Both |_, p| p.prm(|data| data[0] &= !SetPrm::WATCHDOG),
        |s, r| if s.drive.slave().state() != DpState::WaitPrm {
            r.diagnosis(s.request, |data| data[1] |= Diagnosis::WD_ON);
        };
    "watchdog-of-half" "EN 2" "The watchdog expires after half of its time." Hears |_, p| p.prm(|data| data[1] = data[1].div_ceil(2));
    "one-watchdog-factor" "EN 2" "The second factor of the watchdog is ignored." Hears |_, p| p.prm(|data| data[2] = data[2].min(1));
    "never-unlocks" "EN 2" "Set_Prm with Unlock is ignored." Hears |_, p| p.prm(|data| data[0] &= !SetPrm::UNLOCK);
    "unlock-with-lock-locks" "EN 2" "Lock wins over Unlock." Hears |_, p| p.prm(|data| {
        if data[0] & SetPrm::LOCK != 0 { data[0] &= !SetPrm::UNLOCK; }
    });
    "min-tsdr-ignored" "EN 2" "Replies always begin 11 bits behind the request." Hears |_, p| p.prm(|data| data[3] = 0);
    "min-tsdr-below-11" "EN 2" "A min T_SDR of 0 sets it to 11." Hears |_, p| p.prm(|data| data[3] = data[3].max(11));
    "any-configuration" "EN 2" "Chk_Cfg is accepted with any configuration." Hears |s, p| {
        if p.is(Service::ChkCfg) { p.data = s.ppo().cfg().to_vec(); }
    };
    "longer-configuration" "EN 2" "Chk_Cfg is accepted with further octets behind the right ones." Hears |s, p| {
        if p.is(Service::ChkCfg) && p.data.starts_with(s.ppo().cfg()) { p.data.truncate(s.ppo().cfg().len()); }
    };
    "no-configuration" "EN 2" "Set_Prm leads to Data_Exch at once." Hears |s, p| {
        if p.is(Service::DataExchange) && s.drive.slave().state() == DpState::WaitCfg {
            let mut check = p.clone();
            check.as_new();
            (check.dsap, check.ssap) = (Some(62), Some(62));
            check.data = s.ppo().cfg().to_vec();
            p.before.push(check);
            p.as_new();
        }
    };
    "exchanges-with-any-master" "EN 2" "Another master exchanges data too." Both |s, p| {
        if p.is(Service::DataExchange) && let Some(master) = s.drive.slave().master() { p.sa = master; }
    }, |s, r| r.edit(|p| p.da = s.request.sa);
    "set-prm-of-any-master" "EN 2" "Set_Prm of another master takes the slave over." Hears |s, p| {
        if p.is(Service::SetPrm) && let Some(master) = s.drive.slave().master() && master != p.sa {
            let mut free = p.clone();
            free.as_new();
            free.sa = master;
            free.data = vec![SetPrm::UNLOCK, 0, 0, 0, 0x75, 0x31, 0];
            p.before.push(free);
            p.as_new();
        }
    };
    "any-length" "EN 2" "A Data_Exchange of another length is filled up or cut." Hears |s, p| {
        if p.is(Service::DataExchange) && is_srd(p.fc) { p.data.resize(s.ppo().octets(), 0); }
    };
    "any-group" "EN 2" "Global_Control counts for every group." Hears |_, p| p.control(|_, group| *group = 0);
    "control-of-any-master" "EN 2" "Global_Control of another master counts." Hears |s, p| {
        if p.is(Service::GlobalControl) && let Some(master) = s.drive.slave().master() { p.sa = master; }
    };
    "no-clear-data" "EN 2" "Clear_Data is ignored." Hears |_, p| p.control(|command, _| *command &= !GlobalControl::CLEAR_DATA);
    "no-sync" "EN 2" "Sync is ignored." Hears |_, p| p.control(|command, _| *command &= !GlobalControl::SYNC);
    "no-freeze" "EN 2" "Freeze is ignored." Hears |_, p| p.control(|command, _| *command &= !GlobalControl::FREEZE);
    "sync-wins" "EN 2" "Sync and Unsync together are Sync." Hears |_, p| p.control(|command, _| {
        if *command & GlobalControl::SYNC != 0 { *command &= !GlobalControl::UNSYNC; }
    });
    "freeze-wins" "EN 2" "Freeze and Unfreeze together are Freeze." Hears |_, p| p.control(|command, _| {
        if *command & GlobalControl::FREEZE != 0 { *command &= !GlobalControl::UNFREEZE; }
    });
    "no-broadcast-control" "EN 2" "Global_Control to station 127 is ignored." Hears |_, p| {
        if p.da == BROADCAST { p.times = 0; }
    };
    "control-by-srd" "EN 2" "Global_Control is obeyed as SRD too." Hears |_, p| {
        if p.is(Service::GlobalControl) && is_srd(p.fc) {
            let mut command = p.clone();
            command.fc = 0x46;
            p.before.push(command);
        }
    };
    "pzd-always-valid" "3.2.1" "Bit 10 of the control word is ignored: zeros stop the motor." Hears |s, p| p.control_word(s.ppo(), |word| word | stw::VALID);
    "no-off2" "3.2.1" "OFF2 is ignored." Hears |s, p| p.control_word(s.ppo(), |word| word | stw::NO_OFF2);
    "no-off3" "3.2.1" "OFF3 is ignored." Hears |s, p| p.control_word(s.ppo(), |word| word | stw::NO_OFF3);
    "off2-ramps" "3.2.1" "OFF2 is taken for OFF1." Hears |s, p| p.control_word(s.ppo(), |word| {
        if word & stw::NO_OFF2 == 0 && word & stw::VALID != 0 { (word | stw::NO_OFF2) & !stw::ON } else { word }
    });
    "off1-coasts" "3.2.1" "OFF1 is taken for OFF2." Hears |s, p| p.control_word(s.ppo(), |word| {
        if word & 0x040F == 0x040E { word & !stw::NO_OFF2 } else { word }
    });
    "always-enabled" "3.2.1" "Bit 3 of the control word is ignored." Hears |s, p| p.control_word(s.ppo(), |word| word | stw::ENABLE);
    "ramp-bit-ignored" "3.2.1" "Bit 4 of the control word is ignored." Hears |s, p| p.control_word(s.ppo(), |word| word | stw::RAMP);
    "hold-bit-ignored" "3.2.1" "Bit 5 of the control word is ignored." Hears |s, p| p.control_word(s.ppo(), |word| word | stw::RUN);
    "setpoint-bit-ignored" "3.2.1" "Bit 6 of the control word is ignored." Hears |s, p| p.control_word(s.ppo(), |word| word | stw::SETPOINT);
    "never-acknowledges" "3.2.1" "Bit 7 of the control word is ignored." Hears |s, p| p.control_word(s.ppo(), |word| word & !stw::ACKNOWLEDGE);
    "always-clockwise" "3.2.1" "Bit 12 of the control word is ignored." Hears |s, p| p.control_word(s.ppo(), |word| word & !stw::ANTICLOCKWISE);
    "one-parameter-set" "3.2.1" "Bits 14 and 15 of the control word are ignored." Hears |s, p| p.control_word(s.ppo(), |word| word & 0x3FFF);
    "set-bits-exchanged" "3.2.1" "Bits 14 and 15 of the control word are exchanged." Hears |s, p| p.control_word(s.ppo(), |word| {
        word & 0x3FFF | word >> 1 & 0x4000 | word << 1 & 0x8000
    });
    "starts-at-once" "3.3" "A standing ON leads from start-disable to operation." Hears |s, p| {
        let mut before = p.clone();
        before.control_word(s.ppo(), |word| word & !stw::ON);
        before.as_new();
        if p.image(s.ppo()).is_some_and(|image| image.words[0] & 0x040F == 0x040F) {
            p.before.push(before);
            p.as_new();
        }
    };
    "setpoint-without-sign" "3.2.3" "A negative setpoint counts as a positive one." Hears |s, p| p.outputs(s.ppo(), |image| {
        image.words[1] = image.words[1].cast_signed().unsigned_abs();
    });
    "setpoint-low-byte-first" "3.2.3" "The bytes of the setpoint are exchanged." Hears |s, p| p.outputs(s.ppo(), |image| {
        image.words[1] = image.words[1].swap_bytes();
    });
    "setpoint-of-8000" "3.2.3" "100 % of the setpoint is 7FFF." Hears |s, p| p.outputs(s.ppo(), |image| {
        image.words[1] = (image.words[1].cast_signed() / 2).cast_unsigned();
    });
    "second-setpoint-ignored" "3.2.4" "PZD4 is ignored." Hears |s, p| p.outputs(s.ppo(), |image| image.words[3] = 0);
    "tasks-of-set-1" "3.4.2" "A task always means parameter set 1." Hears |s, p| p.task(s.ppo(), |task| task.ind &= 0xFCFF);
    "elements-from-1" "3.4.2" "Array elements are counted from 1." Hears |s, p| p.task(s.ppo(), |task| {
        if (6..=8).contains(&task.ak()) { task.ind = task.ind.wrapping_sub(0x0400); }
    });
    "index-in-the-low-byte" "3.4.2" "The index is read from the low byte of IND." Hears |s, p| p.task(s.ppo(), |task| task.ind = task.ind.swap_bytes());
    "word-in-pwe1" "3.4.3" "A word is read from PWE1." Hears |s, p| p.task(s.ppo(), |task| {
        if matches!(task.ak(), 2 | 7) { task.pwe = task.pwe.rotate_left(16); }
    });
    "spm-is-a-number-bit" "3.4.1" "A task with bit 11 is not executed." Hears |s, p| p.task(s.ppo(), |task| {
        if task.spm() { task.pke = 0; }
    });
    "array-tasks-are-plain" "3.4.1" "Task 6 is taken for task 1." Hears |s, p| p.task(s.ppo(), |task| {
        if task.ak() == 6 { task.pke = task.pke & 0x0FFF | 0x1000; }
    });
    "no-change" "3.4.1" "A change task only reads." Hears |s, p| p.task(s.ppo(), |task| {
        if task.ak() == 2 { task.pke = task.pke & 0x0FFF | 0x1000; }
    });
    "invalid-task-is-none" "3.4.1" "Tasks 10 to 15 are taken for no task." Hears |s, p| p.task(s.ppo(), |task| {
        if task.ak() > 9 { *task = harness_proto::nordac::Pkw::default(); }
    });
};
