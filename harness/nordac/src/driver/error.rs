//! Why a call to a slave came to nothing.

use crate::value::hex;
use harness_bench::link::Trouble;
use harness_proto::nordac::parameter::Limit;
use harness_proto::nordac::words::{State, stw};
use harness_proto::nordac::{IDENT, Parameter, ParameterRef, PkwError, PpoType};
use harness_proto::profibus::dp::{Diagnosis, Service};
use std::fmt;

/// Why a call to a slave came to nothing.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum Error {
    #[error(
        "slave {slave} does not answer {service}: check its address (1624), the bit rate, its power, A and B of the line, and the termination"
    )]
    NoReply {
        slave: u8,
        /// What was asked for: a service.
        service: &'static str,
    },
    #[error(
        "the station at address {slave} has the ident number {ident:04X}, and a NORDAC vector has {IDENT:04X}"
    )]
    OtherDevice { slave: u8, ident: u16 },
    #[error(
        "slave {slave} exchanges data with master {master}: take that master off the line first"
    )]
    Taken { slave: u8, master: u8 },
    #[error("slave {slave} does not start{}", why_not_started(.diagnosis.as_ref(), *.ppo))]
    NotStarted {
        slave: u8,
        /// The PPO type that it was asked for.
        ppo: PpoType,
        /// Its last diagnosis.
        diagnosis: Option<Diagnosis>,
    },
    #[error(
        "slave {slave} replies the configuration {}, which no PPO type has: F3 F1, F3 F5, F1 or F5 expected",
        hex(.configuration)
    )]
    Configuration {
        slave: u8,
        /// What Get_Cfg replied.
        configuration: Vec<u8>,
    },
    #[error(
        "slave {slave} has left the exchange{}: start it again",
        left(.not_activated.as_ref())
    )]
    Left {
        slave: u8,
        /// The service that it has answered with RS.
        not_activated: Option<Service>,
    },
    #[error("slave {0} was not started")]
    NotRunning(u8),
    #[error(
        "slave {slave} is set to {ppo}, which has no parameter channel: PPO1 or PPO2 (1622) carries parameters"
    )]
    NoChannel { slave: u8, ppo: PpoType },
    #[error(
        "slave {slave}: the parameter channel did not answer the task for {parameter} within 40 exchanges"
    )]
    NoAnswer { slave: u8, parameter: ParameterRef },
    #[error("slave {slave} refuses to {what} parameter {parameter} ({}): {error}{}", .parameter.parameter.name, hint(*.error, .parameter.parameter))]
    Refused {
        slave: u8,
        /// `read` or `change`.
        what: &'static str,
        parameter: ParameterRef,
        error: PkwError,
    },
    #[error(
        "slave {slave} answers the task for parameter {parameter} with {answer}, and the manual prints another answer (3.4.1)"
    )]
    WrongAnswer {
        slave: u8,
        parameter: ParameterRef,
        /// The answer, as the manual writes it.
        answer: String,
    },
    #[error("slave {slave}, parameter {parameter} ({}): wrote {}, reads {}", .parameter.parameter.name, .parameter.parameter.show(.parameter.index.element, *.wrote), .parameter.parameter.show(.parameter.index.element, *.reads))]
    Differs {
        slave: u8,
        parameter: ParameterRef,
        wrote: i64,
        reads: i64,
    },
    /// The status word does not show what a control word leads to (NORDAC 3.3).
    #[error("slave {slave}: {expected} expected after STW {stw:04X}, and its status word is {zsw:04X} ({}){}{}", state(*.zsw), remedy(*.zsw, *.stw), stop(expected))]
    NotReached {
        slave: u8,
        /// What was expected, in words.
        expected: &'static str,
        stw: u16,
        zsw: u16,
    },
    #[error("slave {slave} has a fault{}: remove its cause, then `drivebench acknowledge {slave}`", named(.fault.as_ref()))]
    Fault {
        slave: u8,
        /// Its number (5.7), where the parameter channel tells it.
        fault: Option<i64>,
    },
    #[error(
        "slave {slave} is under local control, so it ignores control words: `drivebench write {slave} Interface = 2` gives control to the bus (1621)"
    )]
    Local { slave: u8 },
    #[error(
        "slave {slave}: a setpoint of {hertz} Hz is out of range: the maximum frequency (1205) is {maximum}, and HSW carries -200 to 200 %"
    )]
    Setpoint {
        slave: u8,
        hertz: String,
        maximum: String,
    },
    #[error(
        "station {station} sends as a master on this line: the bench must be the only master, so take the other one off first"
    )]
    OtherMaster { station: u8 },
    #[error("the line did not take a telegram")]
    NotSent,
    #[error("{0}")]
    Link(Trouble),
}

