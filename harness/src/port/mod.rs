//! Streams of bytes that the operating system gives: serial ports, pseudo terminals, sockets.
