"""Local web servers; one counts range requests, and can simulate failures."""

import gzip
import re
import threading
import time
from contextlib import contextmanager, suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path


class QuietHandler(BaseHTTPRequestHandler):
    """A handler that logs nothing."""

    def log_message(self, *_):
        pass

    def posted(self):
        """Return the data of a POST request, and answer it."""
        data = self.rfile.read(int(self.headers["Content-Length"]))
        self.send_response(204)
        self.end_headers()
        return data


@contextmanager
def local_server(handler):
    """Serve by a handler on a free port of this machine; return the address."""
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True)
        thread.start()
        try:
            yield f"http://127.0.0.1:{server.server_port}"
        finally:
            server.shutdown()
            thread.join()


class WebServer:
    """Files of a folder, served at `address`.

    `requests` lists method, path and range (or None) of each request; `sent_bytes` counts the bytes
    of all answers. `faults` selects failures: "no ranges" ignores ranges, "no length" omits sizes,
    "cut" truncates answers to GET, "short" answers with half of the range, "refuse" requires
    credentials. "gzip" encodes answers, "endless" adds zeros to them up to 64 MB, "drip" sends few
    bytes slowly, "understated" announces half of the size, "from 0" answers with the beginning of
    the file, "other file" and "no place" name another size and no range.
    `encodings` are those that clients accept.
    """

    def __init__(self, folder):
        self.folder, self.requests, self.sent_bytes, self.faults = Path(folder), [], 0, set()
        self.address = ""
        self.encodings = set()

    def answer(self, handler, *, with_body):
        requested = handler.headers.get("Range")
        self.requests.append((handler.command, handler.path, requested))
        self.encodings.add(handler.headers.get("Accept-Encoding"))
        path = self.folder / handler.path.split("?")[0].lstrip("/")
        if "refuse" in self.faults or not path.is_file():
            handler.send_response(403 if "refuse" in self.faults else 404)
            handler.send_header("Content-Length", "0")
            handler.end_headers()
            return
        data = path.read_bytes()
        if requested and "no ranges" not in self.faults:
            first, last = map(int, re.fullmatch(r"bytes=(\d+)-(\d+)", requested).groups())
            if "from 0" in self.faults:
                first, last = 0, last - first
            last = min(last, len(data) - 1)
            handler.send_response(206)
            if "no place" not in self.faults:
                size = 1_000_000 if "other file" in self.faults else len(data)
                handler.send_header("Content-Range", f"bytes {first}-{last}/{size}")
            data = data[first : last + 1]
            if "short" in self.faults:
                data = data[: len(data) // 2]
        else:
            handler.send_response(200)
        if "no ranges" not in self.faults:
            handler.send_header("Accept-Ranges", "bytes")
        if "gzip" in self.faults and with_body:
            data = gzip.compress(data)
            handler.send_header("Content-Encoding", "gzip")
        if "no length" in self.faults or ("endless" in self.faults and with_body):
            handler.send_header("Connection", "close")
        else:
            announced = len(data) // 2 if "understated" in self.faults else len(data)
            handler.send_header("Content-Length", str(announced))
        handler.end_headers()
        if not with_body:
            return
        if "cut" in self.faults:
            data = data[: len(data) // 2]
            handler.close_connection = True
        self.sent_bytes += len(data)  # before the client continues
        with suppress(ConnectionError):  # the client has enough
            for number in range(200 if "drip" in self.faults else 0):
                handler.wfile.write(data[number : number + 1])
                time.sleep(0.02)
            handler.wfile.write(data)
            for _ in range(64 if "endless" in self.faults else 0):
                handler.close_connection = True
                handler.wfile.write(bytes(1_000_000))
                self.sent_bytes += 1_000_000

    def ranges(self):
        """Return the requested ranges, as pairs of the first byte and the byte after the last."""
        results = [re.fullmatch(r"bytes=(\d+)-(\d+)", one) for _, _, one in self.requests if one]
        return [(int(result[1]), int(result[2]) + 1) for result in results]

    def forget(self):
        self.requests.clear()
        self.sent_bytes = 0


@contextmanager
def web_server(folder):
    server = WebServer(folder)

    class Handler(QuietHandler):
        protocol_version = "HTTP/1.1"
        disable_nagle_algorithm = True  # else each body waits 40 ms for the header's receipt

        def do_HEAD(self):
            server.answer(self, with_body=False)

        def do_GET(self):
            server.answer(self, with_body=True)

    with local_server(Handler) as server.address:
        yield server
