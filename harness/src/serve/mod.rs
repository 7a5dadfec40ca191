//! Simulated rings served to anyone's master, over a pseudo terminal or a socket, in real time.
