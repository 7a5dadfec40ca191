//! The server under attack, through real sockets of this machine.

use super::*;
use std::io::BufRead as _;

/// More than anything here takes.
const LONG: Duration = Duration::from_secs(60);

fn page(read_only: bool, patience: Duration) -> LivePage {
    let scene = LiveScene {
        title: "a bench".to_owned(),
        read_only: read_only.then(|| "only for looking on".to_owned()),
        ..LiveScene::default()
    };
    LivePage::open_patiently("127.0.0.1:0", false, &scene, patience).expect("a free port")
}

fn connect(page: &LivePage) -> TcpStream {
    let stream = TcpStream::connect(page.address).expect("the server listens");
    stream.set_read_timeout(Some(LONG)).expect("a time-out");
    stream
}

/// Sends bytes and reads the answer to its end.
fn asked(page: &LivePage, bytes: &[u8]) -> (u16, String) {
    let mut stream = connect(page);
    // A server that has refused already takes no more.
    let _refused = stream.write_all(bytes);
    answer_of(stream)
}

fn answer_of(mut stream: TcpStream) -> (u16, String) {
    let mut text = String::new();
    stream.read_to_string(&mut text).expect("an answer");
    let status = text.split(' ').nth(1).and_then(|word| word.parse().ok());
    let body = text.split_once("\r\n\r\n").map_or("", |(_, body)| body);
    (status.expect("a status"), body.to_owned())
}

/// A request of the page itself, with lines of headers more.
fn request(page: &LivePage, line: &str, more: &str, body: &str) -> String {
    let (address, token, length) = (page.address, &page.token, body.len());
    format!(
        "{line} HTTP/1.1\r\nHost: {address}\r\nOrigin: http://{address}\r\nDrivebench-Token: {token}\r\n\
         Content-Type: application/json\r\nContent-Length: {length}\r\n{more}\r\n{body}"
    )
}

#[test]
fn the_page_is_one_file_without_a_secret() {
    let page = page(false, LONG);
    let text = format!("GET / HTTP/1.1\r\nHost: {}\r\n\r\n", page.address);
    let (status, body) = asked(&page, text.as_bytes());
    assert_eq!(status, 200);
    assert!(body.starts_with("<!DOCTYPE html>"), "{body}");
    assert!(!body.contains(&page.token));
    for loaded in ["src=", "@import", "url(", "href=\"http"] {
        assert!(!body.contains(loaded), "{loaded}");
    }
    assert!(page.url().ends_with(&format!("/#{}", page.token)));
    assert_eq!(page.token.len(), 32);
}

#[test]
fn an_order_reaches_the_bench_and_its_answer_the_page() {
    let mut page = page(false, LONG);
    for (answer, expected) in [
        (Ok("done".to_owned()), (200, "done".to_owned())),
        (Err("not now".to_owned()), (409, "not now\n".to_owned())),
    ] {
        let mut stream = connect(&page);
        let body = r#"{"place":1,"fault":2}"#;
        let text = request(&page, "POST /fault", "", body);
        stream.write_all(text.as_bytes()).expect("sent");
        // The wake-up comes with the order.
        poll(&mut [page.poll()], None).expect("a wake-up");
        let mut orders = page.orders();
        while orders.is_empty() {
            orders = page.orders();
        }
        for asked in orders {
            assert_eq!(asked.order, LiveOrder::Fault { place: 1, fault: 2 });
            asked.answer(answer.clone());
        }
        assert_eq!(answer_of(stream), expected);
    }
}

