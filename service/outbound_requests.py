"""The only requests that the service sends by itself: to configured hosts, at checked addresses.

A name is resolved once. Every address must be public, or in a configured network. The connection goes to exactly that
address, so that a second answer of the name server changes nothing. There are no redirects, proxies or cookies, and
only the head of the answer is read.
"""

from __future__ import annotations

import http.client
import ipaddress
import re
import socket
import ssl
import threading
from collections.abc import Iterable
from dataclasses import dataclass
from urllib.parse import urlsplit

from service.errors import RequestError

Address = ipaddress.IPv4Address | ipaddress.IPv6Address
Network = ipaddress.IPv4Network | ipaddress.IPv6Network
LONGEST_URL = 2000
PORTS = {"http": 80, "https": 443}
_URL = re.compile(r"(https?)://(\[[0-9a-fA-F:.]+\]|[A-Za-z0-9.-]+)(?::([0-9]{1,5}))?((?:[/?][!-~]*)?)")
_NAT64 = (ipaddress.ip_network("64:ff9b::/96"), ipaddress.ip_network("64:ff9b:1::/48"))


class BlockedError(Exception):
    """A target that must not be called; the text gives the reason."""


@dataclass(frozen=True)
class WebhookTarget:
    """Target of a webhook. host : lower case, an IPv6 address without brackets; path : with its query."""

    scheme: str
    host: str
    port: int
    path: str

    @property
    def origin(self) -> str:
        """Scheme, host and port: the part that may be logged and that the settings allow."""
        return f"{self.scheme}://{f'[{self.host}]' if ':' in self.host else self.host}:{self.port}"


def parse_target(url: str) -> WebhookTarget:
    """Read a URL of http or https; user names, fragments, spaces and control characters are refused.

    Raises
    ------
    RequestError
        Code 'bad_webhook_url'.

    >>> parse_target("https://MES.example.com/hook?x=1").origin
    'https://mes.example.com:443'
    """
    found = _URL.fullmatch(url) if len(url) <= LONGEST_URL else None
    port = int(found[3]) if found and found[3] else None
    if found is None or "#" in url or (port is not None and not 0 < port < 65536):
        raise RequestError("webhook_url is not a plain http or https URL", code="bad_webhook_url",
                           subjects=("webhook_url",), measured=ascii(url[:200]), limit=LONGEST_URL,
                           remedy="send scheme, host and path, without user name or fragment")
    path = found[4] if found[4].startswith("/") else f"/{found[4]}"
    return WebhookTarget(found[1], found[2].strip("[]").lower(), port or PORTS[found[1]], path)


def parse_origin(text: str) -> str:
    """An origin of the settings, in canonical form.

    Raises
    ------
    ValueError
        The text has a path, or is not an origin.

    >>> parse_origin("https://mes.example.com")
    'https://mes.example.com:443'
    """
    try:
        target = parse_target(text)
    except RequestError:
        raise ValueError(f"{ascii(text)} is not an origin such as https://mes.example.com") from None
    if urlsplit(text).path not in ("", "/") or "?" in text:
        raise ValueError(f"{ascii(text)} has a path; give only scheme, host and port")
    return target.origin


def check_allowed(target: WebhookTarget, origins: Iterable[str]) -> None:
    """Refuse a target that the settings do not allow.

    Raises
    ------
    RequestError
        Code 'webhook_not_allowed'. The error does not list the allowed origins, since they are internal.
    """
    if target.origin not in origins:
        raise RequestError(f"webhooks to {target.origin} are not allowed", code="webhook_not_allowed",
                           subjects=("webhook_url",), measured=target.origin,
                           remedy="ask the operator of the service to add it to ZONEMILL_WEBHOOK_ORIGINS")


def is_public(address: Address) -> bool:
    """Whether an address belongs to the public internet, also when it is embedded in another address.

    >>> is_public(ipaddress.ip_address("::ffff:127.0.0.1")), is_public(ipaddress.ip_address("9.9.9.9"))
    (False, True)
    """
    if isinstance(address, ipaddress.IPv6Address):
        if any(address in network for network in _NAT64):
            return False
        teredo = address.teredo or ()
        inner = [a for a in (address.ipv4_mapped, address.sixtofour, *teredo) if a is not None]
        if inner:
            return all(is_public(a) for a in inner)
        if address.is_site_local:
            return False
    return address.is_global and not (address.is_multicast or address.is_reserved or address.is_unspecified)


def resolve(target: WebhookTarget, networks: Iterable[Network]) -> list[str]:
    """Addresses of the host of a target, each checked; at most four.

    networks : non-public networks that are allowed

    Raises
    ------
    BlockedError
        The name has no address, or one that must not be called.
    """
    try:
        answers = socket.getaddrinfo(target.host, target.port, type=socket.SOCK_STREAM)
    except (OSError, UnicodeError):
        raise BlockedError("the host has no address") from None
    found = list(dict.fromkeys(str(a[4][0]) for a in answers))
    networks = list(networks)
    for text in found:
        address = ipaddress.ip_address(text.partition("%")[0])
        plain = getattr(address, "ipv4_mapped", None) or address
        if not is_public(address) and not any(plain in network for network in networks):
            raise BlockedError("the host has an address in a network that is not public")
    return found[:4]


class _Pinned(http.client.HTTPConnection):
    """A connection to one address; name and certificate are those of the host."""

    def __init__(self, target: WebhookTarget, address: str, timeout_s: float) -> None:
        super().__init__(target.host, target.port, timeout=timeout_s)
        self.target, self.address = target, address

    def connect(self) -> None:
        """Open it."""
        self.sock = socket.create_connection((self.address, self.target.port), self.timeout)

    def secure(self) -> None:
        """Negotiate TLS where the target requires it; ``cut`` can end that too, since it may take very long."""
        if self.target.scheme == "https":
            tls = ssl.create_default_context().wrap_socket(self.sock, server_hostname=self.target.host,
                                                           do_handshake_on_connect=False)
            self.sock = tls
            tls.do_handshake()

    def cut(self) -> None:
        """End it from another thread, at any point."""
        sock = self.sock
        if sock is not None:
            try:
                sock.shutdown(socket.SHUT_RDWR)
            except OSError:
                pass  # it has ended


def send(target: WebhookTarget, addresses: list[str], body: bytes, headers: dict[str, str], timeout_s: float) -> int:
    """POST a body to the first address that accepts a connection; returns the status of the answer.

    timeout_s : for connecting, and again for the rest of the exchange, of each address

    Raises
    ------
    OSError, http.client.HTTPException
        No connection, no answer in time, or an answer that is not HTTP.
    """
    failure: OSError = ConnectionError("no address")
    for address in addresses:
        connection = _Pinned(target, address, timeout_s)
        watch = threading.Timer(timeout_s, connection.cut)
        watch.daemon = True
        try:
            try:
                connection.connect()
                watch.start()
                connection.secure()
            except OSError as error:
                failure = error
                continue
            connection.request("POST", target.path, body, headers)
            return connection.getresponse().status
        finally:
            watch.cancel()
            connection.close()
    raise failure
