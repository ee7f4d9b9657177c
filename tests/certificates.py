"""A certificate authority for tests: everything it signs lives for a day in a folder of its own."""

import datetime
import ssl
from ipaddress import ip_address
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec, rsa

from plc_bridge.config import TlsConfig
from plc_bridge.modbus.tls import ROLE_EXTENSION

DAY = datetime.timedelta(days=1)


def utf8(text: str) -> bytes:
    """Return a DER UTF8String shorter than 128 bytes."""
    data = text.encode()
    return bytes([0x0C, len(data)]) + data


class Authority:
    """Signs certificates; `certificate` is the path of its own."""

    def __init__(self, folder: Path, name: str = "authority", lifetime: datetime.timedelta = DAY) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._folder, self._key = folder, ec.generate_private_key(ec.SECP256R1())
        self._name = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, name)])
        builder = self._builder(self._name, self._key, lifetime)
        builder = builder.add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        self.certificate = folder / f"{name}.pem"
        self._write(self.certificate, builder.sign(self._key, hashes.SHA256()))

    def sign(self, name: str, *roles: bytes, lifetime: datetime.timedelta = DAY, uri: str = "") -> tuple[Path, Path]:
        """Return the paths of a certificate, with one role extension for each value given, and of its key.

        With an application URI it is one for OPC UA, whose keys are RSA.
        """
        key = rsa.generate_private_key(65537, 2048) if uri else ec.generate_private_key(ec.SECP256R1())
        builder = self._builder(x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, name)]), key, lifetime)
        names: list[x509.GeneralName] = [x509.IPAddress(ip_address("127.0.0.1"))]
        names += [x509.UniformResourceIdentifier(uri)] if uri else []
        builder = builder.add_extension(x509.SubjectAlternativeName(names), critical=False)
        for role in roles:
            builder = builder.add_extension(x509.UnrecognizedExtension(ROLE_EXTENSION, role), critical=False)
        certificate, key_path = self._folder / f"{name}.pem", self._folder / f"{name}.key"
        self._write(certificate, builder.sign(self._key, hashes.SHA256()))
        form = serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
        key_path.touch(mode=0o600)
        key_path.write_bytes(key.private_bytes(serialization.Encoding.PEM, *form))
        return certificate, key_path

    def cell(self, uri: str = "", lifetime: datetime.timedelta = DAY, **settings: object) -> TlsConfig:
        """Return the settings of a cell on a free port whose certificate this authority has signed."""
        certificate, key = self.sign("cell", uri=uri, lifetime=lifetime)
        files = {"certificate": certificate, "key": key, "authority": self.certificate}
        return TlsConfig.model_validate({"port": 0, **files, **settings})

    def revoke(self, *certificates: Path) -> Path:
        """Return the path of a list of revoked certificates."""
        now = datetime.datetime.now(datetime.UTC)
        builder = x509.CertificateRevocationListBuilder(self._name, now - DAY, now + DAY)
        for path in certificates:
            number = x509.load_pem_x509_certificate(path.read_bytes()).serial_number
            revoked = x509.RevokedCertificateBuilder().serial_number(number).revocation_date(now - DAY).build()
            builder = builder.add_revoked_certificate(revoked)
        path = self._folder / "revoked.pem"
        path.write_bytes(builder.sign(self._key, hashes.SHA256()).public_bytes(serialization.Encoding.PEM))
        return path

    def client(self, *files: Path) -> ssl.SSLContext:
        """Return the context of a client that trusts this authority and shows `files`, certificate and key."""
        context = ssl.create_default_context(cafile=str(self.certificate))
        if files:
            context.load_cert_chain(*files)
        return context

    def _builder(
        self, name: x509.Name, key: ec.EllipticCurvePrivateKey | rsa.RSAPrivateKey, lifetime: datetime.timedelta
    ) -> x509.CertificateBuilder:
        now = datetime.datetime.now(datetime.UTC)
        builder = x509.CertificateBuilder(self._name, name, key.public_key(), x509.random_serial_number())
        return builder.not_valid_before(now - 2 * DAY).not_valid_after(now + lifetime)

    def _write(self, path: Path, certificate: x509.Certificate) -> None:
        path.write_bytes(certificate.public_bytes(serialization.Encoding.PEM))