#[test]
fn requests_of_others_are_refused() {
    let page = page(false, LONG);
    let good = request(&page, "POST /fault", "", r#"{"place":0,"fault":0}"#);
    let events = |more: &str| request(&page, "GET /events", more, "");
    let (address, token) = (page.address.to_string(), page.token.clone());
    for (status, bad) in [
        (
            421,
            good.replace(&format!("Host: {address}"), "Host: evil.com"),
        ),
        (403, good.replace("Origin: http://", "Origin: https://")),
        (
            403,
            good.replace(&format!("Origin: http://{address}\r\n"), ""),
        ),
        (403, good.replace(&token, "0123")),
        (403, good.replace("Drivebench-Token", "X-Token")),
        (415, good.replace("application/json", "text/plain")),
        (405, good.replace("POST /fault", "GET /fault")),
        (404, good.replace("/fault ", "/faults ")),
        (400, good.replace("\"fault\"", "\"vault\"")),
        (400, good.replace("HTTP/1.1", "HTTP/9")),
        (
            413,
            good.replace("Content-Length: 21", "Content-Length: 99999"),
        ),
        (431, format!("GET / HTTP/1.1\r\nA: {}", "a".repeat(9000))),
        (403, events("").replace(&token, "")),
        (400, events("Last-Event-ID: -1\r\n")),
    ] {
        let (given, why) = asked(&page, bad.as_bytes());
        assert_eq!(given, status, "{bad}\n{why}");
        assert!(!why.is_empty(), "{bad}");
    }
}

#[test]
fn a_page_that_only_looks_on_takes_no_order() {
    let page = page(true, LONG);
    let text = request(&page, "POST /fault", "", r#"{"place":0,"fault":0}"#);
    let refused = (403, "only for looking on\n".to_owned());
    assert_eq!(asked(&page, text.as_bytes()), refused);
}

/// Half a request is given up, and its connection is free again.
#[test]
fn a_slow_client_is_not_waited_for() {
    let page = page(false, Duration::from_millis(100));
    for half in ["GET / HT", "GET / HTTP/1.1\r\nHost: "] {
        assert_eq!(asked(&page, half.as_bytes()).0, 408, "{half}");
    }
    let text =
        request(&page, "POST /fault", "", "{}").replace("Content-Length: 2", "Content-Length: 9");
    assert_eq!(asked(&page, text.as_bytes()).0, 408);
}

#[test]
fn two_hundred_clients_are_bounded_and_the_next_one_is_served() {
    let page = page(false, LONG);
    let clients: Vec<_> = (0..200).map(|_| connect(&page)).collect();
    // Those beyond the bound are answered without a request.
    let (held, refused) = clients.split_at(MAX_CONNECTIONS);
    for client in refused {
        let stream = client.try_clone().expect("a handle");
        assert_eq!(answer_of(stream).0, 503);
    }
    assert_eq!(held.len(), MAX_CONNECTIONS);
    drop(clients);
    let text = format!("GET / HTTP/1.1\r\nHost: {}\r\n\r\n", page.address);
    let end = Instant::now() + LONG;
    while asked(&page, text.as_bytes()).0 != 200 {
        assert!(Instant::now() < end, "connections stay taken");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// The events that it misses are dropped, and its connection ends when the system takes no more for it.
#[test]
fn a_client_that_reads_nothing_is_let_go() {
    let page = page(false, Duration::from_millis(100));
    let mut stream = connect(&page);
    let text = request(&page, "GET /events", "", "");
    stream.write_all(text.as_bytes()).expect("sent");
    let mut first = [0; 8];
    stream.read_exact(&mut first).expect("an answer");
    let end = Instant::now() + LONG;
    while page.feed().readers() > 0 {
        page.feed().publish("x".repeat(100_000));
        assert!(Instant::now() < end, "the client stays");
    }
}

/// The numbers and kinds of the events of a stream, up to the event with number `last`.
fn events(page: &LivePage, after: Option<u64>, last: u64) -> Vec<String> {
    let mut stream = connect(page);
    let more = after.map_or(String::new(), |after| format!("Last-Event-ID: {after}\r\n"));
    let text = request(page, "GET /events", &more, "");
    stream.write_all(text.as_bytes()).expect("sent");
    let mut seen = Vec::new();
    let mut kind = String::new();
    for line in io::BufReader::new(stream).lines() {
        let line = line.expect("a line");
        if let Some(id) = line.strip_prefix("id: ") {
            seen.push(id.to_owned());
            if id == last.to_string() {
                return seen;
            }
        }
        if let Some(name) = line.strip_prefix("event: ") {
            name.clone_into(&mut kind);
        }
        if let Some(data) = line.strip_prefix("data: ").filter(|_| kind != "news") {
            seen.push(format!("{kind} {data}"));
        }
    }
    seen
}

#[test]
fn a_stream_goes_on_behind_the_last_event_that_was_seen() {
    let page = page(false, LONG);
    for number in 1..=6 {
        page.feed().publish(format!("{{\"at\":\"{number}\"}}"));
    }
    let scene = events(&page, None, 6);
    assert!(
        scene[0].starts_with("scene {\"title\":\"a bench\""),
        "{scene:?}"
    );
    assert_eq!(scene[1..], ["1", "2", "3", "4", "5", "6"]);
    assert_eq!(events(&page, Some(4), 6)[1..], ["5", "6"]);
    // More than is kept: the gap is told.
    for _ in 0..600 {
        page.feed().publish("{}".to_owned());
    }
    let resumed = events(&page, Some(6), 606);
    assert_eq!(resumed[1], "left-out 88");
    assert_eq!(resumed[2], "95");
    assert_eq!(resumed.len(), 2 + 512);
}

#[test]
fn other_machines_need_permission() {
    let refused = LivePage::open("0.0.0.0:0", false, &LiveScene::default());
    assert!(matches!(refused, Err(ListenError::Remote { .. })));
    let page = LivePage::open("0.0.0.0:0", true, &LiveScene::default()).expect("a free port");
    let port = page.address.port();
    let local = SocketAddr::from(([127, 0, 0, 1], port));
    for (host, status) in [
        (format!("127.0.0.1:{port}"), 200),
        (format!("evil.com:{port}"), 421),
    ] {
        let mut stream = TcpStream::connect(local).expect("the server listens");
        let text = format!("GET / HTTP/1.1\r\nHost: {host}\r\n\r\n");
        stream.write_all(text.as_bytes()).expect("sent");
        assert_eq!(answer_of(stream).0, status, "{host}");
    }
}
