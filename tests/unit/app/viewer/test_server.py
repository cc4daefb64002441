"""Server of the player: paths, ranges, and foreign or malformed requests."""

import http.client
import json
import socket
import threading
from contextlib import contextmanager

import pytest

from meshreel.app.viewer.server import ViewerServer
from meshreel.codec.encoder import encode
from meshreel.errors import CorruptStreamError, InvalidInputError
from samples.meshes import quad_sheet, waving_grid
from samples.players import PAGE, opened_api


@contextmanager
def serving(api, **options):
    with ViewerServer(api, page=PAGE, **options) as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.01,))
        thread.start()
        try:
            yield server
        finally:
            server.shutdown()
            thread.join()


@pytest.fixture(scope="module")
def api():
    with opened_api(waving_grid(4)) as opened:
        yield opened


@pytest.fixture(scope="module")
def server(api):
    with serving(api) as running:
        yield running


def ask(server, path, method="GET", body=None, **headers):
    """Return status, headers and body of an answer."""
    connection = http.client.HTTPConnection("127.0.0.1", server.server_port, timeout=10)
    connection.request(method, path, body, headers)
    answer = connection.getresponse()
    result = answer.status, answer.headers, answer.read()
    connection.close()
    return result


def send(server, data, n_bytes=1 << 16):
    with socket.create_connection(("127.0.0.1", server.server_port), timeout=10) as client:
        client.sendall(data)
        client.shutdown(socket.SHUT_WR)
        received = b""
        while piece := client.recv(n_bytes):
            received += piece
    return received


def test_texture_is_served_in_ranges(tmp_path):
    (tmp_path / "skin.mp4").write_bytes(b"moving picture")
    opened = opened_api(quad_sheet(2), texture=tmp_path / "skin.mp4")
    with opened as textured, serving(textured) as running:
        facts = json.loads(ask(running, "/api/facts")[2])
        status, headers, body = ask(running, "/texture", Range="bytes=7-")
    assert facts["texture"] == {"url": "texture", "mediaType": "video/mp4"}
    assert (status, body, headers["Content-Type"]) == (206, b"picture", "video/mp4")
    assert headers["Content-Range"] == "bytes 7-13/14"


def test_no_texture_is_served_without_one(server):
    assert ask(server, "/texture")[0] == 404
    assert json.loads(ask(server, "/api/facts")[2])["texture"] is None


@pytest.mark.parametrize("path", ["/", "/index.html", "/?frame=3"])
def test_page_is_served_with_a_content_policy(server, path):
    status, headers, body = ask(server, path)
    assert (status, body.decode()) == (200, PAGE.served)
    assert headers["Content-Type"] == "text/html; charset=utf-8"
    assert "script-src 'self' 'wasm-unsafe-eval';" in headers["Content-Security-Policy"]


def test_script_is_served(server):
    status, headers, body = ask(server, "/player.js")
    assert (status, body.decode()) == (200, PAGE.script)
    assert headers["Content-Type"] == "text/javascript; charset=utf-8"


def test_paths_of_the_api_are_answered(server, api):
    status, headers, body = ask(server, "/api/facts")
    assert (status, headers["Content-Type"]) == (200, "application/json")
    assert json.loads(body) == api.facts()


SIZE = len(encode(waving_grid(4)))


@pytest.mark.parametrize(
    ("requested", "start", "stop"),
    [
        ("bytes=0-9", 0, 10),
        ("bytes=5-5", 5, 6),
        ("bytes=7-", 7, SIZE),
        ("bytes=-12", SIZE - 12, SIZE),
        (f"bytes=-{SIZE + 5}", 0, SIZE),
        (f"bytes=3-{SIZE + 100}", 3, SIZE),
    ],
)
def test_requested_range_of_the_stream_is_sent(server, requested, start, stop):
    status, headers, body = ask(server, "/stream.reel?x=1", Range=requested)
    assert (status, body) == (206, encode(waving_grid(4))[start:stop])
    assert headers["Content-Range"] == f"bytes {start}-{stop - 1}/{SIZE}"
    assert headers["ETag"] == server.version


@pytest.mark.parametrize("invalid", ["bytes=9-5", "bytes=-", "bytes=0-1,4-5", "lines=1-2", "x", ""])
def test_whole_stream_is_sent_when_the_range_is_invalid(server, invalid):
    status, headers, body = ask(server, "/stream.reel", Range=invalid)
    assert (status, body) == (200, encode(waving_grid(4)))
    assert headers["Accept-Ranges"] == "bytes"


def test_whole_stream_is_sent_when_if_range_names_another_version(server):
    headers = {"Range": "bytes=0-9", "If-Range": '"other"'}
    assert ask(server, "/stream.reel", **headers)[0] == 200
    assert ask(server, "/stream.reel", **{**headers, "If-Range": server.version})[0] == 206


@pytest.mark.parametrize("beyond", [f"bytes={SIZE}-", f"bytes={SIZE + 3}-{SIZE + 9}", "bytes=-0"])
def test_range_is_rejected_when_it_is_beyond_the_end(server, beyond):
    status, headers, body = ask(server, "/stream.reel", Range=beyond)
    assert (status, body) == (416, b"")
    assert headers["Content-Range"] == f"bytes */{SIZE}"


@pytest.mark.parametrize("path", ["/", "/api/facts", "/nothing"])
def test_answers_are_neither_cached_nor_shared_with_other_origins(server, path):
    headers = ask(server, path)[1]
    assert headers["Cache-Control"] == "no-store"
    assert headers["X-Content-Type-Options"] == "nosniff"
    assert headers["Cross-Origin-Resource-Policy"] == "same-origin"
    assert "Access-Control-Allow-Origin" not in headers


