"""One session of a client: its identity by its certificate, its rights, and its link.

A link ends with the connection of its session. If a client connects again, it begins a new link, and resumes its run by
the run's number, as over Modbus. Every request is a sign of life.
"""

import logging
from collections.abc import Callable
from contextvars import ContextVar
from typing import Any

from asyncua import ua
from asyncua.common.utils import ServiceError
from asyncua.crypto.permission_rules import User, UserRole
from asyncua.server.internal_server import InternalServer
from asyncua.server.internal_session import InternalSession
from cryptography import x509
from cryptography.x509 import verification

from plc_bridge.config import Right, TlsConfig
from plc_bridge.modbus.tls import BadRoleError, rights_of, role_of
from plc_bridge.protocol.images import CommandImage
from plc_bridge.protocol.mailbox import Mailbox
from plc_bridge.protocol.messages import Diagnostics
from plc_bridge.protocol.peer_log import PeerLog

logger = logging.getLogger(__name__)

SESSION: ContextVar["CellSession"] = ContextVar("session")
"""Session of the method call under way."""
_READ_SERVICES = (
    *("read", "browse", "browse_next", "history_read", "translate_browsepaths_to_nodeids", "register_nodes"),
    *("create_subscription", "create_monitored_items", "modify_monitored_items", "delete_monitored_items"),
    *("set_monitoring_mode", "set_publishing_mode"),
)
"""Services that require the right to read and no other right."""


class UntrustedError(Exception):
    """A client is not admitted; `status` is the status code of the answer to the client."""

    def __init__(self, status: int, why: str) -> None:
        super().__init__(why)
        self.status = status


class Trust:
    """Decides on clients by the certificate of their secure channel.

    Args:
        tls: Authority, revoked certificates and roles; None if no client can identify itself.
        is_open: True if a client without a certificate may read.
    """

    def __init__(self, tls: TlsConfig | None, is_open: bool) -> None:
        self.tls, self.is_open = tls, is_open
        self._store: verification.Store | None = None
        self._revoked: x509.CertificateRevocationList | None = None
        if tls is not None:
            self._store = verification.Store(x509.load_pem_x509_certificates(tls.authority.read_bytes()))
            if tls.revoked is not None:
                self._revoked = x509.load_pem_x509_crl(tls.revoked.read_bytes())

    def identify(self, certificate: bytes | None, uri: str) -> tuple[str, frozenset[Right]]:
        """Return the role and the rights of a client.

        Args:
            certificate: The client's certificate, DER; None if its channel is not secured.
            uri: The client's application URI, which the certificate must name.

        Raises:
            UntrustedError: The client is not admitted.
        """
        if not certificate or self.tls is None or self._store is None:
            if self.is_open:
                return "", frozenset({"read"})
            raise UntrustedError(ua.StatusCodes.BadIdentityTokenRejected, "it shows no certificate")
        self._require_trusted(self._store, x509.load_der_x509_certificate(certificate), uri)
        try:
            role = role_of(certificate)
        except BadRoleError as error:
            raise UntrustedError(ua.StatusCodes.BadCertificateInvalid, str(error)) from error
        rights = rights_of(role, self.tls)
        if not rights:
            raise UntrustedError(ua.StatusCodes.BadUserAccessDenied, f"its role {role!r} has no rights")
        return role, rights

    def _require_trusted(self, store: verification.Store, found: x509.Certificate, uri: str) -> None:
        try:
            _VERIFIER.store(store).build_client_verifier().verify(found, [])
        except verification.VerificationError as error:
            raise UntrustedError(ua.StatusCodes.BadCertificateUntrusted, f"its certificate: {error}") from error
        if self._revoked is not None and self._revoked.get_revoked_certificate_by_serial_number(found.serial_number):
            raise UntrustedError(ua.StatusCodes.BadCertificateRevoked, "its certificate is revoked")
        if uri not in application_uris(found):
            raise UntrustedError(ua.StatusCodes.BadCertificateUriInvalid, f"its certificate does not name {uri!r}")


def _require_authority(
    _policy: verification.Policy, _certificate: x509.Certificate, constraints: x509.BasicConstraints
) -> None:
    if not constraints.ca:
        raise ValueError("not the certificate of an authority")


_VERIFIER = verification.PolicyBuilder().extension_policies(
    ca_policy=verification.ExtensionPolicy.permit_all().require_present(
        x509.BasicConstraints, verification.Criticality.AGNOSTIC, _require_authority
    ),
    ee_policy=verification.ExtensionPolicy.permit_all(),
)
"""Verifies the chain, its signatures and dates; it checks no host name, because an application's certificate has none."""


def application_uris(certificate: x509.Certificate) -> list[str]:
    """Return the application URIs that a certificate names."""
    try:
        names = certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    except x509.ExtensionNotFound:
        return []
    return names.get_values_for_type(x509.UniformResourceIdentifier)


