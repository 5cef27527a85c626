"""Where the service may send a request, and to which addresses."""

import ipaddress
import socket
import threading
import time

import pytest

from service.errors import RequestError
from service.outbound_requests import BlockedError, check_allowed, is_public, parse_origin, parse_target, resolve, send
from tests.time_limits import in_time

ORIGIN = "https://mes.example.com:443"


@pytest.mark.parametrize(("url", "origin", "path"), [
    ("https://mes.example.com", ORIGIN, "/"), ("https://MES.Example.com:443/a?b=c", ORIGIN, "/a?b=c"),
    ("https://mes.example.com?b=c", ORIGIN, "/?b=c"),
    ("http://[2001:DB8::1]:8080/x", "http://[2001:db8::1]:8080", "/x")])
def test_urls_that_are_read(url, origin, path):
    target = parse_target(url)
    assert (target.origin, target.path) == (origin, path)


@pytest.mark.parametrize("url", [
    "", "mes.example.com", "ftp://mes.example.com", "file:///etc/passwd", "https://", "https:///x", "//mes.example.com",
    "https://mes.example.com@evil.example", "https://user:pw@mes.example.com", "https://mes.example.com:0",
    "https://mes.example.com:99999", "https://mes.example.com\\@evil.example", "https://mes.example.com/a b",
    "https://mes.example.com/\r\nX: y", "https://mes.example.com\n", " https://mes.example.com", "https://mes.example.com/#x",
    "https://mës.example.com", "https://mes.example.com/é", "https://mes.example.com:" + "9" * 6, "gopher://x:70/_",
    "https://mes.example.com/" + "a" * 2000, "https://mes.example.com\t/x", "https://[::1/x"])
def test_urls_that_are_refused(url):
    with pytest.raises(RequestError) as caught:
        check_allowed(parse_target(url), {ORIGIN})
    assert caught.value.remedy and caught.value.code in ("bad_webhook_url", "webhook_not_allowed")


@pytest.mark.parametrize("url", [
    "https://mes.example.com", "https://mes.example.com/hook/x?y", "https://MES.EXAMPLE.COM:443/"])
def test_origins_that_are_allowed(url):
    check_allowed(parse_target(url), {ORIGIN})


@pytest.mark.parametrize("url", [
    "http://mes.example.com", "https://mes.example.com:8443", "https://mes.example.com.", "https://x.mes.example.com",
    "https://mes.example.com.evil.example", "https://2130706433", "https://127.0.0.1", "https://[::1]"])
def test_origins_that_are_not(url):
    with pytest.raises(RequestError) as caught:
        check_allowed(parse_target(url), {ORIGIN})
    assert caught.value.code == "webhook_not_allowed" and "mes.example.com:443" not in caught.value.remedy


@pytest.mark.parametrize("text", ["https://a.example/x", "a.example", "https://a.example/?x", "*", ""])
def test_settings_name_origins_only(text):
    with pytest.raises(ValueError):
        parse_origin(text)


@pytest.mark.parametrize("text", [
    "127.0.0.1", "127.1.2.3", "0.0.0.0", "10.0.0.1", "172.16.0.1", "192.168.1.1", "169.254.169.254", "100.64.0.1",
    "224.0.0.1", "255.255.255.255", "240.0.0.1", "192.0.2.1", "198.18.0.1", "::1", "::", "fe80::1", "fc00::1",
    "fd00::1", "ff02::1", "::ffff:127.0.0.1", "::ffff:10.0.0.1", "2002:7f00:1::", "2002:a00:1::1", "64:ff9b::7f00:1",
    "64:ff9b::a9fe:a9fe", "fec0::1", "2001:db8::1", "2001:0:7f00:1::"])
def test_addresses_that_are_not_public(text):
    assert not is_public(ipaddress.ip_address(text))


@pytest.mark.parametrize("text", ["9.9.9.9", "93.184.216.34", "2620:fe::fe", "::ffff:9.9.9.9", "2002:909:909::1"])
def test_addresses_that_are(text):
    assert is_public(ipaddress.ip_address(text))


def answering(monkeypatch, *addresses):
    asked = []

    def look_up(host, port, **_):
        asked.append(host)
        return [(socket.AF_INET6 if ":" in a else socket.AF_INET, socket.SOCK_STREAM, 6, "", (a, port))
                for a in addresses]

    monkeypatch.setattr(socket, "getaddrinfo", look_up)
    return asked


