"""Emergency messages of CANopen (CiA 301, 7.2.7); the cell sends one when a fault comes or goes; pure."""

import struct
from dataclasses import dataclass

GENERIC, COMMUNICATION, MANUFACTURER = 0x01, 0x10, 0x80
"""Bits of the error register 0x1001."""
NO_ERROR, HEARTBEAT_LOST, BUS_RECOVERED, PDO_NOT_PROCESSED, PDO_TOO_SHORT = 0x0000, 0x8130, 0x8140, 0x8200, 0x8210
"""Error codes of CiA 301, table 26."""
_EMCY = struct.Struct("<HBHHB")


@dataclass(slots=True)
class Emergency:
    """The present fault; each change of it produces one message."""

    fault: int = 0
    """Code of `drivers.errors`; 0 if there is none."""
    is_plc_lost: bool = False

    @property
    def register(self) -> int:
        """Error register, object 0x1001."""
        bits = (MANUFACTURER if self.fault else 0) | (COMMUNICATION if self.is_plc_lost else 0)
        if self.fault // 1000 == 1:
            bits |= COMMUNICATION
        return bits | GENERIC if bits else 0

    def update(self, fault: int, run: int) -> bytes | None:
        """Take the fault code of the report and the run's number; return the message to send, or None."""
        if fault == self.fault:
            return None
        self.fault = fault
        # Error code of the cell's own faults: 0xFF00 plus the thousands of the fault code; bytes 3 and 4 hold the
        # whole fault code.
        code = 0xFF00 + fault // 1000 if fault else NO_ERROR
        return self.message(code, run)

    def message(self, code: int, run: int = 0) -> bytes:
        """Return the message for an error code: code, register, fault code, lowest 24 bits of the run's number."""
        return _EMCY.pack(code, self.register, self.fault, run & 0xFFFF, run >> 16 & 0xFF)