class CellServer(InternalServer):  # type: ignore[misc]
    """The services of asyncua with sessions that have rights and a link."""

    def __init__(self, mailbox: Mailbox, trust: Trust, counts: Diagnostics) -> None:
        super().__init__(user_manager=_NoUsers())
        self.mailbox, self.trust, self.counts, self.log = mailbox, trust, counts, PeerLog(logger)
        self.supported_tokens = (ua.AnonymousIdentityToken,)
        self.max_connections = 32
        self.allow_remote_admin = False
        self.bind_condition_methods = True

    def create_session(self, name: Any, **_: object) -> InternalSession:
        """Return a session, which ends with its connection: asyncua moves only external sessions to a new connection."""
        return CellSession(self, self.aspace, self.subscription_service, name)

    def register_server(self, server: Any, conf: Any = None) -> None:
        """Refuse to list another server."""
        raise ServiceError(ua.StatusCodes.BadServiceUnsupported)


class _NoUsers:
    """Makes every client a user without administrator rights; `CellSession` decides on the rights."""

    def get_user(self, *_: object, **__: object) -> User:
        return User(role=UserRole.User)


class CellSession(InternalSession):  # type: ignore[misc]
    """One client on one connection."""

    iserver: CellServer
    name: Any
    link = ""
    """Name of its link; empty until the session is active."""
    rights: frozenset[Right] = frozenset()
    image = CommandImage()
    """Its command block."""
    is_numbered = False
    """True if the client has sent a sequence number."""
    _uri = ""

    @property
    def address(self) -> str:
        """Address of the client's host."""
        return str(self.name[0])

    async def create_session(self, params: ua.CreateSessionParameters, sockname: Any = None) -> Any:
        """Create the session, and keep the client's application URI for the check of its certificate."""
        self._uri = params.ClientDescription.ApplicationUri or ""
        return await super().create_session(params, sockname)

    def activate_session(
        self, params: ua.ActivateSessionParameters, peer_certificate: bytes | None
    ) -> ua.ActivateSessionResult:
        """Admit the client by the certificate of its channel, and begin its link."""
        server = self.iserver
        try:
            role, rights = server.trust.identify(peer_certificate, self._uri)
        except UntrustedError as error:
            server.counts.forbidden += 1
            server.log.warning(self.address, "OPC UA: %s refused: %s", self.address, error)
            raise ServiceError(error.status) from error
        result = super().activate_session(params, peer_certificate)
        if not self.link:
            host = f"{role}@{self.address}" if role else self.address
            self.link, self.rights = f"{host}:{self.name[1]}/ua", rights
            server.mailbox.opened(self.link, host)
            server.counts.accepted += 1
            server.counts.connections += 1
        return result

    async def close_session(self, delete_subs: bool = True) -> None:
        """End the session and its link."""
        await super().close_session(delete_subs)
        if self.link:
            self.iserver.mailbox.closed(self.link)
            self.iserver.counts.connections -= 1
            self.link, self.rights = "", frozenset()

    def touch(self) -> None:
        """Take a request as a sign of life."""
        super().touch()
        self.iserver.counts.requests += 1
        if self.link:
            self.iserver.mailbox.heard(self.link)

    def demand(self, *rights: Right) -> None:
        """Require at least one of `rights`.

        Raises:
            ServiceError: The client has none of them.
        """
        if self.rights.intersection(rights):
            return
        self.iserver.counts.unauthorised += 1
        self.iserver.log.warning(
            self.address, "OPC UA: %s refused: it may not %s", self.link or self.address, rights[0]
        )
        raise ServiceError(ua.StatusCodes.BadUserAccessDenied)

    async def call(self, params: list[ua.CallMethodRequest]) -> Any:
        """Call methods with this session as their `SESSION`."""
        self.demand("read", "command", "stop")
        SESSION.set(self)
        return await super().call(params)

    async def delete_subscriptions(self, ids: list[int]) -> Any:
        """Delete subscriptions of this session; asyncua would delete those of others too."""
        known = self.subscription_service.subscriptions
        return await super().delete_subscriptions(
            [each for each in ids if each not in known or known[each].session_id == self.session_id]
        )

    async def write(self, params: ua.WriteParameters) -> list[ua.StatusCode]:
        """Refuse every write: clients command by methods only."""
        return [ua.StatusCode(ua.StatusCodes.BadNotWritable)] * len(params.NodesToWrite)


def _guarded(service: Callable[..., Any]) -> Callable[..., Any]:
    async def guarded(self: CellSession, *args: Any, **named: Any) -> Any:
        self.demand("read")
        return await service(self, *args, **named)

    return guarded


for _name in _READ_SERVICES:
    setattr(CellSession, _name, _guarded(getattr(InternalSession, _name)))
