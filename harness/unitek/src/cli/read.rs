//! What is read of UNITEK drives: registers with their units and bits.

use crate::rig::Axis;
use crate::value::{bits, hex, words};
use harness_bench::command::reading::CellReading;
use harness_bench::command::watch::{HEX, WatchedCell, decimal};
use harness_proto::unitek::frame::Reply;
use harness_proto::unitek::units::{Scaling, usual, value};
use harness_proto::unitek::words::set_bits;
use harness_proto::unitek::{Data, Register};
use serde_json::{Value, json};

pub(crate) struct RegisterReading {
    pub(super) axis: Axis,
    pub(super) reply: Reply,
    pub(super) scaling: Scaling,
}

impl RegisterReading {
    pub(super) fn register(&self) -> &'static Register {
        Register::of(self.reply.register)
    }

    pub(super) fn words(&self) -> String {
        words(&self.reply, self.scaling)
    }
}

impl CellReading for RegisterReading {
    const COLUMNS: &'static [&'static str] =
        &["drive", "reg", "name", "raw", "value", "origin", "label"];
    const LIST: &'static str = "registers";

    fn row(&self) -> Vec<String> {
        let register = self.register();
        vec![
            self.axis.node.to_string(),
            format!("{:02X}", register.number),
            register.name.to_owned(),
            hex(self.reply.data),
            self.words(),
            register.origin.to_owned(),
            register.label.to_owned(),
        ]
    }

    fn object(&self) -> Value {
        let register = self.register();
        let names = set_bits(bits(register.unit), self.reply.data.bits());
        json!({
            "drive": self.axis.node,
            "register": format!("{:02X}", register.number),
            "name": register.name,
            "raw": hex(self.reply.data),
            "number": self.reply.number(),
            "value": self.words(),
            "bits": names.map(|bit| bit.name).collect::<Vec<_>>(),
            "bytes": match self.reply.data { Data::Short(_) => 4, Data::Long(_) => 6 },
            "origin": register.origin,
        })
    }

    fn watched(&self) -> WatchedCell {
        let register = self.register();
        let words = self.words();
        let number = self.reply.number();
        let (digits, unit) = match usual(register.unit) {
            Some(given) => {
                // A short reply of a wide register keeps its sign.
                let raw = (number & i64::from(u32::MAX)) as u32;
                let value = value(register, raw, given, self.scaling);
                (value.map_or(String::new(), decimal), given.name())
            }
            None if bits(register.unit).is_empty() => (number.to_string(), ""),
            None => (hex(self.reply.data), HEX),
        };
        WatchedCell {
            drive: self.axis.node.to_string(),
            name: register.name.to_owned(),
            words: match words.is_empty() {
                true => hex(self.reply.data),
                false => words,
            },
            digits,
            unit,
        }
    }
}
