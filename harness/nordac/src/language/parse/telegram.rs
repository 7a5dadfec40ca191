//! Telegrams: `68 05 05 68 88 82 6C 3C 3E F0 16 bad 3`.

use super::super::syntax::{Bad, Damage, Message};
use harness_bench::scenario::expression;
use harness_bench::scenario::pattern;
use harness_bench::scenario::problem::Problem;
use harness_bench::scenario::scanner::Scanner;
use harness_bench::scenario::times;
use harness_sim::fault::Flips;

/// The word in front of a damaged octet.
const BAD: &str = "bad";

/// Reads what stands after `>` or `<`.
pub(in super::super) fn message(scanner: &mut Scanner<'_>) -> Result<Message, Problem> {
    let mut ahead = scanner.before(&[" bad "]);
    let octets = pattern::pattern(&mut ahead)?;
    ahead.expect_end()?;
    scanner.go_on(&ahead);
    let mut bad = Vec::new();
    while scanner.eat_word(BAD) {
        let octet = expression::sum(scanner)?;
        let how = damage(scanner)?;
        bad.push(Bad { octet, how });
    }
    Ok(Message { octets, bad })
}

/// What stands after the number of a damaged octet.
fn damage(scanner: &mut Scanner<'_>) -> Result<Damage, Problem> {
    let mut ahead = scanner.clone();
    if ahead.at_end() || ahead.eat_word(BAD) {
        return Ok(Damage::Parity);
    }
    if scanner.eat_word("parity") {
        return Ok(Damage::Parity);
    }
    if scanner.eat_word("stop") {
        return Ok(Damage::Stop);
    }
    if scanner.eat_word("flip") {
        return Ok(Damage::Flip(flips(scanner, false)?));
    }
    if scanner.eat_word("gap") {
        return Ok(Damage::Gap(times::duration(scanner)?));
    }
    Err(scanner.unexpected("what is wrong with the byte (parity, stop, flip, gap)"))
}

/// Bits 0 to 7, `p` and `s`; on the line also `b`, the start bit.
pub(super) fn flips(scanner: &mut Scanner<'_>, start: bool) -> Result<Flips, Problem> {
    let mut flips = Flips::default();
    loop {
        let mut ahead = scanner.clone();
        let word = ahead.take_while(|c| c.is_ascii_alphanumeric());
        match word.map_or("", |word| word.value).as_bytes() {
            [bit @ b'0'..=b'7'] => flips.data ^= 1 << (bit - b'0'),
            b"p" => flips.parity = true,
            b"s" => flips.stop = true,
            b"b" if start => flips.start = true,
            _ if flips == Flips::default() => {
                return Err(scanner.unexpected("a bit: 0 to 7, p (parity) or s (stop)"));
            }
            _ => return Ok(flips),
        }
        *scanner = ahead;
    }
}

/// Two hexadecimal digits.
pub(super) fn byte(scanner: &mut Scanner<'_>) -> Result<u8, Problem> {
    let before = scanner.clone();
    let digits = scanner.take_while(|c| c.is_ascii_alphanumeric());
    let digits = digits.map_or("", |digits| digits.value);
    let found = u8::from_str_radix(digits, 16).ok();
    found.filter(|_| digits.len() == 2).ok_or_else(|| {
        *scanner = before;
        scanner.unexpected("a byte of two hexadecimal digits")
    })
}