fn why_not_started(diagnosis: Option<&Diagnosis>, ppo: PpoType) -> String {
    let Some(diagnosis) = diagnosis else {
        return ": it answers no more".to_owned();
    };
    let names: Vec<_> = diagnosis.names().collect();
    let hint = if diagnosis.has(Diagnosis::CFG_FAULT) {
        format!(
            "; it refuses the configuration {} of {ppo}: its PPO type (1622) is another one",
            hex(ppo.cfg())
        )
    } else if diagnosis.has(Diagnosis::PRM_FAULT) {
        "; it refuses the parameters of Set_Prm".to_owned()
    } else {
        String::new()
    };
    format!("; its diagnosis says {}{hint}", names.join(", "))
}

fn left(service: Option<&Service>) -> String {
    service.map_or_else(
        || ", or answers no more".to_owned(),
        |service| {
            format!(
                ": it replies to {} that no service is activated",
                service.name()
            )
        },
    )
}

/// What can be done about an error of the parameter channel.
fn hint(error: PkwError, parameter: &Parameter) -> String {
    use harness_proto::nordac::parameter::Flag;
    match error {
        PkwError::Number if parameter.needs_posicon() => {
            "; this parameter needs the PosiCon option (5.6)".to_owned()
        }
        PkwError::ReadOnly if parameter.has(Flag::ReadOnly) => "; it is read only".to_owned(),
        PkwError::ReadOnly if !parameter.has(Flag::Online) => {
            "; it can be changed only while the output is off".to_owned()
        }
        PkwError::Limit => {
            let limit = |limit: Limit| match limit {
                Limit::Raw(raw) => parameter.show(0, raw.into()).to_string(),
                other => other.to_string(),
            };
            format!(
                "; the limits are {} and {}",
                limit(parameter.least),
                limit(parameter.most)
            )
        }
        PkwError::Task | PkwError::Reply if parameter.has(Flag::Long) => {
            "; double words need PPO2 (1622)".to_owned()
        }
        _ => String::new(),
    }
}

/// The state that a status word shows.
pub(super) fn state(zsw: u16) -> &'static str {
    State::of_zsw(zsw).map_or("no state of the manual", State::name)
}

fn remedy(zsw: u16, stw: u16) -> &'static str {
    use harness_proto::nordac::words::{stw as control, zsw as status};
    if zsw & status::FAULT != 0 {
        "; acknowledge the fault first"
    } else if zsw & status::NO_OFF2 == 0 && stw & control::NO_OFF2 != 0 {
        "; OFF2 is active: a digital input with the function \"disable voltage\" is low (2.5.1)"
    } else if zsw & status::NO_OFF3 == 0 && stw & control::NO_OFF3 != 0 {
        "; OFF3 is active: a digital input with the function \"quick stop\" is low (2.5.1)"
    } else if zsw & status::BUS_CONTROL == 0 {
        "; it is under local control: set its interface (1621) to 2"
    } else {
        ""
    }
}

impl Error {
    /// Whether a motor that was to be blocked (OFF2) is not.
    pub(crate) fn is_not_blocked(&self) -> bool {
        matches!(self, Self::NotReached { expected, stw: word, .. } if *expected == OUTPUT_OFF && word & stw::NO_OFF2 == 0)
    }
}

/// What is expected after a word that stops.
pub(super) const OUTPUT_OFF: &str = "output off";

fn stop(expected: &str) -> &'static str {
    match expected {
        OUTPUT_OFF => "; use the emergency stop",
        _ => "",
    }
}

/// The names of faults (NORDAC 5.7), from 1 on.
const FAULTS: [&str; 10] = [
    "inverter overtemperature",
    "motor overtemperature",
    "overcurrent",
    "module overcurrent",
    "overvoltage",
    "undervoltage",
    "phase failure",
    "parameter lost",
    "flying start",
    "bus time-out",
];

/// What a fault number means (NORDAC 5.7); `None` for 0 and for numbers that the manual does not print.
#[must_use]
pub(crate) fn fault_name(number: i64) -> Option<String> {
    let printed = usize::try_from(number).ok()?.checked_sub(1)?;
    match (FAULTS.get(printed), number) {
        (Some(name), _) => Some((*name).to_owned()),
        (None, 11..=23) => Some(format!("system failure {}", number - 10)),
        (None, 24) => Some("reference point".to_owned()),
        (None, 25) => Some("shaft encoder".to_owned()),
        (None, _) => None,
    }
}

fn named(fault: Option<&i64>) -> impl fmt::Display {
    fault.map_or_else(String::new, |number| match fault_name(*number) {
        Some(name) => format!(" ({number}: {name})"),
        None => format!(" ({number})"),
    })
}
