//! Parameters, values and words, settled.

use crate::language::syntax::{
    ParameterChoice, ParameterName, ValueKind, WordKind, WordValue, WrittenValue,
};
use harness_bench::scenario::expression::{Located, Scope};
use harness_bench::scenario::problem::{Problem, TextSpan};
use harness_bench::scenario::run::outcome::Stop;
use harness_proto::nordac::Parameter;
use harness_proto::nordac::parameter::Flag;
use harness_proto::nordac::pkw::Index;

/// A word of 100 % (3.2.3).
const FULL: i128 = 0x4000;

/// The bytes of a word; `None` stands for any.
pub(crate) type PlannedWord = Vec<Option<u8>>;

/// A parameter, by its number and its index.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlannedParameter {
    /// PNU.
    pub(crate) number: u16,
    /// Its element or sub-index, and its set (3.4.2).
    pub(crate) index: Index,
    /// Its row of the table; `None` for a number that is not in it.
    pub(crate) known: Option<&'static Parameter>,
}

/// A number that must be at most `most`.
pub(super) fn up_to(number: &Located, most: i64, scope: Scope, what: &str) -> Result<u16, Problem> {
    let value = number.value(scope)?;
    let fits = u16::try_from(value).ok().filter(|_| value <= most);
    fits.ok_or_else(|| {
        let message = format!("{value} is no {what}");
        Problem::new(number.span, message, format!("0 to {most} expected here"))
    })
}

/// A parameter with its index (3.4.2): set 1 and sub-index 0 where none is given.
pub(super) fn parameter(name: &ParameterName, scope: Scope) -> Result<PlannedParameter, Problem> {
    let number = match &name.which {
        ParameterChoice::Numbered(number) => i64::from(*number),
        ParameterChoice::Named(parameter) => parameter.number.into(),
        ParameterChoice::Counted(number) => number.value(scope)?,
    };
    let fits = u16::try_from(number).ok().filter(|number| *number <= 0x7FF);
    let Some(number) = fits else {
        let what = format!("there is no parameter {number}: a PNU has 11 bits");
        return Err(Problem::new(name.span, what, "0 to 2047 expected here"));
    };
    let known = Parameter::of(number);
    let by_set = known.is_some_and(|parameter| parameter.has(Flag::Set));
    let array = known.is_some_and(Parameter::is_array);
    let index = match (by_set, array, name.index.as_slice()) {
        (_, _, []) => Index::default(),
        (true, false, [set]) => Index {
            set: set_of(set, scope)?,
            ..Index::default()
        },
        (true, true, [element]) => Index {
            element: up_to(element, 63, scope, "array element")?,
            ..Index::default()
        },
        (true, _, [element, set]) => Index {
            element: up_to(element, 63, scope, "array element")?,
            set: set_of(set, scope)?,
        },
        (false, _, [element]) => Index {
            element: up_to(element, 255, scope, "sub-index")?,
            ..Index::default()
        },
        (_, _, more) => {
            let span = more.last().map_or(name.span, |index| index.span);
            let what = "too many numbers behind the parameter";
            let expected = "`.SET`, `.SUB-INDEX` or `.ELEMENT.SET` expected";
            return Err(Problem::new(span, what, expected));
        }
    };
    Ok(PlannedParameter {
        number,
        index,
        known,
    })
}

/// A set, counted from 0.
fn set_of(set: &Located, scope: Scope) -> Result<u8, Problem> {
    let number = up_to(set, 4, scope, "parameter set")?;
    let counted = u8::try_from(number).ok().and_then(|set| set.checked_sub(1));
    counted.ok_or_else(|| Problem::new(set.span, "there is no set 0", "1 to 4 expected here"))
}

