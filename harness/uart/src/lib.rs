//! Calls of Linux's serial drivers for which there is no safe one: the counts of a port, its base rate, and low latency (`linux/serial.h`).
//!
//! The unsafe code is in `get` and `set`; no other crate than this one and harness-socketcan has any.

use rustix::fd::{AsFd, BorrowedFd, OwnedFd};
use rustix::io::Errno;
use rustix::ioctl::{Getter, Opcode, Setter, ioctl};
use std::ffi::{c_char, c_int, c_uint, c_ulong, c_ushort, c_void};

/// Whether the numbers of the calls are those of `asm-generic/ioctls.h`, as on x86, ARM and RISC-V.
const GENERIC: bool = cfg!(any(
    target_arch = "x86",
    target_arch = "x86_64",
    target_arch = "arm",
    target_arch = "aarch64",
    target_arch = "riscv64"
));

const TIOCGSERIAL: Opcode = 0x541E;
const TIOCSSERIAL: Opcode = 0x541F;
const TIOCGICOUNT: Opcode = 0x545D;

/// ASYNC_LOW_LATENCY of `linux/tty_flags.h`.
const LOW_LATENCY: c_int = 1 << 13;

/// PORT_8250, PORT_16450, PORT_16550A, PORT_16750 and PORT_NS16550A: the chips that have no rates but those of a divisor of 16 bits
/// (`linux/serial_core.h`).
const DIVIDED: [c_int; 5] = [1, 2, 4, 8, 14];

/// The major number of the ports of the driver for 8250 chips. Drivers of USB adapters name such a chip too, with any base rate.
const TTY_MAJOR: u32 = 4;

/// `struct serial_icounter_struct`.
#[repr(C)]
struct Icounter {
    lines: [c_int; 4],
    rx: c_int,
    tx: c_int,
    frame: c_int,
    overrun: c_int,
    parity: c_int,
    brk: c_int,
    buf_overrun: c_int,
    reserved: [c_int; 9],
}

/// `struct serial_struct`.
#[repr(C)]
#[derive(Clone, Copy)]
struct SerialStruct {
    kind: c_int,
    line: c_int,
    port: c_uint,
    irq: c_int,
    flags: c_int,
    xmit_fifo_size: c_int,
    custom_divisor: c_int,
    baud_base: c_int,
    close_delay: c_ushort,
    io_type: c_char,
    reserved_char: [c_char; 1],
    hub6: c_int,
    closing_wait: c_ushort,
    closing_wait2: c_ushort,
    iomem_base: *mut c_void,
    iomem_reg_shift: c_ushort,
    port_high: c_uint,
    iomap_base: c_ulong,
}

/// Reads a structure of a port.
///
/// # Errors
/// The driver does not have it.
fn get<const CALL: Opcode, T>(port: BorrowedFd<'_>) -> Result<T, Errno> {
    if !GENERIC {
        return Err(Errno::NOTTY);
    }
    #[expect(unsafe_code, reason = "no crate has these calls")]
    // SAFETY: the callers name a call and the structure that it fills whole, as `linux/serial.h` declares both; all of its fields may have any value.
    unsafe {
        ioctl(port, Getter::<CALL, T>::new())
    }
}

/// Writes back the settings of a port that were read.
fn set(port: BorrowedFd<'_>, settings: SerialStruct) -> Result<(), Errno> {
    #[expect(unsafe_code, reason = "no crate has this call")]
    // SAFETY: TIOCSSERIAL reads a `struct serial_struct` and keeps no pointer to it.
    unsafe {
        ioctl(port, Setter::<TIOCSSERIAL, _>::new(settings))
    }
}

/// What a driver has counted at a port since the computer was started. Counts begin again at 0 behind 2^32.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Bytes sent.
    pub sent: u32,
    /// Bytes received.
    pub received: u32,
    /// Bytes lost in the chip or in the kernel's queue.
    pub overruns: u32,
    /// Bytes with a wrong parity bit.
    pub parity: u32,
    /// Bytes without a stop bit.
    pub framing: u32,
    /// Breaks.
    pub breaks: u32,
}

