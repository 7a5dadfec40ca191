//! Frames after `>` and `<`: `201 52 0C 00`, `201#520C00`, `201 rtr 3`, `x00000201 3D 40 00`.

use super::super::syntax::{Content, Message};
use harness_bench::scenario::pattern::{self, Expected, Pattern};
use harness_bench::scenario::problem::Problem;
use harness_bench::scenario::scanner::Scanner;
use harness_proto::can::{Id, MAX_DATA};

const IDENTIFIER: &str =
    "an identifier: three hexadecimal digits such as 201, or `x` and eight for 29 bits";

/// Where the comment of a line begins: at the first `#` that does not stand between an identifier and its data.
pub(in super::super) fn comment(line: &str) -> Option<usize> {
    let mut marks = line.match_indices('#').map(|(at, _)| at);
    marks.find(|at| {
        let before = line[..*at].trim_end_matches(|c: char| c.is_ascii_hexdigit());
        let digits = at - before.len();
        let sign = before.trim_end_matches('x').trim_end();
        !(matches!(digits, 3 | 8) && sign.ends_with(['<', '>']))
    })
}

pub(in super::super) fn message(scanner: &mut Scanner<'_>) -> Result<Message, Problem> {
    let here = scanner.here();
    let id = identifier(scanner)?;
    let content = if scanner.tight().starts_with('#') {
        scanner.eat("#");
        candump(scanner)?
    } else if scanner.at_end() {
        Content::Empty
    } else if scanner.eat_word("rtr") {
        let length = scanner.take_while(|c| c.is_ascii_digit());
        Content::Remote(match length {
            None => 0,
            Some(digits) => match digits.value.parse() {
                Ok(length) if usize::from(length) <= MAX_DATA => length,
                _ => {
                    let what = format!("a remote frame asks for {} bytes", digits.value);
                    return Err(Problem::new(digits.span, what, "0 to 8 expected here"));
                }
            },
        })
    } else {
        Content::Data(pattern::pattern(scanner)?)
    };
    Ok(Message {
        id,
        content,
        span: scanner.since(here),
    })
}

/// `201`, `x00000201`, and `00000201` as candump writes it.
pub(super) fn identifier(scanner: &mut Scanner<'_>) -> Result<Id, Problem> {
    let before = scanner.clone();
    let extended = scanner.eat("x");
    let digits = scanner.take_while(|c| c.is_ascii_alphanumeric());
    let text = digits.map_or("", |digits| digits.value);
    let number = u32::from_str_radix(text, 16).ok();
    let id = match (extended, text.len()) {
        (false, 3) => number.and_then(|number| Id::base(u16::try_from(number).ok()?)),
        (true, 1..=8) | (false, 8) => number.and_then(Id::extended),
        _ => None,
    };
    id.ok_or_else(|| {
        *scanner = before;
        let problem = scanner.unexpected(IDENTIFIER);
        match (text.len(), number) {
            (1 | 2, Some(number)) => problem.help(format!("did you mean `{number:03X}`?")),
            (3, Some(_)) => problem.help("identifiers of 11 bits end at 7FF"),
            (8, Some(_)) => problem.help("identifiers of 29 bits end at x1FFFFFFF"),
            _ => problem,
        }
    })
}

/// What stands after `#`: `520C00`, `4085310000xx`, `R3`, or nothing.
fn candump(scanner: &mut Scanner<'_>) -> Result<Content, Problem> {
    let here = scanner.here();
    if scanner.tight().is_empty() || scanner.tight().starts_with([' ', '\t']) {
        return Ok(Content::Empty);
    }
    let before = scanner.clone();
    let text = scanner
        .take_while(|c| c.is_ascii_alphanumeric())
        .map_or("", |text| text.value);
    if let Some(length) = text.strip_prefix(['R', 'r']) {
        let length = if length.is_empty() {
            Ok(0)
        } else {
            length.parse()
        };
        if let Some(length) = length.ok().filter(|bytes| usize::from(*bytes) <= MAX_DATA) {
            return Ok(Content::Remote(length));
        }
    }
    let mut bytes = Vec::new();
    for pair in text.as_bytes().chunks(2) {
        let pair = std::str::from_utf8(pair).unwrap_or_default();
        let known = pair.len() == 2 && pair.bytes().all(|c| c.is_ascii_hexdigit());
        bytes.push(match u8::from_str_radix(pair, 16) {
            Ok(byte) if known => Expected::Byte(byte),
            _ if pair.eq_ignore_ascii_case("xx") => Expected::Any,
            _ => {
                *scanner = before;
                let expected = "bytes of two hexadecimal digits without blanks, such as 520C00, or R and a length";
                return Err(scanner.unexpected(expected));
            }
        });
    }
    if bytes.is_empty() {
        *scanner = before;
        return Err(scanner.unexpected("bytes such as 520C00"));
    }
    let mut pattern = Pattern::of(&bytes, usize::MAX);
    pattern.span = scanner.since(here);
    Ok(Content::Data(pattern))
}
