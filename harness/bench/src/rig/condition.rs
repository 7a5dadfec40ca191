//! What an entry of `[[interlock]]` asks of a register or a parameter behind `[port.1]`, whatever the bus.

use super::file::{Interlock, Level};

/// What is wrong with an entry: its key, the message, and what was expected.
pub type Mistake = (&'static str, String, String);

/// What must hold, with bounds as the bus counts them.
#[derive(Clone, Copy, Debug)]
pub enum PortCondition<B> {
    /// The value stays within these bounds, both included.
    Within(Option<B>, Option<B>),
    /// The bit of this number stays at its level.
    Bit(u8, Level),
}

impl Interlock {
    /// Reads what must hold of the register or parameter under `key`, of which `bits` are the names, with their numbers.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn condition_of<B: PartialOrd>(
        &self,
        key: &'static str,
        bits: &[(u8, &str)],
        bound: impl Fn(&str) -> Result<B, (String, String)>,
    ) -> Result<PortCondition<B>, Mistake> {
        match (&self.bit, self.level, &self.min, &self.max) {
            (Some(name), Some(level), None, None) => {
                let names: Vec<_> = bits.iter().map(|(_, bit)| *bit).collect();
                let found = bits.iter().find(|(_, bit)| bit == name);
                let (number, _) = found.ok_or_else(|| {
                    let expected = match names.is_empty() {
                        true => "it has no named bits: `min` or `max` expected in its place".into(),
                        false => format!("one of {} expected here", names.join(", ")),
                    };
                    ("bit", format!("there is no bit `{name}`"), expected)
                })?;
                Ok(PortCondition::Bit(*number, level))
            }
            (None, None, min, max) if min.is_some() || max.is_some() => {
                let read = |key, text: &Option<String>| {
                    let read = text.as_deref().map(&bound).transpose();
                    read.map_err(|(message, expected)| (key, message, expected))
                };
                let (min, max) = (read("min", min)?, read("max", max)?);
                if min.is_some() && max.is_some() && min > max {
                    let message = "`min` is above `max`".to_owned();
                    return Err(("min", message, "a smaller value expected here".to_owned()));
                }
                Ok(PortCondition::Within(min, max))
            }
            _ => {
                let message = "it is not clear what must hold".to_owned();
                let expected = "`min`, `max` or both, or `bit` and `level`, expected beside it";
                Err((key, message, expected.to_owned()))
            }
        }
    }

    /// The interlock in a sentence, with the name of its register or parameter.
    pub fn words(&self, name: &str) -> String {
        let message = self.message.as_ref();
        let message = message.map_or_else(String::new, |message| format!(" ({message})"));
        format!("interlock on {name} of drive {}{message}", self.drive)
    }

    /// Why it does not hold, with what was read; `None` if it does. `within` compares with the bounds.
    pub fn broken<B>(
        &self,
        condition: &PortCondition<B>,
        raw: u32,
        read: &str,
        within: impl Fn(Option<&B>, Option<&B>) -> bool,
    ) -> Option<String> {
        match condition {
            PortCondition::Bit(bit, level) => {
                let is_high = raw >> bit & 1 == 1;
                let digit = |high: bool| u8::from(high);
                let wanted = *level == Level::High;
                let name = self.bit.as_deref().unwrap_or_default();
                (is_high != wanted).then(|| {
                    let (is, wanted) = (digit(is_high), digit(wanted));
                    format!("{name} is {is} in {read}, {wanted} is required")
                })
            }
            PortCondition::Within(min, max) => (!within(min.as_ref(), max.as_ref())).then(|| {
                let bounds = [("at least", &self.min), ("at most", &self.max)];
                let bounds = bounds
                    .into_iter()
                    .filter_map(|(word, text)| Some(format!("{word} {}", text.as_ref()?)));
                let bounds: Vec<_> = bounds.collect();
                format!("{read} was read, {} is required", bounds.join(" and "))
            }),
        }
    }
}
