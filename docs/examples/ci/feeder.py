"""A PLC's program over Modbus TCP: it lets the cell insert pegs, by sequence number as the guide for PLC programmers says.

python feeder.py HOST PORT SERIAL...
"""

import sys
import time

from pymodbus.client import ModbusTcpClient

LIFE, SEQUENCE, CODE, ACKNOWLEDGE, SERIAL, SERIAL_WORDS, LIFE_TAIL, COMMAND_WORDS = 0, 1, 2, 4, 8, 16, 40, 41
REPORT_SEQUENCE, ANSWERED, REFUSAL, RESULT, FAULT, REPORT_WORDS = 2, 3, 4, 5, 7, 13
RESET, INSERT_PEG = 1, 100
RESULTS = {1: "good", 2: "failed", 3: "stopped", 4: "fault"}
CYCLE = 0.02  # s


class Feeder:
    """The program; every command waits for its end."""

    def __init__(self, host: str, port: int) -> None:
        self._client = ModbusTcpClient(host, port=port)
        if not self._client.connect():
            raise ConnectionError(f"no cell at {host}:{port}")
        self._command = [0] * COMMAND_WORDS
        while self._exchange()[ANSWERED] != self._command[SEQUENCE]:  # a first number with code 0 begins the count
            time.sleep(CYCLE)

    def close(self) -> None:
        """Disconnect."""
        self._client.close()

    def insert(self, serial: str) -> str:
        """Return what came of one peg: good, failed, stopped, "fault" with its code, or "refused" with the reason."""
        return self._run(INSERT_PEG, serial)

    def reset(self) -> str:
        """Make the cell ready again after a stop or a fault."""
        return self._run(RESET)

    def _run(self, code: int, serial: str = "") -> str:
        text = serial.encode("ascii").ljust(2 * SERIAL_WORDS, b"\0")
        words = [int.from_bytes(text[place : place + 2]) for place in range(0, len(text), 2)]
        self._command[SERIAL : SERIAL + SERIAL_WORDS] = words
        self._command[CODE] = code
        number = self._command[SEQUENCE] = self._command[SEQUENCE] % 0xFFFF + 1
        while True:
            report = self._exchange()
            if report[ANSWERED] == number and report[REFUSAL]:
                return f"refused {report[REFUSAL]}"
            if report[REPORT_SEQUENCE] == number and report[RESULT]:
                self._command[ACKNOWLEDGE] = number
                self._exchange()
                result = RESULTS[report[RESULT]]
                return f"{result} {report[FAULT]}" if result == "fault" else result
            time.sleep(CYCLE)

    def _exchange(self) -> list[int]:
        """Write the whole command and read the report, each in one request."""
        self._command[LIFE] = self._command[LIFE_TAIL] = self._command[LIFE] % 0xFFFF + 1
        self._client.write_registers(0, self._command)
        return self._client.read_input_registers(0, count=REPORT_WORDS).registers


if __name__ == "__main__":
    feeder = Feeder(sys.argv[1], int(sys.argv[2]))
    for each in sys.argv[3:]:
        print(each, feeder.insert(each))
    feeder.close()
