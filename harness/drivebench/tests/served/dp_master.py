"""A public DP master, pyprofibus, unmodified, against a served slave: dp_master.py DEVICE GSD PPO.

It brings slave 8 into the exchange with the configuration of the GSD, and turns the motor to 50 %.
Every wait has an end that a loaded machine does not reach; nothing else is decided by the clock.
"""

import io
import sys
import time

import pyprofibus

MODULES = {1: "PPO 1: 4 PKW 2 PZD", 2: "PPO 2: 4 PKW 4 + 2 PZD", 3: "PPO 3: 0 PKW 2 PZD", 4: "PPO 4: 0 PKW 4 + 2 PZD"}
OCTETS = {1: 12, 2: 20, 3: 4, 4: 12}
WORDS_BEGIN = {1: 8, 2: 8, 3: 0, 4: 0}
LONG = 120


def main(device, gsd, ppo):
    conf = f"""
[PHY]
type = serial
dev = {device}
baud = 19200
[DP]
master_class = 1
master_addr = 2
[SLAVE_0]
name = nordac
addr = 8
gsd = {gsd}
watchdog_ms = 0
input_size = {OCTETS[ppo]}
output_size = {OCTETS[ppo]}
module_0 = {MODULES[ppo]}
"""
    config = pyprofibus.PbConf(io.StringIO(conf))
    master = config.makeDPM()
    (slave_conf,) = config.slaveConfs
    slave = slave_conf.makeDpSlaveDesc()
    master.addSlave(slave)
    master.initialize()

    begin = WORDS_BEGIN[ppo]
    control, seen = 0x047E, []
    end = time.monotonic() + LONG
    while time.monotonic() < end:
        data = bytearray(OCTETS[ppo])
        data[begin : begin + 4] = control.to_bytes(2, "big") + (0x2000).to_bytes(2, "big")
        slave.setMasterOutData(data)
        master.run()
        inputs = slave.getMasterInData()
        if inputs is None:
            continue
        assert len(inputs) == OCTETS[ppo], inputs
        status = int.from_bytes(inputs[begin : begin + 2], "big")
        actual = int.from_bytes(inputs[begin + 2 : begin + 4], "big")
        if status not in seen:
            seen.append(status)
        if status & 0x4F == 0x01:
            control = 0x047F
        if (status, actual) == (0x0F37, 0x2000):
            print("done")
            return
    raise AssertionError(f"the motor does not turn; ZSW was {[hex(own) for own in seen]}")


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], int(sys.argv[3]))
