//! The head of a request, read from any bytes: more are needed, it is this head, or it is refused.

use std::fmt;

/// The most bytes of a request line and its headers.
pub(super) const MAX_HEAD: usize = 8 << 10;
/// The most bytes of a body.
pub(super) const MAX_BODY: usize = 4 << 10;
/// The most headers; browsers send about fifteen.
const MAX_HEADERS: usize = 64;

/// Headers that decide something here: a second one of a name is refused, because readers differ in which one counts.
const DECIDE: [&str; 6] = [
    "host",
    "origin",
    "content-length",
    "content-type",
    "last-event-id",
    super::gate::TOKEN,
];

/// Why a request is refused: the status of HTTP, and a sentence.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Refusal {
    pub(super) status: u16,
    pub(super) why: String,
    /// The method that is allowed, where another one was used.
    pub(super) allow: Option<&'static str>,
}

impl Refusal {
    pub(super) fn new(status: u16, why: impl fmt::Display) -> Self {
        Self {
            status,
            why: why.to_string(),
            allow: None,
        }
    }
}

/// A request without its body.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct RequestHead {
    pub(super) method: String,
    pub(super) target: String,
    /// Names in lower case, and values.
    headers: Vec<(String, String)>,
}

/// What bytes of a request are.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Read {
    /// The begin of a head.
    More,
    /// A head, and how many bytes it has.
    Head(RequestHead, usize),
    /// No head.
    Bad(Refusal),
}

impl RequestHead {
    /// The value of a header, its name in lower case.
    pub(super) fn header(&self, name: &str) -> Option<&str> {
        let mut headers = self.headers.iter();
        let (_, value) = headers.find(|(known, _)| known == name)?;
        Some(value)
    }

    /// How long its body is.
    pub(super) fn length(&self) -> Result<usize, Refusal> {
        if self.header("transfer-encoding").is_some() {
            return Err(Refusal::new(
                400,
                "a body with a Content-Length expected, not Transfer-Encoding",
            ));
        }
        let Some(text) = self.header("content-length") else {
            return Ok(0);
        };
        if text.is_empty() || !text.bytes().all(|byte| byte.is_ascii_digit()) {
            return Err(Refusal::new(400, "Content-Length must be a number"));
        }
        let length = text.parse().unwrap_or(usize::MAX);
        match length {
            0..=MAX_BODY => Ok(length),
            _ => Err(Refusal::new(
                413,
                format_args!("a body of at most {MAX_BODY} bytes expected"),
            )),
        }
    }
}

/// Reads the head of a request.
pub(super) fn read(bytes: &[u8]) -> Read {
    let end = bytes.windows(4).position(|four| four == b"\r\n\r\n");
    let Some(end) = end.filter(|end| *end <= MAX_HEAD) else {
        return match bytes.len() > MAX_HEAD {
            true => Read::Bad(Refusal::new(
                431,
                format_args!("request line and headers of at most {MAX_HEAD} bytes expected"),
            )),
            false => Read::More,
        };
    };
    match head(&bytes[..end]) {
        Ok(head) => Read::Head(head, end + 4),
        Err(why) => Read::Bad(Refusal::new(400, why)),
    }
}

fn head(bytes: &[u8]) -> Result<RequestHead, &'static str> {
    let plain = |byte: &u8| matches!(byte, b'\t' | b'\r' | b'\n' | b' '..=b'~');
    if !bytes.iter().all(plain) {
        return Err("a head of printable ASCII characters expected");
    }
    let text = str::from_utf8(bytes).map_err(|_| "a head of ASCII characters expected")?;
    let mut lines = text.split("\r\n");
    let first = lines.next().unwrap_or_default();
    let words: Vec<_> = first.split(' ').collect();
    let [method, target, "HTTP/1.1" | "HTTP/1.0"] = words[..] else {
        return Err("a request line such as `GET / HTTP/1.1` expected");
    };
    let is_token = |text: &str| !text.is_empty() && text.bytes().all(is_token_byte);
    if !is_token(method) || !target.starts_with('/') {
        return Err("a method and a path that begins with / expected");
    }
    let mut head = RequestHead {
        method: method.to_owned(),
        target: target.to_owned(),
        headers: Vec::new(),
    };
    for line in lines {
        let header = line.split_once(':').filter(|(name, _)| is_token(name));
        let (name, value) = header.ok_or("headers such as `Name: value` expected")?;
        if value.contains(['\r', '\n']) {
            return Err("lines that end with CR LF expected");
        }
        let name = name.to_ascii_lowercase();
        if DECIDE.contains(&name.as_str()) && head.header(&name).is_some() {
            return Err("a header that decides something stands twice");
        }
        if head.headers.len() == MAX_HEADERS {
            return Err("fewer headers expected");
        }
        let value = value.trim_matches([' ', '\t']).to_owned();
        head.headers.push((name, value));
    }
    if first.contains(['\r', '\n', '\t']) {
        return Err("lines that end with CR LF expected");
    }
    Ok(head)
}

