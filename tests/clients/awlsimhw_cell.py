"""The cell as a peripheral of awlsim: inputs are the report, outputs the command block and two words for the test."""

import socket
import struct

from awlsim.common.exceptions import MaintenanceRequest
from awlsim.core.hardware import AbstractHardwareInterface
from awlsim.core.hardware_params import HwParamDesc_int, HwParamDesc_str

REPORT_WORDS, COMMAND_WORDS = 73, 41
"""Lengths of the blocks in map 2.0, which later ones have lengthened behind their ends."""
IMAGE_WORDS = 64
"""Of the simulated CPU's input image: the report does not fit, so its last word takes the place of the last one that does."""
TRIGGERED, DONE, IS_FINISHED = 2 * COMMAND_WORDS, 2 * COMMAND_WORDS + 2, 2 * COMMAND_WORDS + 4


class HardwareInterface(AbstractHardwareInterface):
    """Moves words between the process image and Modbus TCP, nothing else."""

    name = "cell"
    paramDescs = [HwParamDesc_str("host"), HwParamDesc_int("tcpPort")]

    def doStartup(self):
        where = self.getParamValueByName("host"), self.getParamValueByName("tcpPort")
        self._socket = socket.create_connection(where, timeout=10.0)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def doShutdown(self):
        self._socket.close()

    def readInputs(self):
        report = self._ask(struct.pack(">BHH", 4, 0, REPORT_WORDS))[2:]
        seen = report[: 2 * IMAGE_WORDS - 2] + report[-2:]
        self.sim.cpu.storeInputRange(self.inputAddressBase, bytearray(seen))

    def writeOutputs(self):
        image = bytes(self.sim.cpu.fetchOutputRange(self.outputAddressBase, IS_FINISHED + 1))
        command = image[: 2 * COMMAND_WORDS]
        self._ask(struct.pack(">BHHB", 16, 0, COMMAND_WORDS, len(command)) + command)
        if image[IS_FINISHED]:
            triggered, done = struct.unpack_from(">HH", image, TRIGGERED)
            print(f"triggered {triggered} done {done}", flush=True)
            raise MaintenanceRequest(MaintenanceRequest.TYPE_SHUTDOWN, "finished")

    def directReadInput(self, accessWidth, accessOffset):
        return bytearray()

    def directWriteOutput(self, accessWidth, accessOffset, data):
        return False

    def _ask(self, pdu):
        self._socket.sendall(struct.pack(">HHHB", 1, 0, len(pdu) + 1, 1) + pdu)
        length = struct.unpack(">HHH", self._receive(6))[2]
        response = self._receive(length)[1:]
        if response[0] != pdu[0]:
            self.raiseException(f"exception {response.hex()} to {pdu.hex()}")
        return response

    def _receive(self, size):
        data = b""
        while len(data) < size:
            more = self._socket.recv(size - len(data))
            if not more:
                self.raiseException("the cell closed the connection")
            data += more
        return data
