//! A stream of lines of control and their answers: standard input, or a client of a socket.

use super::control::ControlAnswer;
use super::lines::LineBuffer;
use super::place::ControlPlace;
use super::shell::{ServeError, ServeHost};
use super::tcp::Tcp;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use std::io;
use std::net::SocketAddr;

/// Bytes read at a time.
const CHUNK: usize = 4096;

/// Maximum bytes of answers that the client has not read yet; while they are reached, no further line is read.
const UNREAD: usize = 64 << 10;

/// A source of control lines, with the part of a line received so far and the answers not yet sent.
pub(super) struct ControlStream {
    source: ControlSource,
    lines: LineBuffer,
    answers: Vec<u8>,
}

enum ControlSource {
    Standard,
    Tcp(Tcp),
    /// Standard input has ended.
    Ended,
}

impl ControlStream {
    /// Listens, if it is a socket.
    pub(super) fn open(place: &ControlPlace, allow_remote: bool) -> Result<Self, ServeError> {
        let source = match place {
            ControlPlace::Standard => ControlSource::Standard,
            ControlPlace::Tcp(address) => ControlSource::Tcp(Tcp::listen(address, allow_remote)?),
        };
        Ok(Self {
            source,
            lines: LineBuffer::default(),
            answers: Vec::new(),
        })
    }

    /// The address at which it listens, if it is a socket.
    pub(super) fn address(&self) -> Option<SocketAddr> {
        match &self.source {
            ControlSource::Tcp(tcp) => Some(tcp.address()),
            ControlSource::Standard | ControlSource::Ended => None,
        }
    }

    /// What to wait for.
    pub(super) fn polls(&self) -> Vec<PollFd<'_>> {
        let mut stream = PollFlags::empty();
        stream.set(PollFlags::IN, self.answers.len() < UNREAD);
        stream.set(PollFlags::OUT, !self.answers.is_empty());
        match &self.source {
            ControlSource::Standard => {
                vec![PollFd::from_borrowed_fd(rustix::stdio::stdin(), stream)]
            }
            ControlSource::Tcp(tcp) => {
                let (door, client) = tcp.polls(stream);
                std::iter::once(door).chain(client).collect()
            }
            ControlSource::Ended => Vec::new(),
        }
    }

    /// Executes the lines received and answers them.
    ///
    /// # Errors
    /// An answer cannot be written to standard output.
    pub(super) fn obey(
        &mut self,
        host: &mut dyn ServeHost,
        answer: &mut dyn FnMut(&str) -> Option<ControlAnswer>,
    ) -> io::Result<()> {
        let visitors = match &self.source {
            ControlSource::Tcp(tcp) => tcp.accept(),
            ControlSource::Standard | ControlSource::Ended => Vec::new(),
        };
        self.listen(host, answer)?;
        // Who closes a connection and opens the next one has gone before it comes. A second client is turned away.
        if let ControlSource::Tcp(tcp) = &mut self.source
            && !tcp.taken()
            && let Some((client, _)) = visitors.into_iter().next()
        {
            tcp.seat(client);
            self.listen(host, answer)?;
        }
        self.pass_on();
        Ok(())
    }

    fn listen(
        &mut self,
        host: &mut dyn ServeHost,
        answer: &mut dyn FnMut(&str) -> Option<ControlAnswer>,
    ) -> io::Result<()> {
        let mut buffer = [0; CHUNK];
        while self.answers.len() < UNREAD {
            let read = match &mut self.source {
                ControlSource::Standard => standard(&mut buffer),
                ControlSource::Tcp(tcp) => tcp.read(&mut buffer).map(|(read, _)| read),
                ControlSource::Ended => break,
            };
            let (lines, ended) = match read {
                Ok(read @ 1..) => (self.lines.push(&buffer[..read]), false),
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => break,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
                Ok(0) | Err(_) => (self.lines.end().into_iter().collect(), true),
            };
            for line in lines {
                let answer = match line {
                    Ok(line) => answer(&line),
                    Err(length) => Some(ControlAnswer::Error(format!(
                        "a line of {length} bytes is too long for a line of control"
                    ))),
                };
                let Some(answer) = answer else {
                    continue;
                };
                if matches!(self.source, ControlSource::Standard) {
                    host.tell(&answer.to_string())?;
                } else {
                    self.answers.extend(format!("{answer}\n").bytes());
                }
            }
            self.pass_on();
            if ended {
                match &mut self.source {
                    ControlSource::Tcp(tcp) => tcp.close(),
                    other => *other = ControlSource::Ended,
                }
                self.answers.clear();
                break;
            }
        }
        Ok(())
    }

    /// Writes answers as far as they are taken.
    fn pass_on(&mut self) {
        let ControlSource::Tcp(tcp) = &mut self.source else {
            return;
        };
        while !self.answers.is_empty() {
            // A connection that is broken shows when it is read.
            let Ok(written) = tcp.write(&self.answers) else {
                return;
            };
            self.answers.drain(..written);
        }
    }
}

/// Reads standard input if input is available. Other processes may share it, so it is not made nonblocking.
fn standard(buffer: &mut [u8]) -> io::Result<usize> {
    let stdin = rustix::stdio::stdin();
    let mut fds = [PollFd::from_borrowed_fd(stdin, PollFlags::IN)];
    if poll(&mut fds, Some(&Timespec::default()))? == 0 {
        return Err(io::ErrorKind::WouldBlock.into());
    }
    Ok(rustix::io::read(stdin, buffer)?)
}
