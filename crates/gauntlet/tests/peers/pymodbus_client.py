"""Reads and activates `gauntlet simulate --gripper PLACE` with pymodbus.

Usage: pymodbus_client.py PATH, or tcp:HOST:PORT"""
import sys
import time

from pymodbus.client import ModbusSerialClient, ModbusTcpClient

STATUS, COMMAND = 0x07D0, 0x03E8
on_network = sys.argv[1].startswith("tcp:")
if on_network:
    _, host, port = sys.argv[1].split(":")
    client, unit = ModbusTcpClient(host, port=int(port), timeout=1, retries=5), 2
else:
    client, unit = ModbusSerialClient(sys.argv[1], baudrate=115200, timeout=1, retries=5), 9
assert client.connect(), "the port does not open"


def status():
    read = client.read_input_registers if on_network else client.read_holding_registers
    reply = read(STATUS, count=8, device_id=unit)
    assert not reply.isError(), reply
    return reply.registers


before = status()[0] >> 8
assert before & 0x01 == 0, f"active already: {before:02X}"
time.sleep(0.01)
reply = client.write_registers(COMMAND, [0x0100, 0, 0], device_id=unit)
assert not reply.isError(), reply
end = time.monotonic() + 30
while status()[0] >> 8 & 0x31 != 0x31:
    assert time.monotonic() < end, "never activated"
    time.sleep(0.05)
time.sleep(0.01)
if on_network:
    # The network variant has no FC23.
    reply = client.write_registers(COMMAND, [0x0900, 0x0064, 0xFFFF], device_id=unit)
    assert not reply.isError(), reply
else:
    reply = client.readwrite_registers(
        read_address=STATUS, read_count=8, write_address=COMMAND, values=[0x0900, 0x0064, 0xFFFF], device_id=unit
    )
    assert not reply.isError(), reply
    assert len(reply.registers) == 8
end = time.monotonic() + 30
while status()[2] >> 8 != 0x64:
    assert time.monotonic() < end, "never moved to 0x64"
    time.sleep(0.05)
client.close()
print("pymodbus: FC04 and FC16 answered" if on_network else "pymodbus: FC03, FC16 and FC23 answered")
