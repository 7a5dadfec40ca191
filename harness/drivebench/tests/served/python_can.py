"""A vehicle controller over python-can, unmodified, against a served drive: python_can.py slcan CHANNEL | socketcand HOST:PORT.

Every wait has an end that a loaded machine does not reach; nothing else is decided by the clock.
"""

import can
import sys

RX, TX = 0x201, 0x181
LONG = 60


def connect(kind, where):
    if kind == "slcan":
        return can.Bus(interface="slcan", channel=where, bitrate=500000, sleep_after_open=0)
    host, port = where.rsplit(":", 1)
    return can.Bus(interface="socketcand", channel="can0", host=host, port=int(port))


def send(bus, *data):
    bus.send(can.Message(arbitration_id=RX, data=data, is_extended_id=False))


def wait_for(bus, identifier, *start):
    """The next frame with this identifier and these first bytes; others are dropped."""
    for _ in range(10000):
        message = bus.recv(LONG)
        assert message is not None, f"nothing came, {identifier:x} {bytes(start).hex()} expected"
        assert not message.is_error_frame, message
        if message.arbitration_id == identifier and bytes(message.data[: len(start)]) == bytes(start):
            return bytes(message.data)
    raise AssertionError(f"{identifier:x} {bytes(start).hex()} does not come")


def main(kind, where):
    bus = connect(kind, where)

    # A read: register 1B, the firmware version of the dump.
    send(bus, 0x3D, 0x1B, 0)
    assert wait_for(bus, TX, 0x1B)[1:3] == b"\xd8\x01"

    # A write is not answered; it is read back. 32 bits have replies of 6 bytes.
    send(bus, 0xD4, 0x11, 0x22, 0x33, 0x44)
    send(bus, 0x3D, 0xD4, 0)
    reply = wait_for(bus, TX, 0xD4)
    assert len(reply) == 6 and reply[1:5] == b"\x11\x22\x33\x44", reply

    # A cycle of 5 ms, several replies, and its end: what is asked behind it is answered behind its last frame.
    send(bus, 0x3D, 0x30, 5)
    for _ in range(5):
        wait_for(bus, TX, 0x30)
    send(bus, 0x3D, 0x30, 0xFF)
    send(bus, 0x3D, 0x1B, 0)
    wait_for(bus, TX, 0x1B)
    send(bus, 0x3D, 0x1B, 0)
    message = bus.recv(LONG)
    assert message.arbitration_id == TX and message.data[0] == 0x1B, message

    # An event: the enable bit of STATUS is in the mask, and MODE locks the drive, after a scan in which it was enabled.
    send(bus, 0x52, 0x01, 0x00)
    send(bus, 0x51, 0x10, 0x00)
    send(bus, 0x3D, 0xE2, 2)
    for _ in range(2):
        wait_for(bus, TX, 0xE2)
    send(bus, 0x3D, 0xE2, 0xFF)
    send(bus, 0x51, 0x14, 0x00)
    while wait_for(bus, TX, 0x40)[1] & 1:
        pass

    # What one client sends, the other one hears, with the reply.
    if kind == "socketcand" or where.startswith("socket:"):
        other = connect(kind, where)
        # It takes part once it has got an answer of its own.
        send(other, 0x3D, 0xE8, 0)
        wait_for(other, TX, 0xE8)
        send(bus, 0x3D, 0xE2, 0)
        wait_for(other, RX, 0x3D, 0xE2)
        wait_for(other, TX, 0xE2)
        other.shutdown()
    bus.shutdown()
    print("done")


main(*sys.argv[1:])
