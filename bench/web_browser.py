"""Pages for measurements: script bundling, server and browser."""

import json
import re
import shutil
import subprocess
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

from playwright.sync_api import Browser, CDPSession, ConsoleMessage, Page, sync_playwright

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "npm"
PAGES = Path(__file__).parent / "web_pages"
DRACO = PACKAGE / "node_modules" / "three" / "examples" / "jsm" / "libs" / "draco"
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
DRAWN_BY_SOFTWARE = (
    "--headless=new",
    "--no-sandbox",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--js-flags=--expose-gc",
)
TYPES = {".js": "text/javascript", ".wasm": "application/wasm", ".html": "text/html"}


def bundled(script: str, folder: Path) -> bytes:
    """Bundle a script of `web_pages` with its imports; build the package first."""
    out = folder / script
    options = ["--bundle", "--format=esm", "--minify", "--log-level=error", f"--outfile={out}"]
    parts = {"meshreel/three": "three.js", "meshreel": "index.js"}
    options += [f"--alias:{name}={PACKAGE / 'dist' / file}" for name, file in parts.items()]
    options += [f"--alias:three={PACKAGE / 'node_modules' / 'three'}"]
    subprocess.run(
        [PACKAGE / "node_modules" / ".bin" / "esbuild", PAGES / script, *options], check=True
    )
    return out.read_bytes()


def page_files(script: bytes) -> dict[str, bytes]:
    """Files of the server: the page, its script and Draco's decoder."""
    head = b'<!doctype html><link rel=icon href="data:,"><style>body{margin:0}</style>'
    html = head + b'<body><script type=module src="/p.js">'
    decoder = {f"/draco/{path.name}": path.read_bytes() for path in DRACO.glob("draco_*")}
    return {"/index.html": html + b"</script>", "/p.js": script, **decoder}


@contextmanager
def served(files: dict[str, bytes]) -> Iterator[str]:
    """Serve bytes by path, with ranges and persistent connections; yield the address."""

    class Server(ThreadingHTTPServer):
        def handle_error(self, *given: Any) -> None:
            """Ignore errors: closing browsers drop connections."""

    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"
        disable_nagle_algorithm = True

        def do_GET(self) -> None:
            body = files.get(self.path)
            if body is None:
                return self.send_error(404)
            requested = re.fullmatch(r"bytes=(\d+)-(\d*)", self.headers.get("Range", ""))
            if requested:
                start, stop = int(requested[1]), min(int(requested[2] or len(body)) + 1, len(body))
                self.send_response(206)
                self.send_header("Content-Range", f"bytes {start}-{stop - 1}/{len(body)}")
                body = body[start:stop]
            else:
                self.send_response(200)
            self.send_header("Content-Length", str(len(body)))
            self.send_header("Content-Type", TYPES.get(Path(self.path).suffix, "application/x"))
            self.send_header("ETag", '"1"')
            self.end_headers()
            self.wfile.write(body)
            return None

        def log_message(self, *given: object) -> None:
            pass

    with Server(("127.0.0.1", 0), Handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()


@contextmanager
def opened(url: str, width: int = 640, height: int = 360) -> Iterator["MeasuredPage"]:
    """Open a page in a new browser; errors of the page are raised at the end."""
    path = next(filter(None, map(shutil.which, BROWSERS)), None)
    if path is None:
        raise SystemExit(f"needs one of {', '.join(BROWSERS)}")
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=path, args=DRAWN_BY_SOFTWARE)
        page = browser.new_page(viewport={"width": width, "height": height})
        errors: list[str] = []
        page.on("pageerror", lambda error: errors.append(str(error)))

        def note(message: ConsoleMessage) -> None:
            if message.type == "error":
                errors.append(message.text)

        page.on("console", note)
        page.goto(url)
        page.wait_for_function("window.bench", timeout=10_000)
        yield MeasuredPage(browser, page, page.context.new_cdp_session(page))
        browser.close()
        if errors:
            raise SystemExit(f"error in the page: {errors[0]}")


class MeasuredPage:
    """A page with measurements of its browser."""

    def __init__(self, browser: Browser, page: Page, devtools: CDPSession) -> None:
        self.page = page
        self._devtools = devtools
        self._browser_devtools = browser.new_browser_cdp_session()
        devtools.send("Performance.enable", {"timeDomain": "timeTicks"})

    def ask(self, call: str, *arguments: Any) -> Any:
        """Call a function of the page's `bench`, and return its result."""
        return self.page.evaluate(f"values => bench.{call}(...values)", list(arguments))

    def main_thread_s(self) -> float:
        """Total seconds of tasks of the page's main thread."""
        metrics = self._devtools.send("Performance.getMetrics")["metrics"]
        return float(next(m["value"] for m in metrics if m["name"] == "TaskDuration"))

    @contextmanager
    def tasks_ms(self, into: list[float]) -> Iterator[None]:
        """Append the duration of each task of the page's main thread to a list."""
        browser = self.page.context.browser
        assert browser
        browser.start_tracing(page=self.page, categories=["toplevel", "__metadata"])
        yield
        events = json.loads(browser.stop_tracing())["traceEvents"]
        threads = {
            (event["pid"], event["tid"])
            for event in events
            if event["name"] == "thread_name" and event["args"]["name"] == "CrRendererMain"
        }
        into += [
            event["dur"] / 1000
            for event in events
            if (event["pid"], event["tid"]) in threads
            and event["name"].endswith("RunTask")
            and "dur" in event
        ]

    def memory_bytes(self) -> int:
        """Private memory of the page's process after garbage collection, including workers.

        DevTools retain network responses, so pages should not load data over the network.
        """
        for _ in range(2):
            self.page.evaluate("gc()")
            for worker in self.page.workers:
                worker.evaluate("gc()")
            self.page.wait_for_timeout(300)
        processes = self._browser_devtools.send("SystemInfo.getProcessInfo")["processInfo"]
        return max(_private_bytes(p["id"]) for p in processes if p["type"] == "renderer")

    def slow_network(self, bits_per_s: float, latency_ms: float) -> None:
        """Emulate a slow network."""
        self._devtools.send("Network.enable")
        self._devtools.send(
            "Network.emulateNetworkConditions",
            {
                "offline": False,
                "latency": latency_ms,
                "downloadThroughput": bits_per_s / 8,
                "uploadThroughput": bits_per_s / 8,
            },
        )


def _private_bytes(process: int) -> int:
    """Private memory of a process; Linux only."""
    lines = Path(f"/proc/{process}/smaps_rollup").read_text("utf-8").splitlines()
    return 1024 * sum(int(line.split()[1]) for line in lines if line.startswith("Private_"))
