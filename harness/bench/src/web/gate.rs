//! Which requests are let in: this machine's own name, the page's own origin, the token.

use super::request::{Refusal, RequestHead};
use super::view::LiveOrder;
use std::net::SocketAddr;

/// The header with the token.
pub(super) const TOKEN: &str = "drivebench-token";

/// What is asked for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Route {
    Page,
    /// The stream of events after this one.
    Events(Option<u64>),
    /// An order, whose body is to be read.
    Order(Path),
}

/// The paths of orders.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Path {
    /// `/fault`.
    Fault,
    /// `/play`.
    Play,
}

/// The names by which a browser may call a server that it reached at `local`: the address itself, `localhost` for a loopback address,
/// and `name`, by which the user asked for it.
pub(super) fn hosts(local: SocketAddr, name: &str) -> Vec<String> {
    let name = name.rsplit_once(':').map_or(name, |(name, _)| name);
    let mut hosts = vec![local.to_string(), format!("{name}:{}", local.port())];
    if local.ip().is_loopback() {
        hosts.push(format!("localhost:{}", local.port()));
    }
    if local.port() == 80 {
        let short: Vec<_> = hosts
            .iter()
            .filter_map(|host| host.strip_suffix(":80").map(str::to_owned))
            .collect();
        hosts.extend(short);
    }
    hosts
}

/// Lets a request in, or refuses it.
///
/// # Errors
/// [`Refusal`] with the status of HTTP.
pub(super) fn admit(head: &RequestHead, hosts: &[String], token: &str) -> Result<Route, Refusal> {
    let host = head.header("host").unwrap_or_default();
    if !hosts.iter().any(|known| known.eq_ignore_ascii_case(host)) {
        return Err(Refusal::new(
            421,
            "this server does not answer for that Host; open the address that drivebench printed",
        ));
    }
    let origin = head.header("origin");
    let own_origin = format!("http://{host}");
    if origin.is_some_and(|origin| !origin.eq_ignore_ascii_case(&own_origin)) {
        return Err(Refusal::new(
            403,
            "requests of other web sites are refused; the page's own Origin expected",
        ));
    }
    let (path, method) = match &*head.target {
        "/" => (None, "GET"),
        "/events" => (None, "GET"),
        "/fault" => (Some(Path::Fault), "POST"),
        "/play" => (Some(Path::Play), "POST"),
        _ => {
            return Err(Refusal::new(
                404,
                "there is no such page; /, /events, /fault and /play are here",
            ));
        }
    };
    if head.method != method {
        let why = format!("{} takes {method} only", head.target);
        return Err(Refusal {
            allow: Some(method),
            ..Refusal::new(405, why)
        });
    }
    if head.target == "/" {
        return Ok(Route::Page);
    }
    if !same(head.header(TOKEN).unwrap_or_default(), token) {
        return Err(Refusal::new(
            403,
            "the token is missing or wrong; open the address that drivebench printed, with what stands behind its #",
        ));
    }
    let Some(path) = path else {
        let after = head.header("last-event-id");
        let after = after.map(str::parse).transpose();
        let after = after.map_err(|_| Refusal::new(400, "Last-Event-ID must be a number"))?;
        return Ok(Route::Events(after));
    };
    if origin.is_none() {
        return Err(Refusal::new(
            403,
            format_args!("an order needs the Origin of the page: {own_origin}"),
        ));
    }
    let kind = head.header("content-type").unwrap_or_default();
    let kind = kind.split(';').next().unwrap_or_default().trim();
    if !kind.eq_ignore_ascii_case("application/json") {
        return Err(Refusal::new(
            415,
            "a body of the Content-Type application/json expected",
        ));
    }
    Ok(Route::Order(path))
}

/// The order in a body.
///
/// # Errors
/// [`Refusal`]: it is no order of this path.
pub(super) fn order(path: Path, body: &[u8]) -> Result<LiveOrder, Refusal> {
    let order = serde_json::from_slice(body).ok();
    let fits = |order: &LiveOrder| {
        matches!(
            (path, order),
            (Path::Fault, LiveOrder::Fault { .. }) | (Path::Play, LiveOrder::Play { .. })
        )
    };
    order.filter(fits).ok_or_else(|| {
        Refusal::new(
            400,
            match path {
                Path::Fault => "a body such as {\"place\":1,\"fault\":0} expected",
                Path::Play => "a body such as {\"script\":0} expected",
            },
        )
    })
}

/// Compares in a time that does not tell where the two differ.
fn same(given: &str, token: &str) -> bool {
    let differs = given.bytes().zip(token.bytes());
    let differs = differs.fold(0, |all, (a, b)| all | (a ^ b));
    given.len() == token.len() && differs == 0
}

#[cfg(test)]
mod tests {
    use super::super::request::{Read, read};
    use super::*;

