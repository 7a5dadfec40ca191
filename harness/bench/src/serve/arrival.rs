//! A client's socket, and when its bytes arrived: by the operating system's stamp, so that a late wake-up of this program does not count.

use harness_proto::time::Span;
use std::io::{self, Write};
use std::net::TcpStream;
use std::os::fd::{AsFd, BorrowedFd};
use std::time::{Duration, Instant};

pub(super) use system::ask;
use system::{acknowledge, receive};

#[derive(Debug)]
pub(super) struct ClientStream {
    stream: TcpStream,
    /// When the input was last empty: what is read next arrived later.
    empty: Instant,
}

impl ClientStream {
    /// An accepted connection of a socket that has listened since `listening`.
    pub(super) fn new(stream: TcpStream, listening: Instant) -> Self {
        Self {
            stream,
            empty: listening,
        }
    }

    /// Reads; 0 bytes if the client closed its end. The second value is the age of the last byte.
    ///
    /// # Errors
    /// Nothing is there to read, or the connection failed.
    pub(super) fn read(&mut self, buffer: &mut [u8]) -> io::Result<(usize, Span)> {
        let result = receive(&self.stream, buffer);
        let now = Instant::now();
        match result {
            Ok((count, age)) => {
                acknowledge(&self.stream);
                Ok((count, credible(age, now - self.empty)))
            }
            Err(error) => {
                self.empty = now;
                Err(error)
            }
        }
    }

    /// Writes as much as the system takes.
    ///
    /// # Errors
    /// It takes nothing now, or the connection failed.
    pub(super) fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.stream.write(bytes)
    }
}

impl AsFd for ClientStream {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.stream.as_fd()
    }
}

/// The age of bytes by their stamp, if the stamp can be true: not from the time before the socket was last empty, as after a step of
/// the computer's clock. Bytes without a stamp, and with one that cannot be true, arrived when they were read.
fn credible(age: Option<Duration>, longest: Duration) -> Span {
    let age = age.filter(|age| *age <= longest).unwrap_or_default();
    u64::try_from(age.as_nanos()).map_or(Span::ZERO, Span::from_nanos)
}

#[cfg(target_os = "linux")]
mod system {
    use nix::sys::socket::sockopt::ReceiveTimestampns;
    use nix::sys::socket::{ControlMessageOwned, MsgFlags, recvmsg, setsockopt};
    use nix::sys::time::TimeSpec;
    use std::io::{self, IoSliceMut};
    use std::net::{TcpListener, TcpStream};
    use std::os::fd::AsRawFd;
    use std::time::{Duration, SystemTime};

    /// Asks for stamps of the bytes of all clients to come (socket(7), `SO_TIMESTAMPNS`): accepted sockets inherit the option. The
    /// kernel begins to stamp a moment after the first socket of the computer asked, so it is asked before a client can send.
    pub(in super::super) fn ask(listener: &TcpListener) {
        // Without stamps the time of the read counts.
        let _without = setsockopt(listener.as_raw_fd(), ReceiveTimestampns, &true);
    }

    /// Reads. Returns also the age of the stamp of the last byte, if there is one and it is not ahead of the clock.
    pub(super) fn receive(
        stream: &TcpStream,
        buffer: &mut [u8],
    ) -> io::Result<(usize, Option<Duration>)> {
        let mut space = nix::cmsg_space!(TimeSpec);
        let mut slices = [IoSliceMut::new(buffer)];
        let read = recvmsg::<()>(
            stream.as_raw_fd(),
            &mut slices,
            Some(&mut space),
            MsgFlags::empty(),
        )?;
        let stamp = read.cmsgs().find_map(|message| match message {
            ControlMessageOwned::ScmTimestampns(stamp) => Some(Duration::from(stamp)),
            _ => None,
        });
        let age = stamp.and_then(|stamp| {
            let stamped = SystemTime::UNIX_EPOCH.checked_add(stamp)?;
            SystemTime::now().duration_since(stamped).ok()
        });
        Ok((read.bytes, age))
    }

