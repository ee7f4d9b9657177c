"""Modbus/TCP Security: the context of mutual TLS, and the role that a client's certificate names.

The standard's rules (MB-TCP-Security-v21): TLS 1.2 or later, and a certificate on both sides [R-02, R-34, R-44]. One
extension of the certificate holds exactly one role, a UTF8String [R-21, R-22, R-65]. A certificate without this
extension has the NULL role [R-23].
"""

import ssl
from datetime import datetime
from pathlib import Path

from cryptography import x509
from cryptography.hazmat import asn1

from drivers.errors import DeviceNotOpenedError
from plc_bridge.config import Right, TlsConfig

ROLE_EXTENSION = x509.ObjectIdentifier("1.3.6.1.4.1.50316.802.1")
NULL_ROLE = ""
LONGEST_ROLE = 64


class BadRoleError(Exception):
    """The certificate's role cannot be read, or cannot be written to a log."""


def role_of(certificate: bytes) -> str:
    """Return the role in a DER-encoded certificate, or `NULL_ROLE` if it names none.

    Raises:
        BadRoleError: There are several roles, or the role is not one printable UTF8String.
    """
    try:
        extensions = x509.load_der_x509_certificate(certificate).extensions
        value = extensions.get_extension_for_oid(ROLE_EXTENSION).value
        assert isinstance(value, x509.UnrecognizedExtension)
        role = asn1.decode_der(str, value.value)
    except x509.ExtensionNotFound:
        return NULL_ROLE
    except (ValueError, x509.DuplicateExtension) as error:
        raise BadRoleError(f"its role cannot be read: {error}") from error
    if not role.isprintable() or not 0 < len(role) <= LONGEST_ROLE:
        raise BadRoleError(f"its role is not 1 to {LONGEST_ROLE} printable characters: {role!r}")
    return role


def rights_of(role: str, config: TlsConfig) -> frozenset[Right]:
    """Return the rights of `role`; none if the table does not list it."""
    return frozenset(config.without_role if role == NULL_ROLE else config.roles.get(role, ()))


def server_context(config: TlsConfig) -> ssl.SSLContext:
    """Return a context that requires a certificate of `config.authority` from every client.

    Raises:
        DeviceNotOpenedError: A file is missing or invalid, or other users than its owner may read or write the key; the
            message names it.
    """
    context = browser_context(config)
    context.verify_mode = ssl.CERT_REQUIRED
    _trust(context, "authority", config.authority, "certificate")
    if config.revoked is not None:
        _trust(context, "revoked", config.revoked, "list of revoked certificates")
        context.verify_flags |= ssl.VerifyFlags.VERIFY_CRL_CHECK_LEAF
    return context


def browser_context(config: TlsConfig) -> ssl.SSLContext:
    """Return a context that presents the cell's certificate and requires none, for browsers.

    Raises:
        DeviceNotOpenedError: A file is missing or invalid, or other users than its owner may read or write the key; the
            message names it.
    """
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    context.options |= ssl.OP_NO_RENEGOTIATION
    for name, path in _files(config).items():
        _read(name, path)
    # Permissions of a file for other users than its owner.
    if (mode := config.key.stat().st_mode) & 0o077:
        raise DeviceNotOpenedError(
            f"plc.tls.key = {config.key}: mode {mode & 0o777:o}: open to others than its owner; 600 or 400 allowed, as by chmod 600"
        )
    try:
        context.load_cert_chain(config.certificate, config.key, password=_no_password)
    except (ssl.SSLError, ValueError) as error:
        pair = f"plc.tls.certificate = {config.certificate}, plc.tls.key = {config.key}"
        raise DeviceNotOpenedError(
            f"{pair}: not a PEM certificate and its own PEM key without a password ({error})"
        ) from error
    return context


def valid_until(config: TlsConfig) -> dict[str, datetime]:
    """Return the end of each file's validity, UTC, by its key in [plc.tls]; of several certificates the earliest end.

    Raises:
        DeviceNotOpenedError: A file is missing or invalid; the message names it.
    """
    ends: dict[str, datetime] = {}
    for name, path in _files(config).items():
        data = _read(name, path)
        try:
            if name == "revoked":
                end = x509.load_pem_x509_crl(data).next_update_utc
                ends |= {} if end is None else {name: end}
            elif name != "key":
                ends[name] = min(each.not_valid_after_utc for each in x509.load_pem_x509_certificates(data))
        except ValueError as error:
            raise DeviceNotOpenedError(f"plc.tls.{name} = {path}: not PEM ({error})") from error
    return ends


def _trust(context: ssl.SSLContext, name: str, path: Path, what: str) -> None:
    try:
        context.load_verify_locations(path)
    except ssl.SSLError as error:
        raise DeviceNotOpenedError(f"plc.tls.{name} = {path}: not a PEM {what} ({error})") from error


def _files(config: TlsConfig) -> dict[str, Path]:
    files = {"certificate": config.certificate, "key": config.key, "authority": config.authority}
    return files if config.revoked is None else {**files, "revoked": config.revoked}


def _read(name: str, path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise DeviceNotOpenedError(f"plc.tls.{name} = {path}: {error.strerror}") from error


def _no_password() -> str:
    raise ValueError("it asks for a password")