/// The raw number of a value, in the 32 bits of PWE1 and PWE2; the high half of a word is 0.
pub(super) fn raw(
    value: &WrittenValue,
    parameter: PlannedParameter,
    scope: Scope,
) -> Result<u32, Problem> {
    let number = match &value.kind {
        ValueKind::Raw(raw) => *raw,
        ValueKind::Counted(number) => number.value(scope)?,
        ValueKind::Given(text) => {
            let known = parameter.known.ok_or_else(|| {
                let what = format!("the unit of parameter {} is not known", parameter.number);
                Problem::new(value.span, what, "a raw number expected here")
            })?;
            let raw = known.parse(parameter.index.element, text);
            raw.map_err(|bad| Problem::new(value.span, bad.to_string(), "another value expected"))?
        }
    };
    let long = parameter.is_long();
    let (least, most) = match long {
        true => (i64::from(i32::MIN), i64::from(u32::MAX)),
        false => (i64::from(i16::MIN), i64::from(u16::MAX)),
    };
    if !(least..=most).contains(&number) {
        let bits = if long { 32 } else { 16 };
        let what = format!("{number} does not fit into the {bits} bits of this parameter");
        return Err(Problem::new(
            value.span,
            what,
            "another number expected here",
        ));
    }
    let mask = if long { u32::MAX } else { 0xFFFF };
    Ok((number & i64::from(mask)) as u32)
}

impl PlannedParameter {
    /// The parameter in messages: `parameter 1202 (Accel. time)`.
    #[must_use]
    pub(crate) fn name(&self) -> String {
        let number = self.number;
        let name = self.known.map_or("not in the list", |known| known.name);
        format!("parameter {number} ({name})")
    }

    /// Its row of the table, which there must be beside the bus.
    pub(super) fn listed(&self, span: TextSpan) -> Result<&'static Parameter, Problem> {
        self.known.ok_or_else(|| {
            let what = format!("there is no parameter {}", self.number);
            Problem::new(
                span,
                what,
                "a parameter of chapter 5 or section 4.1.3 expected here",
            )
        })
    }

    /// IND of a task. A number that is not in the table has sub-indices at most.
    #[must_use]
    pub(crate) fn ind(&self) -> u16 {
        let known = self.known.map(|known| self.index.ind(known));
        known.unwrap_or(self.index.element << 8)
    }

    /// A raw number in messages, with its unit after it.
    #[must_use]
    pub(crate) fn shown(&self, raw: u32) -> String {
        let Some(known) = self.known else {
            return raw.to_string();
        };
        let number = known.number_of(raw);
        match known.unit_of(self.index.element).is_plain() {
            true => number.to_string(),
            false => format!("{number} ({})", known.show(self.index.element, number)),
        }
    }

    /// Compares what the inverter holds with what it must hold.
    pub(in super::super) fn compare(
        &self,
        span: TextSpan,
        found: u32,
        wanted: u32,
    ) -> Result<(), Stop> {
        let mask = if self.is_long() { u32::MAX } else { 0xFFFF };
        if (found ^ wanted) & mask == 0 {
            return Ok(());
        }
        let (name, found, wanted) = (self.name(), self.shown(found), self.shown(wanted));
        let message = format!("{name} reads {found} where {wanted} is expected");
        Err(Stop::failed(span, message))
    }

    /// Whether its value has two words.
    #[must_use]
    pub(crate) fn is_long(&self) -> bool {
        self.known.is_some_and(|known| known.has(Flag::Long))
    }
}

pub(super) fn word(value: &WordValue, scope: Scope) -> Result<PlannedWord, Problem> {
    let (number, most) = match &value.kind {
        WordKind::Bytes(bytes) => return Ok(bytes.clone()),
        WordKind::Counted(number) => (number.value(scope)?, i64::from(u16::MAX)),
        WordKind::Percent(digits, places) => {
            let divisor = 100 * 10_i128.pow(*places);
            let scaled = i128::from(*digits) * FULL * 2;
            // The nearest, a half away from zero.
            let nearest = (scaled.abs() + divisor) / (2 * divisor) * scaled.signum();
            let nearest = i64::try_from(nearest).unwrap_or(i64::MAX);
            (nearest, i64::from(i16::MAX))
        }
    };
    if !(i64::from(i16::MIN)..=most).contains(&number) {
        let what = "this does not fit into a word";
        let problem = Problem::new(value.span, what, "-200% to 199.99% expected here");
        return Err(problem.help("100% is 4000h (NORDAC 3.2.3)"));
    }
    let low = (number & 0xFFFF) as u16;
    Ok(low.to_be_bytes().map(Some).to_vec())
}
