"""HTTP server of a player: read-only, for this machine only."""

import errno
import json
import re
import secrets
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from socketserver import TCPServer
from typing import Any
from urllib.parse import urlsplit

from meshreel.app.viewer.page import POLICY, SCRIPT_NAME, Page, built_page, json_text
from meshreel.app.viewer.player_data import TEXTURE, PlayerData
from meshreel.errors import InvalidInputError, MeshReelError

HOST = "127.0.0.1"
LOCAL_NAMES = {HOST, "localhost", "::1"}
CLIENT_TIMEOUT_S = 30.0
"""Time without data after which a connection is closed."""

STREAM = "stream.reel"
"""Path of the stream that the page plays."""

BINARY = "application/octet-stream"
HTML = "text/html; charset=utf-8"
JSON = "application/json"
SCRIPT = "text/javascript; charset=utf-8"
TEXT = "text/plain; charset=utf-8"
Reader = Callable[[int, int], bytes]
"""Returns the bytes of a range of a file."""

FORBIDDEN = "this player answers local requests only; start it on the machine of your browser"


@dataclass(frozen=True)
class Answer:
    """Content type and body of a response."""

    content_type: str
    body: bytes


class ViewerServer(ThreadingHTTPServer):
    """A server that listens when constructed, and answers in `serve_forever`.

    Parameters
    ----------
    port : int, default 0
        0 selects a free port.
    page : Page, optional
        Default: the player of the package.

    Raises
    ------
    InvalidInputError
        If it cannot listen on the port, or the page is not built.
    """

    daemon_threads = True
    allow_reuse_address: bool = sys.platform != "win32"  # Windows would share a port in use

    def __init__(self, data: PlayerData, *, port: int = 0, page: Page | None = None) -> None:
        player = built_page() if page is None else page
        self.data = data
        self.page: Answer = Answer(HTML, player.served.encode())
        self.script: Answer = Answer(SCRIPT, player.script.encode())
        self.version: str = f'"{secrets.token_hex(8)}"'
        self._is_closed = False
        try:
            super().__init__((HOST, port), _Handler)
        except (OSError, OverflowError) as error:
            if isinstance(error, OSError) and error.errno == errno.EADDRINUSE:
                raise InvalidInputError(
                    f"port {port} is in use; choose another, or 0 for a free one"
                ) from None
            reason = error.strerror if isinstance(error, OSError) else error
            raise InvalidInputError(f"the player cannot listen on port {port}: {reason}") from None

    def server_bind(self) -> None:
        """Bind without resolving the host name, as the base class would."""
        TCPServer.server_bind(self)
        self.server_name, self.server_port = HOST, self.server_address[1]

    @property
    def url(self) -> str:
        """URL of the player."""
        return f"http://{HOST}:{self.server_port}/"

    def server_close(self) -> None:
        """Stop listening; pending answers are dropped."""
        self._is_closed = True
        super().server_close()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Report errors, except of closed connections and of pending answers after closing."""
        is_disconnected = isinstance(sys.exception(), ConnectionError | TimeoutError)
        if not (is_disconnected or self._is_closed):
            super().handle_error(request, client_address)


class _Handler(BaseHTTPRequestHandler):
    """Answers the requests of one connection."""

    server: ViewerServer
    protocol_version = "HTTP/1.1"
    server_version, sys_version = "meshreel", ""
    timeout = CLIENT_TIMEOUT_S
    disable_nagle_algorithm = True  # else a body waits until the client confirms the header
    error_content_type = TEXT
    error_message_format = "%(code)d: %(message)s\n"

    def do_GET(self) -> None:
        if self.headers.get("Content-Length") or self.headers.get("Transfer-Encoding"):
            self.close_connection = True  # the body is not read
        if not _is_local(self.headers.get("Host")):
            self._send(HTTPStatus.FORBIDDEN, Answer(TEXT, FORBIDDEN.encode()))
            return
        path = self.path.partition("?")[0]
        if path in ("/", "/index.html"):
            policy = {"Content-Security-Policy": POLICY}
            self._send(HTTPStatus.OK, self.server.page, policy)
        elif path == f"/{STREAM}":
            file = self.server.data.file
            self._send_ranged(file.stored, file.size_bytes, BINARY)
        elif path == f"/{TEXTURE}" and (texture := self.server.data.texture):
            self._send_ranged(texture.read, texture.size_bytes, texture.media_type)
        elif path == f"/{SCRIPT_NAME}":
            self._send(HTTPStatus.OK, self.server.script)
        else:
            try:
                answer = answer_of(self.server.data, path.removeprefix("/"))
            except (MeshReelError, OSError, MemoryError) as error:
                body = json.dumps({"error": str(error) or "not enough memory"}).encode()
                self._send(HTTPStatus.INTERNAL_SERVER_ERROR, Answer(JSON, body))
            else:
                status = HTTPStatus.OK if answer else HTTPStatus.NOT_FOUND
                self._send(status, answer or Answer(TEXT, b"not found"))

    do_HEAD = do_GET  # noqa: N815

    def _refuse(self) -> None:
        self.close_connection = True  # the body is not read
        answer = Answer(TEXT, b"only GET and HEAD are allowed")
        self._send(HTTPStatus.METHOD_NOT_ALLOWED, answer, {"Allow": "GET, HEAD"})

    do_POST = do_PUT = do_DELETE = do_PATCH = do_OPTIONS = _refuse  # noqa: N815

    def _send_ranged(self, read: Reader, size: int, content_type: str) -> None:
        """Send a file, or the requested range of it."""
        validators = {"ETag": self.server.version, "Accept-Ranges": "bytes"}
        requested = self._requested_range(size)
        if requested is None:
            answer = Answer(content_type, read(0, size))
            self._send(HTTPStatus.OK, answer, validators)
        elif not requested:
            headers = {"Content-Range": f"bytes */{size}", **validators}
            self._send(HTTPStatus.REQUESTED_RANGE_NOT_SATISFIABLE, Answer(TEXT, b""), headers)
        else:
            answer = Answer(content_type, read(requested.start, requested.stop))
            part = f"bytes {requested.start}-{requested.stop - 1}/{size}"
            self._send(HTTPStatus.PARTIAL_CONTENT, answer, {"Content-Range": part, **validators})

    def _requested_range(self, size: int) -> range | None:
        """The requested bytes; None for all, also if the Range header is invalid."""
        match = re.fullmatch(r"bytes=([0-9]{0,18})-([0-9]{0,18})", self.headers.get("Range", ""))
        if_range = self.headers.get("If-Range", self.server.version)
        if not match or match[0] == "bytes=-" or if_range != self.server.version:
            return None
        first, last = match.groups()
        if not first:
            return range(max(0, size - int(last)), size)
        stop = min(size, int(last) + 1) if last else size
        if last and int(last) < int(first):
            return None
        return range(int(first), stop)

    def _send(
        self, status: HTTPStatus, answer: Answer, extra_headers: Mapping[str, str] | None = None
    ) -> None:
        self.send_response(status)
        headers = {
            "Content-Type": answer.content_type,
            "Content-Length": str(len(answer.body)),
            **(extra_headers or {}),
        }
        for name, value in headers.items():
            self.send_header(name, value)
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(answer.body)

    def end_headers(self) -> None:
        """Add the headers of all answers, and end the header section."""
        self.send_header("Cache-Control", "no-store")
        self.send_header("X-Content-Type-Options", "nosniff")
        self.send_header("Cross-Origin-Resource-Policy", "same-origin")
        self.send_header("Referrer-Policy", "no-referrer")
        super().end_headers()

    def log_message(self, format: str, *args: Any) -> None:
        """Log no requests."""


def answer_of(data: PlayerData, path: str) -> Answer | None:
    """The response to a path such as "api/facts"; None if the path is unknown.

    Raises
    ------
    MeshReelError, OSError
        If a frame cannot be read.
    """
    if path == "api/facts":
        return Answer(JSON, json_text(data.facts()).encode())
    if path == "api/plots" and data.measuring:
        return Answer(JSON, json_text(data.plots()).encode())
    match = re.fullmatch(r"api/(original|original_track/([0-9]{1,4}))/([0-9]{1,9})", path)
    if not match or data.comparison is None or int(match[3]) >= data.reel.n_frames:
        return None
    frame = int(match[3])
    if match[2] is None:
        return Answer(BINARY, data.original(frame))
    number, tracks = int(match[2]), data.tracks
    if tracks is None or number >= len(tracks.names):
        return None
    return Answer(BINARY, tracks.original_values(tracks.names[number], frame).tobytes())


def _is_local(host: str | None) -> bool:
    """Whether a Host header names this machine.

    A foreign page could let its host name resolve to this machine (DNS rebinding) to read the
    model; its requests carry that name.
    """
    try:
        return urlsplit(f"//{host}").hostname in LOCAL_NAMES
    except ValueError:
        return False
