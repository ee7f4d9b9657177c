"""Messages between the makers' host program and a CySkin hub with two fingers, from power-on to the first scan.

Source: ladylou899/ros2_ws_cyskin_project at 269ebfa, the library libcynetworklib.a (7_4) of src/cyskin_acquisition,
linked to a CAN driver that records and answers, and called as its main.cpp does, with a period of 100 ms. ">" are the
library's own bytes. "<" are bytes that it accepted: it went on to the next step, and at the end reported `COUNTS`.
The same run refused a message whose check sum is wrong, and left out one with a leading sequence number.
"""

from drivers.transport.wires import CanFrame

DIALOGUE = """
> 17FFFFFF 01 3B 00 00 4F 6D 17
> 5FF 10 00 80
< 5FF 10 04 12 34 56 78 A2
> 5FF 11 05 12 34 56 78 01 96
> 5FF 3C 00 D2
< 501 3C 01 04 39
> 5FF 3D 01 FF BD
< 501 3D 05 00 00 00 0D AC 5F
< 501 3D 05 01 00 00 0D AD 3A
< 501 3D 05 02 00 00 0D AE 95
< 501 3D 05 03 00 00 0D AF F0
> 5FF 37 01 00 C9
> 5FF 31 00 3B
> 5FF 10 00 80
< 501 10 04 12 34 56 78 A2
> 5FF 11 05 12 34 56 78 01 96
> 5FF 3C 00 D2
< 101 3C 06 04 00 0B 0B 0B 0B
< 401 FE
> 5FF 3D 01 FF BD
< 101 3D 0B 00 00 00 0D AC 0C
< 401 00 07 FF 00 00 F5
< 101 3D 0B 01 00 00 0D AD 0C
< 401 00 07 FF 00 00 35
< 101 3D 0B 02 00 00 0D AE 0C
< 401 00 07 FF 00 00 72
< 101 3D 0B 03 00 00 0D AF 0C
< 401 00 07 FF 00 00 B2
> 5FF 38 02 00 64 25
> 5FF 37 01 01 CE
< 101 43 32 00 00 52 08 10 00
< 201 11 01 12 02 13 03 14 04
< 201 15 05 16 06 17 07 18 08
< 201 19 09 52 09 1A 0A 1B 0B
< 201 1C 0C 1D 0D 1E 0E 1F 0F
< 201 20 10 21 11 22 12 23 13
< 401 52 0A 24 14 A9
< 101 43 2A 02 02 25 15 26 16
< 201 27 17 28 18 29 19 2A 1A
< 201 2B 1B 2C 1C 2D 1D 52 0B
< 201 2E 1E 2F 1F 30 20 31 21
< 201 32 22 33 23 34 24 35 25
< 401 36 26 37 27 74
"""
COUNTS = {
    3500: (21000, 4096, 4353, 4610, 4867, 5124, 5381, 5638, 5895, 6152, 6409),
    3501: (21001, 6666, 6923, 7180, 7437, 7694, 7951, 8208, 8465, 8722, 8979),
    3502: (21002, 9236, 9493, 9750, 10007, 10264, 10521, 10778, 11035, 11292, 11549),
    3503: (21003, 11806, 12063, 12320, 12577, 12834, 13091, 13348, 13605, 13862, 14119),
}
"""Readings that the library reported, counts, by own number (sui) of the module, in the order of the channels' names from 0 on."""
PLACES = ((-12, -5.7), (-4, -5.7), (4, -5.7), (12, -5.7), (8, 0), (4, 5.7), (0, 11.3), (-4, 5.7), (-8, 0), (0, 0))
"""Places of a module's channels from name 1 on, mm. Source: calibration_files/old/hexagon_patch_zwick.json, module 3361."""
WRONG_CHECK_SUM = bytes.fromhex("43040203AA0300")
NUMBERED = bytes.fromhex("05430601031111 2222ED")
"""Messages that the library did not take: with a wrong check sum, and with a sequence number in front."""
PERIODS = {0.01: "3802000A28", 0.05: "3802003280", 0.1: "3802006425", 1.0: "380203E8B7"}
"""Messages of the library that set a period, given in s."""


def _frame(line: str) -> CanFrame:
    number, data = line[2:].split(" ", 1)
    return CanFrame(int(number, 16), bytes.fromhex(data), len(number) == 8)


LINES = [(line[0], _frame(line)) for line in DIALOGUE.strip().splitlines()]
SENT = [frame for side, frame in LINES if side == ">"]
"""Frames of the host program, in their order."""


def answers() -> list[tuple[CanFrame, list[CanFrame]]]:
    """Return each frame of the host program with the frames of the hub that follow it."""
    turns: list[tuple[CanFrame, list[CanFrame]]] = []
    for side, frame in LINES:
        if side == ">":
            turns.append((frame, []))
        else:
            turns[-1][1].append(frame)
    return turns