def test_one_bad_address_among_good_ones_blocks(monkeypatch):
    target = parse_target("https://mes.example.com")
    answering(monkeypatch, "9.9.9.9", "9.9.9.10")
    assert resolve(target, []) == ["9.9.9.9", "9.9.9.10"]
    for bad in ("10.0.0.1", "169.254.169.254", "::1", "fe80::1%eth0"):
        answering(monkeypatch, "9.9.9.9", bad)
        with pytest.raises(BlockedError):
            resolve(target, [])
    answering(monkeypatch, "10.1.0.5", "::ffff:10.1.0.6")
    assert resolve(target, [ipaddress.ip_network("10.1.0.0/16")])
    with pytest.raises(BlockedError):
        resolve(target, [ipaddress.ip_network("10.2.0.0/16")])


def test_a_name_without_an_address_blocks(monkeypatch):
    def none(*_, **__):
        raise socket.gaierror(-2, "Name or service not known")

    monkeypatch.setattr(socket, "getaddrinfo", none)
    with pytest.raises(BlockedError, match="no address"):
        resolve(parse_target("https://mes.example.com"), [])


@pytest.fixture
def listener():
    """A server that answers each connection with what it is given; gives back what it was sent."""
    opened = []

    def start(answer, slowly_s=0.0):
        server = socket.create_server(("127.0.0.1", 0))
        got = []

        def serve():
            with server, server.accept()[0] as connection:
                got.append(connection.recv(65536))
                try:
                    for byte in (answer[i:i + 1] for i in range(len(answer))) if slowly_s else (answer,):
                        connection.sendall(byte)
                        time.sleep(slowly_s)
                except OSError:
                    pass

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        opened.append(thread)
        return server.getsockname()[1], got

    return start


def test_the_connection_goes_to_the_address_that_was_looked_at(listener, monkeypatch):
    port, got = listener(b"HTTP/1.1 204 No Content\r\n\r\n")
    target = parse_target(f"http://mes.example.com:{port}/hook?x=1")
    monkeypatch.setattr(socket, "getaddrinfo", lambda *a, real=socket.getaddrinfo, **k: (
        pytest.fail("the name was asked for again") if a[0] == target.host else real(*a, **k)))
    assert send(target, ["127.0.0.1"], b"{}", {"X": "y"}, 2.0) == 204
    head = got[0].decode()
    assert head.startswith("POST /hook?x=1 HTTP/1.1\r\n") and f"Host: mes.example.com:{port}\r\n" in head
    assert head.endswith("\r\n\r\n{}") or "Content-Length: 2\r\n" in head


def test_a_redirect_is_not_followed(listener):
    port, _ = listener(b"HTTP/1.1 302 Found\r\nLocation: http://127.0.0.1:1/\r\nContent-Length: 0\r\n\r\n")
    assert send(parse_target(f"http://127.0.0.1:{port}"), ["127.0.0.1"], b"", {}, 2.0) == 302


def test_an_answer_that_drips_is_cut_off(listener):
    port, _ = listener(b"HTTP/1.1 200 OK\r\n" + b"X: y\r\n" * 1000, slowly_s=0.1)
    started = time.monotonic()
    with pytest.raises(Exception) as caught:  # whatever the connection makes of it
        send(parse_target(f"http://127.0.0.1:{port}"), ["127.0.0.1"], b"", {}, 0.6)
    assert in_time(time.monotonic() - started, 2.0) and not isinstance(caught.value, AssertionError)


def test_a_handshake_that_drips_is_cut_off(listener):
    hello = b"\x16\x03\x03\x40\x00" + b"\x02\x00\x3f\xfc" + b"\x03" * 60  # the start of a record of 16 kB
    port, _ = listener(hello, slowly_s=0.1)
    started = time.monotonic()
    with pytest.raises(OSError):
        send(parse_target(f"https://mes.example.com:{port}"), ["127.0.0.1"], b"", {}, 0.6)
    assert in_time(time.monotonic() - started, 3.0)


def test_no_more_than_the_head_of_an_answer_is_read(listener):
    port, _ = listener(b"HTTP/1.1 200 OK\r\nContent-Length: 1000000000\r\n\r\n" + b"x" * 100_000)
    assert send(parse_target(f"http://127.0.0.1:{port}"), ["127.0.0.1"], b"", {}, 2.0) == 200


def test_the_next_address_is_tried_when_one_takes_no_connection(listener):
    port, _ = listener(b"HTTP/1.1 200 OK\r\n\r\n")
    assert send(parse_target(f"http://x.example:{port}"), ["127.0.0.2", "127.0.0.1"], b"", {}, 2.0) == 200
