"""The OPC UA server: one thread with one asyncio loop serves all its sockets."""

import asyncio
import errno
import logging
import threading
from collections.abc import Sequence

from asyncua import Server, ua
from asyncua.common.connection import TransportLimits
from cryptography import x509
from cryptography.hazmat.primitives.asymmetric import rsa
from cryptography.hazmat.primitives.serialization import load_pem_private_key

from drivers.errors import ConfigError, DeviceNotOpenedError
from plc_bridge.config import PlcConfig, TlsConfig
from plc_bridge.modbus.tls import server_context
from plc_bridge.opcua.commands import Commands
from plc_bridge.opcua.session import CellServer, Trust, application_uris
from plc_bridge.opcua.unit import Unit
from plc_bridge.protocol.images import PACKML, REPORT
from plc_bridge.protocol.mailbox import Mailbox
from plc_bridge.protocol.messages import Diagnostics
from plc_bridge.protocol.registers import DEVICE_NAME, Parameter, Register

logger = logging.getLogger(__name__)

SPECTATOR = "opcua"
"""Link of the server itself; it never writes, and therefore reads the run of any link."""
LIMITS = TransportLimits(max_recv_buffer=65535, max_send_buffer=65535, max_chunk_count=17, max_message_size=1 << 20)


class OpcUaServer:
    """Serves the cell as a PackML unit; `start` and `close` may be called from any thread.

    Args:
        address: Host and port of the listening socket.
        plc: Keys and roles, and the permission to read for clients without a certificate.
        mailbox: The bridge.
        registers: The register map.
        parameters: Meaning of the numbered parameters.

    Raises:
        DeviceNotOpenedError: A certificate or key cannot be used.
        ConfigError: No client could connect, because the config has neither [plc.tls] nor `opcua_anonymous`.
    """

    def __init__(
        self,
        address: tuple[str, int],
        plc: PlcConfig,
        mailbox: Mailbox,
        registers: Sequence[Register],
        parameters: Sequence[Parameter],
    ) -> None:
        if plc.tls is None and not plc.opcua_anonymous:
            raise ConfigError("--opcua: no client could connect: add [plc.tls], or set plc.opcua_anonymous = true")
        # asyncua logs without a bound; the cell logs a bounded number of lines for each host instead.
        logging.getLogger("asyncua").setLevel(logging.CRITICAL)
        self.counts = Diagnostics()
        self._address, self._mailbox = address, mailbox
        uri = _application_uri(plc.tls) if plc.tls is not None else "urn:tactile-insertion-cell"
        self._services = CellServer(mailbox, Trust(plc.tls, plc.opcua_anonymous), self.counts)
        self._server = Server(iserver=self._services)
        self._unit = Unit(self._server, registers)
        self._commands = Commands(mailbox, self._unit, registers, parameters)
        # Building the standard address space takes seconds: the constructor does it, before anything moves.
        self._loop = asyncio.new_event_loop()
        try:
            self._loop.run_until_complete(self._build(uri, plc))
        except BaseException:  # the loop is of no use without its server
            self._loop.close()
            raise
        self._stop: asyncio.Event
        self._thread: threading.Thread | None = None

    @property
    def address(self) -> tuple[str, int]:
        """Host and port that clients reach; the configured ones while the server is closed."""
        listening = self._server.bserver
        return self._address if listening is None else (listening.hostname, listening.port)

    def start(self) -> None:
        """Listen, then serve in a separate thread.

        Raises:
            DeviceNotOpenedError: The port is in use, or the address is not this computer's.
        """
        try:
            self._loop.run_until_complete(self._server.start())
        except OSError as error:
            host, port = self._address
            why = "in use by another program" if error.errno == errno.EADDRINUSE else error.strerror or str(error)
            raise DeviceNotOpenedError(
                f"OPC UA server: {host} port {port} is {why}: state another --opcua HOST:PORT"
            ) from error
        self._mailbox.opened(SPECTATOR, SPECTATOR)
        self._stop = asyncio.Event()
        self._thread = threading.Thread(
            target=self._loop.run_until_complete, args=(self._show(),), name="opcua", daemon=True
        )
        self._thread.start()
        logger.info("--opcua: listening on %s port %d", *self.address)

    def close(self) -> None:
        """Close every connection and wait for the thread to end; may be called again."""
        if self._thread is not None:
            self._loop.call_soon_threadsafe(self._stop.set)
            self._thread.join()
            self._mailbox.closed(SPECTATOR)
            self._thread = None
        if not self._loop.is_closed():
            self._loop.close()

    async def _build(self, uri: str, plc: PlcConfig) -> None:
        server, policies = self._server, []
        await server.init()
        await server.set_application_uri(uri)
        server.set_endpoint(f"opc.tcp://{self._address[0]}:{self._address[1]}/")
        server.set_server_name(DEVICE_NAME)
        server.application_type, server.limits = ua.ApplicationType.Server, LIMITS
        if plc.tls is not None:
            await server.load_certificate(plc.tls.certificate, "pem")
            await server.load_private_key(plc.tls.key, format="pem")
            policies.append(ua.SecurityPolicyType.Basic256Sha256_SignAndEncrypt)
        if plc.opcua_anonymous:
            policies.append(ua.SecurityPolicyType.NoSecurity)
        server.set_security_policy(policies)
        await self._unit.build()
        await self._commands.bind(self._services.isession.add_method_callback)

    async def _show(self) -> None:
        """Show values and send events until the server is closed."""
        before: tuple[object, ...] = ()
        while not self._stop.is_set():
            report = REPORT.unpack(self._mailbox.report_words(SPECTATOR))
            del report["report_life"], report["report_life_tail"]
            seen = report, PACKML.unpack(self._mailbox.packml_words()), self._mailbox.obstacle
            if seen != before:
                await self._unit.update(*seen)
                before = seen
            for order in self._mailbox.ended():
                await self._unit.end(order)
            try:
                # Period at which values are compared and changes shown, s.
                await asyncio.wait_for(self._stop.wait(), 0.1)
            except TimeoutError:
                continue
        await self._server.stop()


def _application_uri(tls: TlsConfig) -> str:
    """Return the application URI of the cell's certificate."""
    # Lengths of an RSA key that Basic256Sha256 permits. Source: OPC 10000-7, SecurityPolicy Basic256Sha256.
    key_bits = range(2048, 4097)
    server_context(tls)  # raises an error that names a file if it is missing, open to others or not PEM
    key = load_pem_private_key(tls.key.read_bytes(), None)
    if not isinstance(key, rsa.RSAPrivateKey) or key.key_size not in key_bits:
        raise DeviceNotOpenedError(
            f"plc.tls.key = {tls.key}: not an RSA key; OPC UA needs one of {key_bits[0]} to {key_bits[-1]} bits: see docs/opcua.md"
        )
    uris = application_uris(x509.load_pem_x509_certificate(tls.certificate.read_bytes()))
    if len(uris) != 1:
        raise DeviceNotOpenedError(
            f"plc.tls.certificate = {tls.certificate}: {len(uris)} application URIs; exactly one needed: see docs/opcua.md"
        )
    return uris[0]
