"""Reads and activates `gauntlet simulate --gripper PATH` with pymodbus. Usage: pymodbus_client.py PATH"""
import sys
import time

from pymodbus.client import ModbusSerialClient

STATUS, COMMAND = 0x07D0, 0x03E8
client = ModbusSerialClient(sys.argv[1], baudrate=115200, timeout=1, retries=5)
assert client.connect(), "the port does not open"


def status():
    reply = client.read_holding_registers(STATUS, count=8, device_id=9)
    assert not reply.isError(), reply
    return reply.registers


before = status()[0] >> 8
assert before & 0x01 == 0, f"active already: {before:02X}"
time.sleep(0.01)
reply = client.write_registers(COMMAND, [0x0100, 0, 0], device_id=9)
assert not reply.isError(), reply
end = time.monotonic() + 30
while status()[0] >> 8 & 0x31 != 0x31:
    assert time.monotonic() < end, "never activated"
    time.sleep(0.05)
time.sleep(0.01)
reply = client.readwrite_registers(
    read_address=STATUS, read_count=8, write_address=COMMAND, values=[0x0900, 0x0064, 0xFFFF], device_id=9
)
assert not reply.isError(), reply
assert len(reply.registers) == 8
client.close()
print("pymodbus: FC03, FC16 and FC23 answered")