impl Counts {
    /// What was counted since `before`.
    #[must_use]
    pub const fn since(self, before: Self) -> Self {
        Self {
            sent: self.sent.wrapping_sub(before.sent),
            received: self.received.wrapping_sub(before.received),
            overruns: self.overruns.wrapping_sub(before.overruns),
            parity: self.parity.wrapping_sub(before.parity),
            framing: self.framing.wrapping_sub(before.framing),
            breaks: self.breaks.wrapping_sub(before.breaks),
        }
    }
}

/// The counts of a port; `None` where its driver does not count.
pub fn counts(port: impl AsFd) -> Option<Counts> {
    let counted: Icounter = get::<TIOCGICOUNT, _>(port.as_fd()).ok()?;
    let count = |number: c_int| number.cast_unsigned();
    Some(Counts {
        sent: count(counted.tx),
        received: count(counted.rx),
        overruns: count(counted.overrun).wrapping_add(count(counted.buf_overrun)),
        parity: count(counted.parity),
        framing: count(counted.frame),
        breaks: count(counted.brk),
    })
}

/// The rate that a port makes in place of the one that is asked for, in bit/s; `None` where its driver does not say from what it divides.
/// The driver for 8250 chips (16550) takes every rate, says that it has it, and makes the nearest whole fraction of its base rate.
pub fn real_rate(port: impl AsFd, asked: u32) -> Option<u32> {
    let device = rustix::fs::fstat(&port).ok()?.st_rdev;
    let driver: SerialStruct = get::<TIOCGSERIAL, _>(port.as_fd()).ok()?;
    let driver = Some(driver).filter(|_| rustix::fs::major(device) == TTY_MAJOR)?;
    let base = u32::try_from(driver.baud_base).ok();
    let base = base.filter(|base| *base > 0)?;
    DIVIDED.contains(&driver.kind).then(|| divided(base, asked))
}

/// The nearest whole fraction of a base rate.
fn divided(base: u32, asked: u32) -> u32 {
    let asked = asked.max(1);
    let divisor = (base + asked / 2) / asked;
    base / divisor.clamp(1, 0xFFFF)
}

/// A port that hands over bytes as soon as they come, until this is dropped. A USB adapter of FTDI collects them for 16 ms.
#[derive(Debug)]
pub struct LowLatency(OwnedFd);

impl LowLatency {
    /// Asks the driver for it, which any user may; `None` where the driver does not have it or the port has it already.
    pub fn of(port: impl AsFd) -> Option<Self> {
        let driver: SerialStruct = get::<TIOCGSERIAL, _>(port.as_fd()).ok()?;
        if driver.flags & LOW_LATENCY != 0 {
            return None;
        }
        let kept = Self(port.as_fd().try_clone_to_owned().ok()?);
        let flags = driver.flags | LOW_LATENCY;
        set(port.as_fd(), SerialStruct { flags, ..driver }).ok()?;
        Some(kept)
    }
}

impl Drop for LowLatency {
    fn drop(&mut self) {
        let driver: Result<SerialStruct, _> = get::<TIOCGSERIAL, _>(self.0.as_fd());
        if let Ok(driver) = driver {
            let flags = driver.flags & !LOW_LATENCY;
            // A port that is gone has no settings any more.
            let _gone = set(self.0.as_fd(), SerialStruct { flags, ..driver });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A 16550 at 1.8432 MHz: the rates of the buses that it has, and what it makes of the others.
    #[test]
    fn a_16550_makes_fractions_of_its_base_rate() {
        for (asked, made) in [
            (38_400, 38_400),
            (19_200, 19_200),
            (45_450, 38_400),
            (93_750, 115_200),
            (187_500, 115_200),
            (500_000, 115_200),
        ] {
            assert_eq!(divided(115_200, asked), made, "{asked}");
        }
        assert_eq!(divided(3_000_000, 187_500), 187_500);
    }

    #[test]
    fn what_is_no_port_has_no_counts() {
        let file = std::fs::File::open("/dev/null").expect("a file");
        assert_eq!(counts(&file), None);
        assert_eq!(real_rate(&file, 9_600), None);
        assert!(LowLatency::of(&file).is_none());
    }

    #[test]
    fn counts_go_round() {
        let before = Counts {
            sent: u32::MAX,
            ..Counts::default()
        };
        let after = Counts {
            sent: 1,
            breaks: 3,
            ..before
        };
        let since = after.since(before);
        assert_eq!((since.sent, since.breaks), (2, 3));
    }
}
