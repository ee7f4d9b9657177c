"""The supervisor's report on peg, hole, force, scans and states, read back by a Modbus client and by an SDO client."""

import struct
from dataclasses import replace

import numpy as np
import pytest

from cell.run.states import State
from drivers.errors import ArmReflexError, FaultCode
from drivers.quantities import Pose
from drivers.transport.wires import CanFrame
from plc_bridge.canopen.node import CanopenNode
from plc_bridge.protocol.images import PACKML, REPORT
from plc_bridge.protocol.messages import Control, PartEvidence, PartPlace
from plc_bridge.protocol.registers import table
from tests.canopen_rig import CONFIG, NODE
from tests.fakes import HAND_DOWN, Rig
from tests.plc_wire import Wire

GRASP, INSERT_SKILL, RECOVER = 101, 103, 106
REGISTERS = {register.name: register for register in table()}


class Buses:
    """One cell of fakes, read over a Modbus socket and by SDO."""

    def __init__(self, rig, wire):
        self.rig, self._wire, self._sent = rig, wire, []
        self._node = CanopenNode(CONFIG, table(), rig.bridge, lambda frame: self._sent.append(frame))
        self._node.boot()

    def read(self, name):
        """Return a register's value, which must be the same on both buses."""
        by_modbus, by_can = self._by_modbus(name), self._by_can(name)
        assert by_modbus == by_can, name
        return by_modbus

    def _by_modbus(self, name):
        block = PACKML if name.startswith("packml_") else REPORT
        (answer,) = self._wire.ask(struct.pack(">BHH", 4, block.start, block.words))
        return block.unpack(struct.unpack(f">{block.words}H", answer[2:]))[name]

    def _by_can(self, name):
        register = REGISTERS[name]
        request = bytes([0x40]) + register.index.to_bytes(2, "little") + bytes([register.subindex]) + bytes(4)
        self._sent.clear()
        self._node.receive(CanFrame(0x600 + NODE, request), self.rig.clock.now())
        (data,) = [frame.data for frame in self._sent if frame.id == 0x580 + NODE]
        raw = int.from_bytes(data[4 : 4 + 2 * register.words], "little", signed=register.type.startswith("i"))
        return raw if register.scale == 1.0 else raw * register.scale


@pytest.fixture
def buses(loaded, tmp_path):
    plc = loaded.cell.plc
    free = plc.model_copy(update={"modbus": plc.modbus.model_copy(update={"port": 0})})
    rig = Rig(replace(loaded, cell=loaded.cell.model_copy(update={"plc": free})), tmp_path)
    rig.bridge.start()
    wire = Wire(rig.bridge.address)
    yield Buses(rig, wire)
    wire.close()
    rig.bridge.close()
    rig.journal.close()


def hold_in_hole(rig, depth):
    """Let the hand hold an upright peg with its end so deep in the middle of the hole's area, m."""
    hole, length = np.array(rig.loaded.cell.hole.centre), rig.loaded.cell.peg.length
    rig.gripper.grip(30.0)
    rig.arm.tcp = Pose(hole + np.array([0.003, -0.002, length - depth]), HAND_DOWN)


def test_the_place_of_the_peg_its_depth_and_their_evidence(buses):
    rig, bit = buses.rig, PartEvidence
    rig.scan()
    assert buses.read("report_part_evidence") == bit.HAND_EMPTY | bit.SKIN_FREE | bit.SWITCH_OPEN
    hold_in_hole(rig, 0.0123)
    rig.scan(12)  # until the next frame of the skin
    held = bit.HAND_HOLDS | bit.SKIN_TOUCHED | bit.TIP_IN_HOLE | bit.SWITCH_OPEN
    assert buses.read("report_part_evidence") == held
    assert buses.read("report_part_width") == pytest.approx(rig.loaded.cell.peg.part.thickness)
    assert buses.read("report_part_depth") == pytest.approx(0.0123, abs=1e-6)
    rig.command(Control.CLEARED)  # said in error: the hand still holds it
    assert (buses.read("report_part"), buses.read("report_part_evidence")) == (PartPlace.IN_HOLE, held)
    rig.gripper.has_peg = False
    rig.gripper.release(0.04)
    rig.scan()
    rig.command(Control.CLEARED)
    assert (buses.read("report_part"), buses.read("report_part_evidence")) == (PartPlace.RACK, bit.PERSON)


def test_the_place_of_the_hole_and_the_largest_force_of_the_run(buses):
    rig = buses.rig
    hold_in_hole(rig, 0.010)
    rig.at(0.1, lambda: rig.arm.force.__setitem__(2, 23.45))
    rig.at(0.3, lambda: rig.arm.force.__setitem__(2, 0.0))
    rig.at(0.5, rig.plc.stop)
    rig.command(RECOVER)
    centre = rig.loaded.cell.hole.centre
    assert buses.read("report_hole_x") == pytest.approx(centre[0] + 0.003, abs=5e-4)
    assert buses.read("report_hole_y") == pytest.approx(centre[1] - 0.002, abs=5e-4)
    assert buses.read("report_peak_force") == pytest.approx(23.45)


def test_states_reasons_and_counts_of_pack_tags(buses):
    rig = buses.rig
    rig.scan(10)
    assert (buses.read("packml_unit_mode"), buses.read("packml_state")) == (1, State.IDLE)
    rig.gripper.has_peg = False
    rig.command(100)  # an empty slot: an insertion that fails
    assert (buses.read("packml_processed"), buses.read("packml_defective")) == (1, 1)
    assert buses.read("packml_cntrl_cmd") == Control.START
    assert buses.read(f"packml_state_time_{State.EXECUTE.value}") >= 3
    rig.arm.fault = ArmReflexError("arm: reflex")
    rig.scan()
    assert (buses.read("packml_state"), buses.read("packml_stop_reason")) == (State.ABORTED, FaultCode.ARM_REFLEX)
    rig.command(Control.RESET)
    assert (buses.read("packml_state"), buses.read("packml_cntrl_cmd")) == (State.IDLE, Control.RESET)
    rig.command(Control.CLEARED)
    assert buses.read("packml_cntrl_cmd") == Control.RESET  # no control of PackML