    /// Acknowledges what was read at once. A client whose system holds small writes back until the last one is acknowledged (Nagle) would
    /// wait 40 ms after each write that gets no reply. The system forgets the setting with the next packet.
    pub(super) fn acknowledge(stream: &TcpStream) {
        let _late = rustix::net::sockopt::set_tcp_quickack(stream, true);
    }
}

/// Where the system has no stamps, bytes arrive when they are read.
#[cfg(not(target_os = "linux"))]
mod system {
    use std::io::{self, Read};
    use std::net::{TcpListener, TcpStream};
    use std::time::Duration;

    pub(in super::super) fn ask(_listener: &TcpListener) {}

    pub(super) const fn acknowledge(_stream: &TcpStream) {}

    pub(super) fn receive(
        mut stream: &TcpStream,
        buffer: &mut [u8],
    ) -> io::Result<(usize, Option<Duration>)> {
        Ok((stream.read(buffer)?, None))
    }
}

#[cfg(test)]
mod tests {
    use super::{ClientStream, ask, credible};
    use harness_proto::time::Span;
    use std::io::{ErrorKind, Write};
    use std::net::{TcpListener, TcpStream};
    use std::time::{Duration, Instant};

    #[test]
    fn only_a_stamp_that_can_be_true_counts() {
        let ms = Duration::from_millis;
        for (age, empty, expected) in [
            (Some(ms(20)), ms(30), 20),
            (Some(ms(0)), ms(30), 0),
            (Some(ms(30)), ms(30), 30),
            // No stamp; one from before the socket was last empty; one as old as the epoch.
            (None, ms(30), 0),
            (Some(ms(31)), ms(30), 0),
            (Some(Duration::MAX), ms(30), 0),
        ] {
            let expected = Span::from_millis(expected);
            assert_eq!(credible(age, empty), expected, "{age:?} {empty:?}");
        }
    }

    /// Accepted sockets are asked for stamps before anything can be read of them, and no stamp is older than the client.
    #[test]
    fn clients_inherit_the_stamps_of_the_listening_socket() {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        ask(&listener);
        let listening = Instant::now();
        let mut far = TcpStream::connect(listener.local_addr().expect("bound")).expect("there");
        let (stream, _) = listener.accept().expect("a client");
        #[cfg(target_os = "linux")]
        {
            use nix::sys::socket::{getsockopt, sockopt::ReceiveTimestampns};
            use std::os::fd::AsRawFd;
            assert_eq!(getsockopt(stream.as_raw_fd(), ReceiveTimestampns), Ok(true));
        }
        stream.set_nonblocking(true).expect("a socket");
        let mut client = ClientStream::new(stream, listening);
        let mut buffer = [0; 8];
        let nothing = client.read(&mut buffer).expect_err("nothing was sent");
        assert_eq!(nothing.kind(), ErrorKind::WouldBlock);
        assert!(client.empty > listening, "it was seen empty");
        far.write_all(&[0x80]).expect("room");
        client.stream.set_nonblocking(false).expect("a socket");
        let (count, ago) = client.read(&mut buffer).expect("a byte");
        assert_eq!(buffer[..count], [0x80]);
        let since = u64::try_from(listening.elapsed().as_nanos()).expect("not long ago");
        assert!(ago <= Span::from_nanos(since), "{ago}");
        drop(far);
        assert_eq!(client.read(&mut buffer).expect("the end").0, 0);
    }

    /// What a client sends is acknowledged at once, even where replies follow requests: the system would wait for a reply to go with it.
    #[cfg(target_os = "linux")]
    #[test]
    fn what_is_read_is_acknowledged_at_once() {
        use std::io::Read as _;
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let mut far = TcpStream::connect(listener.local_addr().expect("bound")).expect("there");
        let (stream, _) = listener.accept().expect("a client");
        let mut client = ClientStream::new(stream, Instant::now());
        let mut buffer = [0; 8];
        for _ in 0..8 {
            far.write_all(&[1]).expect("room");
            assert_eq!(client.read(&mut buffer).expect("a byte").0, 1);
            let quick = rustix::net::sockopt::tcp_quickack(&client.stream);
            assert!(quick.expect("a socket"), "the acknowledgement waits");
            assert_eq!(client.write(&[2]).expect("room"), 1);
            far.read_exact(&mut buffer[..1]).expect("a reply");
        }
    }
}