    fn asked(lines: &str) -> Result<Route, u16> {
        let text = format!("{}\r\n\r\n", lines.replace('\n', "\r\n"));
        let Read::Head(head, _) = read(text.as_bytes()) else {
            panic!("{lines}");
        };
        let hosts = hosts("127.0.0.1:8090".parse().expect("an address"), "bench:0");
        admit(&head, &hosts, "abc").map_err(|refusal| refusal.status)
    }

    #[test]
    fn only_exact_hosts_are_answered() {
        for host in [
            "127.0.0.1:8090",
            "localhost:8090",
            "LOCALHOST:8090",
            "bench:8090",
        ] {
            assert_eq!(
                asked(&format!("GET / HTTP/1.1\nHost: {host}")),
                Ok(Route::Page)
            );
        }
        for host in [
            "127.0.0.1",
            "127.0.0.1:80",
            "127.0.0.1:8090.evil.com",
            "127.evil.com:8090",
            "localhost:8090:8090",
            "user@localhost:8090",
            "evil.com",
            "",
        ] {
            assert_eq!(
                asked(&format!("GET / HTTP/1.1\nHost: {host}")),
                Err(421),
                "{host}"
            );
        }
        assert_eq!(asked("GET / HTTP/1.1"), Err(421));
    }

    #[test]
    fn short_names_of_port_80() {
        let hosts = hosts("[::1]:80".parse().expect("an address"), "[::1]:80");
        for host in ["[::1]:80", "[::1]", "localhost", "localhost:80"] {
            assert!(hosts.iter().any(|known| known == host), "{hosts:?}");
        }
    }

    #[test]
    fn orders_need_origin_token_and_type() {
        const HOST: &str = "HTTP/1.1\nHost: localhost:8090";
        const OWN: &str = "Origin: http://localhost:8090";
        const JSON: &str = "Content-Type: application/json; charset=utf-8";
        const KEY: &str = "Drivebench-Token: abc";
        let post = |lines: &[&str]| asked(&format!("POST /fault {HOST}\n{}", lines.join("\n")));
        assert_eq!(post(&[OWN, JSON, KEY]), Ok(Route::Order(Path::Fault)));
        assert_eq!(post(&[JSON, KEY]), Err(403));
        for origin in [
            "http://evil.com",
            "null",
            "https://localhost:8090",
            "http://localhost",
            "http://localhost:8090.evil.com",
            "http://127.0.0.1:8090",
        ] {
            let origin = format!("Origin: {origin}");
            assert_eq!(post(&[&origin, JSON, KEY]), Err(403), "{origin}");
        }
        assert_eq!(post(&[OWN, JSON]), Err(403));
        for token in ["", "ab", "abd", "abcd"] {
            let token = format!("Drivebench-Token: {token}");
            assert_eq!(post(&[OWN, JSON, &token]), Err(403), "{token}");
        }
        for kind in [
            "text/plain",
            "application/x-www-form-urlencoded",
            "application/jsonp",
            "",
        ] {
            let kind = format!("Content-Type: {kind}");
            assert_eq!(post(&[OWN, &kind, KEY]), Err(415), "{kind}");
        }
        assert_eq!(post(&[OWN, KEY]), Err(415));
    }

    #[test]
    fn paths_have_methods() {
        for (line, expected) in [
            ("POST /", Err(405)),
            ("GET /fault", Err(405)),
            ("OPTIONS /fault", Err(405)),
            ("POST /events", Err(405)),
            ("GET /../etc/passwd", Err(404)),
            ("GET /?x", Err(404)),
            ("GET /events", Err(403)),
        ] {
            let asked = asked(&format!("{line} HTTP/1.1\nHost: localhost:8090"));
            assert_eq!(asked, expected, "{line}");
        }
        let events = |more: &str| {
            asked(&format!(
                "GET /events HTTP/1.1\nHost: localhost:8090\nDrivebench-Token: abc{more}"
            ))
        };
        assert_eq!(events(""), Ok(Route::Events(None)));
        assert_eq!(events("\nLast-Event-ID: 7"), Ok(Route::Events(Some(7))));
        assert_eq!(events("\nLast-Event-ID: x"), Err(400));
    }

    #[test]
    fn an_order_is_of_its_path() {
        let fault = LiveOrder::Fault { place: 1, fault: 0 };
        let body = br#"{"place":1,"fault":0}"#;
        assert_eq!(order(Path::Fault, body), Ok(fault));
        assert_eq!(
            order(Path::Play, br#"{"script":2}"#),
            Ok(LiveOrder::Play { script: 2 })
        );
        for (path, body) in [
            (Path::Play, &body[..]),
            (Path::Fault, br#"{"script":2}"#),
            (Path::Fault, br#"{"place":-1,"fault":0}"#),
            (Path::Fault, br#"{"place":1,"fault":0,"more":1}"#),
            (Path::Fault, b""),
            (Path::Fault, b"[[[[[[[["),
            (Path::Fault, b"\xFF"),
        ] {
            let status = order(path, body).map_err(|refusal| refusal.status);
            assert_eq!(status, Err(400));
        }
    }
}
