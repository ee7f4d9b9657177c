"""Check sums of the wires; pure."""

import binascii
from functools import lru_cache
from typing import Annotated, ClassVar

from pydantic import Field, field_validator

from drivers.config_model import ConfigModel

Byte = Annotated[int, Field(ge=0, le=0xFF)]


class Crc8(ConfigModel):
    """A CRC of 8 bits with the parameters of CRC catalogues; the default is that of a CySkin hub."""

    SOURCE: ClassVar[str] = "[cyskin]"

    polynomial: Byte = 0x07
    """Generator polynomial without its highest term."""
    initial: Byte = 0xFF
    """Initial value of the register."""
    reflected: bool = False
    """True if the bits of each byte, and of the result, are processed lowest first."""
    final: Byte = 0x00
    """Value that is XORed with the result at the end."""

    @field_validator("polynomial")
    @classmethod
    def _ends_with_one(cls, polynomial: int) -> int:
        if not polynomial & 1:
            raise ValueError(f"0x{polynomial:02X} makes the lowest bit of every check sum 0; an odd polynomial allowed")
        return polynomial

    def of(self, data: bytes) -> int:
        """Return the check sum of `data`, 0 to 255."""
        table = _table(self.polynomial, self.reflected)
        crc = _mirrored(self.initial) if self.reflected else self.initial
        for byte in data:
            crc = table[crc ^ byte]
        return crc ^ self.final


@lru_cache
def _table(polynomial: int, reflected: bool) -> bytes:
    plain = []
    for byte in range(256):
        crc = byte
        for _ in range(8):
            crc = ((crc << 1) ^ (polynomial if crc & 0x80 else 0)) & 0xFF
        plain.append(crc)
    if reflected:
        return bytes(_mirrored(plain[_mirrored(byte)]) for byte in range(256))
    return bytes(plain)


def _mirrored(byte: int) -> int:
    return int(f"{byte:08b}"[::-1], 2)


def crc16(data: bytes) -> int:
    """Return the CRC of 16 bits with x^16 + x^12 + x^5 + 1, initial value 0xFFFF, inverted (CRC-16/GENIBUS).

    Without the inversion, data could still pass the check after the loss of a last zero byte.
    """
    return binascii.crc_hqx(data, 0xFFFF) ^ 0xFFFF
