"""Reads and writes `gauntlet simulate --gripper PATH` with minimalmodbus. Usage: minimalmodbus_client.py PATH"""
import sys
import time

import minimalmodbus

STATUS, COMMAND = 0x07D0, 0x03E8
gripper = minimalmodbus.Instrument(sys.argv[1], 9)
gripper.serial.baudrate = 115200
gripper.serial.timeout = 1.0


def patiently(call, *arguments):
    """A few tries: a busy machine may be late."""
    for attempt in range(5):
        try:
            time.sleep(0.01)
            return call(*arguments)
        except minimalmodbus.ModbusException:
            if attempt == 4:
                raise


registers = patiently(gripper.read_registers, STATUS, 8)
assert len(registers) == 8
patiently(gripper.write_registers, COMMAND, [0x0000, 0, 0])
assert patiently(gripper.read_registers, COMMAND, 3) == [0, 0, 0]
print("minimalmodbus: FC03 and FC16 answered")
