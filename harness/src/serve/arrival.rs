//! When bytes came over a socket: by the operating system's stamp, so that it does not count how late this program is woken.

use harness_proto::time::Span;
use std::io;
use std::net::TcpStream;

#[cfg(target_os = "linux")]
pub(super) use linux::{ask, read};

/// Stamps of the system's clock, of the last segment of what is read (socket(7), `SO_TIMESTAMPNS`).
#[cfg(target_os = "linux")]
mod linux {
    use super::{Span, TcpStream, io};
    use nix::cmsg_space;
    use nix::sys::socket::sockopt::ReceiveTimestampns;
    use nix::sys::socket::{ControlMessageOwned, MsgFlags, recvmsg, setsockopt};
    use nix::sys::time::{TimeSpec, TimeValLike};
    use nix::time::{ClockId, clock_gettime};
    use std::io::IoSliceMut;
    use std::os::fd::AsRawFd;

    /// Asks for stamps from now on. Where there are none, what is read has come just now.
    pub(in super::super) fn ask(stream: &TcpStream) {
        let _without = setsockopt(stream.as_raw_fd(), ReceiveTimestampns, &true);
    }

    /// Reads, and says how long ago the last byte of it came.
    pub(in super::super) fn read(
        stream: &mut TcpStream,
        buffer: &mut [u8],
    ) -> io::Result<(usize, Span)> {
        let mut space = cmsg_space!(TimeSpec);
        let mut slices = [IoSliceMut::new(buffer)];
        let read = recvmsg::<()>(
            stream.as_raw_fd(),
            &mut slices,
            Some(&mut space),
            MsgFlags::empty(),
        )?;
        let stamp = read.cmsgs().find_map(|message| match message {
            ControlMessageOwned::ScmTimestampns(stamp) => Some(stamp),
            _ => None,
        });
        let now = clock_gettime(ClockId::CLOCK_REALTIME);
        // Whoever sets the clock meanwhile has the stamp lie ahead.
        let ago = now
            .ok()
            .zip(stamp)
            .map_or(0, |(now, stamp)| (now - stamp).num_nanoseconds());
        Ok((
            read.bytes,
            Span::from_nanos(u64::try_from(ago).unwrap_or(0)),
        ))
    }
}

/// Where the system has no stamps, all has come when it is read.
#[cfg(not(target_os = "linux"))]
pub(super) fn ask(_stream: &TcpStream) {}

#[cfg(not(target_os = "linux"))]
pub(super) fn read(stream: &mut TcpStream, buffer: &mut [u8]) -> io::Result<(usize, Span)> {
    Ok((io::Read::read(stream, buffer)?, Span::ZERO))
}

#[cfg(test)]
mod tests {
    use super::{ask, read};
    use harness_proto::time::Span;
    use std::io::Write;
    use std::net::{TcpListener, TcpStream};
    use std::time::Duration;

    #[test]
    fn what_was_not_read_at_once_has_come_before() {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let mut client = TcpStream::connect(listener.local_addr().expect("bound")).expect("there");
        let (mut stream, _) = listener.accept().expect("a client");
        ask(&stream);
        client.write_all(&[0x80]).expect("room");
        let nap = Duration::from_millis(20);
        std::thread::sleep(nap);
        let mut buffer = [0; 8];
        let (count, ago) = read(&mut stream, &mut buffer).expect("a byte");
        assert_eq!(buffer[..count], [0x80]);
        if cfg!(target_os = "linux") {
            // Clocks may be slewed a little.
            assert!(ago >= Span::from_millis(19), "{ago}");
        }
        drop(client);
        let (count, _) = read(&mut stream, &mut buffer).expect("the end");
        assert_eq!(count, 0);
    }
}