/// RFC 9110, 5.6.2.
fn is_token_byte(byte: u8) -> bool {
    byte.is_ascii_alphanumeric() || b"!#$%&'*+-.^_`|~".contains(&byte)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const GOOD: &[u8] =
        b"GET /events HTTP/1.1\r\nHost: 127.0.0.1:8090\r\nLast-Event-ID:  12 \r\n\r\n";

    fn status(bytes: &[u8]) -> Option<u16> {
        match read(bytes) {
            Read::Bad(refusal) => Some(refusal.status),
            Read::More | Read::Head(..) => None,
        }
    }

    #[test]
    fn a_head_is_read_when_it_has_come() {
        for length in 0..GOOD.len() {
            assert_eq!(read(&GOOD[..length]), Read::More);
        }
        let Read::Head(head, used) = read(&[GOOD, b"body"].concat()) else {
            panic!("a head");
        };
        assert_eq!(used, GOOD.len());
        assert_eq!((&*head.method, &*head.target), ("GET", "/events"));
        assert_eq!(head.header("host"), Some("127.0.0.1:8090"));
        assert_eq!(head.header("last-event-id"), Some("12"));
        assert_eq!(head.length(), Ok(0));
    }

    #[test]
    fn what_is_no_head_is_refused() {
        for bad in [
            &b"GET /\r\n\r\n"[..],
            b"GET / HTTP/2.0\r\n\r\n",
            b"GET  / HTTP/1.1\r\n\r\n",
            b"GET http://x/ HTTP/1.1\r\n\r\n",
            b"G(T / HTTP/1.1\r\n\r\n",
            b"GET / HTTP/1.1\r\nHost : a\r\n\r\n",
            b"GET / HTTP/1.1\r\n folded: a\r\n\r\n",
            b"GET / HTTP/1.1\nHost: a\r\n\r\n",
            b"GET / HTTP/1.1\r\nHost: a\r\nhost: b\r\n\r\n",
            b"GET / HTTP/1.1\r\nHost: a\nOrigin: b\r\n\r\n",
            b"GET / HTTP/1.1\r\nHost: \xFF\r\n\r\n",
            b"\0\r\n\r\n",
        ] {
            assert_eq!(status(bad), Some(400), "{}", bad.escape_ascii());
        }
        assert_eq!(status(&[b'a'; MAX_HEAD]), None);
        assert_eq!(status(&[b'a'; MAX_HEAD + 1]), Some(431));
        let many = "a: b\r\n".repeat(MAX_HEADERS + 1);
        let many = format!("GET / HTTP/1.1\r\n{many}\r\n");
        assert_eq!(status(many.as_bytes()), Some(400));
    }

    #[test]
    fn a_body_has_a_length_within_bounds() {
        for (line, expected) in [
            ("Content-Length: 12", Ok(12)),
            ("Content-Length: 4096", Ok(4096)),
            ("Content-Length: 4097", Err(413)),
            ("Content-Length: 99999999999999999999999", Err(413)),
            ("Content-Length: -1", Err(400)),
            ("Content-Length: +1", Err(400)),
            ("Content-Length:", Err(400)),
            ("Transfer-Encoding: chunked", Err(400)),
        ] {
            let text = format!("POST /fault HTTP/1.1\r\n{line}\r\n\r\n");
            let Read::Head(head, _) = read(text.as_bytes()) else {
                panic!("{line}");
            };
            let length = head.length().map_err(|refusal| refusal.status);
            assert_eq!(length, expected, "{line}");
        }
    }

    proptest! {
        /// Any bytes are answered, and so is a good request with some of its bytes changed.
        #[test]
        fn no_bytes_panic(
            bytes in proptest::collection::vec(any::<u8>(), 0..200),
            changes in proptest::collection::vec((0..GOOD.len(), any::<u8>()), 0..6),
        ) {
            let _any = read(&bytes);
            let mut changed = GOOD.to_vec();
            for (place, byte) in changes {
                changed[place] = byte;
            }
            if let Read::Head(head, used) = read(&changed) {
                prop_assert!(used <= changed.len());
                let _any = head.length();
            }
        }
    }
}
