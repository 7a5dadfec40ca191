//! The kept inputs: `*.hex` are hexadecimal digits with comments, anything else is the input as it is.

/// Why a file is no input.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum InputError {
    /// A character that is no hexadecimal digit.
    #[error(
        "line {line} holds {found:?}; an input is pairs of hexadecimal digits, and # begins a comment"
    )]
    NoDigit {
        /// Which line, counted from 1.
        line: usize,
        /// What stands there.
        found: char,
    },
    #[error("line {line} ends within a byte; an input is pairs of hexadecimal digits")]
    HalfByte {
        /// Which line, counted from 1.
        line: usize,
    },
    /// A `.hex` file that is no text.
    #[error("it is not UTF-8 text; raw bytes have a name without .hex")]
    NotText,
}

/// The input that a file holds.
///
/// # Errors
/// A `.hex` file holds something else than pairs of digits, space and comments.
pub fn input(name: &str, content: &[u8]) -> Result<Vec<u8>, InputError> {
    if !name.ends_with(".hex") {
        return Ok(content.to_vec());
    }
    let text = std::str::from_utf8(content).map_err(|_| InputError::NotText)?;
    let mut bytes = Vec::new();
    for (index, line) in text.lines().enumerate() {
        let line_number = index + 1;
        let mut high = None;
        let code = line.split('#').next().unwrap_or_default();
        for found in code.chars().filter(|c| !c.is_whitespace()) {
            let digit = found
                .to_digit(16)
                .and_then(|digit| u8::try_from(digit).ok())
                .ok_or(InputError::NoDigit {
                    line: line_number,
                    found,
                })?;
            high = match high {
                None => Some(digit),
                Some(high) => {
                    bytes.push(high << 4 | digit);
                    None
                }
            };
        }
        if high.is_some() {
            return Err(InputError::HalfByte { line: line_number });
        }
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digits_and_comments() {
        assert_eq!(
            input("a.hex", b"# FF\n0A ff # 11\n\n1 2"),
            Ok(vec![0x0A, 0xFF, 0x12])
        );
        assert_eq!(input("a.scn", b"# FF"), Ok(b"# FF".to_vec()));
    }

    #[test]
    fn what_is_no_input_is_named() {
        let wrong = InputError::NoDigit {
            line: 2,
            found: 'G',
        };
        assert_eq!(input("a.hex", b"00\n0G"), Err(wrong));
        let half = InputError::HalfByte { line: 1 };
        assert_eq!(input("a.hex", b"001"), Err(half));
        assert_eq!(input("a.hex", &[0xFF]), Err(InputError::NotText));
    }
}