def test_head_sends_headers_only(server):
    status, headers, body = ask(server, "/stream.reel", "HEAD")
    assert (status, body) == (200, b"")
    assert int(headers["Content-Length"]) == len(ask(server, "/stream.reel")[2])


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "PATCH", "OPTIONS"])
def test_other_methods_are_rejected(server, method):
    status, headers, _ = ask(server, "/api/facts", method, body=b"x" * 100)
    assert (status, headers["Allow"]) == (405, "GET, HEAD")


@pytest.mark.parametrize(
    "path",
    [
        "/etc/passwd", "/../../../../etc/passwd", "/api/../../etc/passwd",
        "/%2e%2e/%2e%2e/etc/passwd", "/..%2f..%2fetc%2fpasswd", "/page/index.html", "//etc/passwd",
        "/api/original/1", "/favicon.ico", "/api/facts%00", "/index.html/",
        "http://127.0.0.1/api/facts", "/" + "a" * 5000,
    ],
)  # fmt: skip
def test_unknown_paths_are_not_found(server, path):
    status, headers, body = ask(server, path)
    assert (status, headers["Content-Type"]) == (404, "text/plain; charset=utf-8")
    assert b"root:" not in body


@pytest.mark.parametrize(
    "host", ["127.0.0.1", "localhost:8000", "LOCALHOST", "[::1]:80", "127.0.0.1:1"]
)
def test_requests_are_answered_when_the_host_is_local(server, host):
    assert ask(server, "/api/facts", Host=host)[0] == 200


@pytest.mark.parametrize(
    "host",
    [
        "evil.example", "127.0.0.1.evil.example", "localhost.evil.example:80", "10.0.0.1", "",
        "[::1", "evil.example@127.0.0.1.example", "0.0.0.0", "[::2]",
    ],
)  # fmt: skip
def test_requests_are_rejected_when_the_host_is_foreign(server, host):
    status, _, body = ask(server, "/api/facts", Host=host)
    assert (status, body[:40]) == (403, b"this player answers local requests only;")


def test_requests_are_rejected_when_they_have_no_host(server):
    assert send(server, b"GET /api/facts HTTP/1.0\r\n\r\n").startswith(b"HTTP/1.1 403 ")


@pytest.mark.parametrize(
    ("data", "status"),
    [
        (b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03\r\n\r\n", b"400"),
        (b"GET\r\n\r\n", b"400"),
        (b"GET / HTTP/9.9\r\n\r\n", b"505"),
        (b"GET / HTTP/x\r\n\r\n", b"400"),
        (b"BREW / HTTP/1.1\r\nHost: localhost\r\n\r\n", b"501"),
        (b"GET /" + b"a" * 70000 + b" HTTP/1.1\r\n\r\n", b"414"),
        (b"GET / HTTP/1.1\r\n" + b"A: b\r\n" * 300 + b"\r\n", b"431"),
        (b"GET / HTTP/1.1\r\nA: " + b"b" * 70000 + b"\r\n\r\n", b"431"),
    ],
)
def test_malformed_requests_get_an_error_status(server, data, status, capfd):
    received = send(server, data)
    assert status in received.split(b"\r\n")[0]
    assert b"<html" not in received.lower()
    assert ask(server, "/api/facts")[0] == 200
    assert capfd.readouterr() == ("", "")


def test_body_of_a_get_is_not_read_as_the_next_request(server):
    inner = b"GET /api/facts HTTP/1.1\r\nHost: localhost\r\n\r\n"
    outer = b"GET /nothing HTTP/1.1\r\nHost: localhost\r\nContent-Length: %d\r\n\r\n" % len(inner)
    assert send(server, outer + inner).count(b"HTTP/1.1 ") == 1


def test_several_requests_on_one_connection_are_answered(server):
    request = b"GET /api/facts HTTP/1.1\r\nHost: localhost\r\n\r\n"
    assert send(server, 3 * request).count(b"HTTP/1.1 200 OK") == 3


def test_nothing_is_printed_when_clients_close_the_connection(server, capfd):
    for data in (b"", b"GET / HT", b"GET /stream.reel HTTP/1.1\r\nHost: localhost\r\n\r\n" * 50):
        client = socket.create_connection(("127.0.0.1", server.server_port), timeout=10)
        # Closing resets the connection, so that writing to it fails.
        client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")
        client.sendall(data)
        client.close()
    assert ask(server, "/api/facts")[0] == 200
    assert capfd.readouterr() == ("", "")


def test_error_is_sent_when_the_original_cannot_be_read(server, monkeypatch):
    def damaged(data, path):
        raise CorruptStreamError("frame 0 is damaged")

    monkeypatch.setattr("meshreel.app.viewer.server.answer_of", damaged)
    status, _, body = ask(server, "/api/original/0")
    assert (status, json.loads(body)) == (500, {"error": "frame 0 is damaged"})


def test_two_servers_can_run_at_the_same_time(server):
    with opened_api(waving_grid(7)) as other, serving(other) as second:
        assert second.server_port != server.server_port
        assert ask(second, "/stream.reel")[2] == encode(waving_grid(7))
        assert ask(server, "/stream.reel")[2] == encode(waving_grid(4))


def test_error_names_the_port_when_it_is_in_use(server, api):
    with pytest.raises(InvalidInputError, match=f"port {server.server_port} is in use; choose"):
        ViewerServer(api, page=PAGE, port=server.server_port)
