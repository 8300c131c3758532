"""The web server of a live page: on 127.0.0.1, for whoever holds its token.

Other sites that a browser has open must neither read nor stop a render. So every request needs
the token; its Host must be this server (or a name that leads here would do, DNS rebinding), its
Origin this page (or a form elsewhere could press the button), and no answer allows other origins.
"""

import errno
import hmac
import json
import select
import socket
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.resources import files
from typing import Any, Protocol
from urllib.parse import parse_qs, urlsplit

from hybrid_rt.core.memory import free_descriptors
from hybrid_rt.live.picture import HalfPicture

HOST = "127.0.0.1"
HTTP_PORT = 80
# Seconds between two looks at the render for each page, and between signs of life.
TICK, SIGN_OF_LIFE = 0.5, 15.0
# Pages that listen at once; browsers themselves open six at most.
MOST_PAGES = 16
# Connections at once, a thread each. For a new one the oldest ends that has not shown the token.
MOST_CONNECTIONS = 64
# Descriptors that stay free for the rest of the process, to save the picture say. A connection that ends
# for a new one keeps its own for a moment: these are for both at once.
RESERVE, FOR_A_MOMENT = 16, 4
# A client that takes longer to send a request, or to take an answer, is gone.
PATIENCE = 10.0

SCRIPTS = ("words", "view", "chart", "probe", "hands", "live")
TYPES = {
    "live.html": "text/html",
    "live.css": "text/css",
    **{f"{name}.js": "text/javascript" for name in SCRIPTS},
    "icon.svg": "image/svg+xml",
}
# Nothing from elsewhere, nothing inline; pictures are drawn, not loaded.
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
HEADERS = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": POLICY,
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}
# The end of a stream of events.
LAST = ("ended", "failed")


class Shown(Protocol):
    """What the server asks of `hybrid_rt.live.watch.LivePage`."""

    def now(self) -> dict[str, Any]:
        """Return the state."""

    def about(self) -> dict[str, Any]:
        """Return what does not change."""

    def picture(self, after: int) -> HalfPicture | None:
        """Return a new picture."""

    def compared(self) -> HalfPicture | None:
        """Return the other picture."""

    def probe(self, column: int, row: int) -> dict[str, Any] | None:
        """Return what a pixel holds."""

    def note_sent(self, seconds: float) -> None:
        """Hear of a picture sent."""

    def ask_to_stop(self) -> None:
        """Stop the render."""


class PageServer:
    """Serves one page; its threads do not keep the process alive."""

    def __init__(self, port: int, token: str, shown: Shown) -> None:
        try:
            self._server = _Server((HOST, port), _Handler)
        except OSError as error:
            raise OSError(f"live page: port {port} of {HOST} {_reason(error)}") from error
        self.port = self._server.server_address[1]
        self.address = f"http://{HOST}:{self.port}/?token={token}"
        self._server.shown, self._server.token = shown, token.encode()
        self._server.names = {f"{HOST}:{self.port}", f"localhost:{self.port}"}
        if self.port == HTTP_PORT:  # browsers leave it out
            self._server.names |= {HOST, "localhost"}
        self._thread = threading.Thread(
            target=self._server.serve_forever, args=(0.1,), name="live page", daemon=True
        )

    @property
    def n_listening(self) -> int:
        """Number of pages that hear of the render."""
        return self._server.n_listening

    def start(self) -> None:
        """Answer requests from now on."""
        self._thread.start()

    def wake(self) -> None:
        """Let all pages look at the state now."""
        self._server.woken.set()

    def stop(self) -> None:
        """Answer no request any more."""
        self._server.shutdown()
        self._server.server_close()


def _reason(error: OSError) -> str:
    if error.errno == errno.EADDRINUSE:
        return "is in use: name another, or none for a free one"
    if error.errno == errno.EACCES:
        return "is reserved: name one from 1024 on, or none for a free one"
    return f"cannot be opened ({error.strerror}): name another"


class _Server(ThreadingHTTPServer):
    daemon_threads = True
    block_on_close = False
    request_queue_size = MOST_CONNECTIONS  # or a page would wait for a second while others knock
    shown: Shown
    token: bytes
    names: set[str]

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.woken = threading.Event()
        self.n_listening = 0
        self.count_lock = threading.Lock()
        # Whether each has shown the token; the oldest comes first.
        self._connections: dict[socket.socket, bool] = {}

    def get_request(self) -> Any:
        """Accept a connection."""
        try:
            return super().get_request()
        except OSError:  # no descriptor is left, and the next try comes at once
            time.sleep(TICK)
            raise

    def verify_request(self, request: Any, client_address: Any) -> bool:
        """Tell whether there is room for a connection, before it takes a thread."""
        del client_address
        n_free = free_descriptors(request.fileno())
        with self.count_lock:
            is_full = len(self._connections) >= MOST_CONNECTIONS or n_free < RESERVE
            if is_full:
                oldest = next((one for one, known in self._connections.items() if not known), None)
                if oldest is None:
                    return False
                del self._connections[oldest]
                with suppress(OSError):  # its thread sees an end, and closes it
                    oldest.shutdown(socket.SHUT_RDWR)
            self._connections[request] = False
        return n_free >= RESERVE - FOR_A_MOMENT

    def shutdown_request(self, request: Any) -> None:
        """Close a connection."""
        with self.count_lock:
            self._connections.pop(request, None)
        super().shutdown_request(request)

    def note_token(self, request: socket.socket) -> None:
        """Hear that a connection has shown the token."""
        with self.count_lock:
            if request in self._connections:
                self._connections[request] = True

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Say nothing of clients that went away."""


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    server_version, sys_version = "hybrid-rt", ""
    timeout = PATIENCE
    server: _Server

    def _answer(self) -> None:
        """Check who asks, then for what, then how."""
        try:
            parts = urlsplit(self.path)
        except ValueError:
            self._refuse(HTTPStatus.BAD_REQUEST, "that is no address")
            return
        self.close_connection = self.close_connection or self.command != "GET"  # a body may follow
        query = {name: found[-1] for name, found in parse_qs(parts.query).items()}
        why = self._why_not(query)
        if why:
            self._refuse(HTTPStatus.FORBIDDEN, why)
            return
        self.server.note_token(self.connection)
        name = parts.path.removeprefix("/") or "live.html"
        method, work = self._routes().get(name, (None, None))
        if work is None:
            self._refuse(HTTPStatus.NOT_FOUND, "there is no such page")
        elif self.command != method:
            self._refuse(HTTPStatus.METHOD_NOT_ALLOWED, f"ask by {method}", {"Allow": str(method)})
        else:
            work(query)

    do_GET = do_HEAD = do_POST = do_PUT = do_DELETE = do_PATCH = do_OPTIONS = do_TRACE = _answer

    def _routes(self) -> dict[str, tuple[str, Callable[[dict[str, str]], None]]]:
        return {name: ("GET", partial(self._send_file, name)) for name in TYPES} | {
            "about": ("GET", lambda _: self._send_json(self.server.shown.about())),
            "events": ("GET", self._send_events),
            "picture": ("GET", self._send_picture),
            "compared": ("GET", lambda _: self._send_halves(self.server.shown.compared())),
            "probe": ("GET", self._send_probe),
            "stop": ("POST", self._stop),
        }

    def _why_not(self, query: dict[str, str]) -> str:
        """Return why this request is refused; "": it is not."""
        hosts = self.headers.get_all("Host") or []
        if len(hosts) != 1 or hosts[0].lower() not in self.server.names:
            return "wrong Host: use the address that the terminal shows"
        origins = [f"http://{name}" for name in self.server.names]
        if any(origin not in origins for origin in self.headers.get_all("Origin") or []):
            return "wrong Origin: only the page itself may ask"
        if self.headers.get("Sec-Fetch-Site", "none") not in ("none", "same-origin"):
            return "another site asks: open the address that the terminal shows yourself"
        if not hmac.compare_digest(query.get("token", "").encode(), self.server.token):
            return "wrong token: use the address that the terminal shows"
        return ""

    def _send_file(self, name: str, _: dict[str, str]) -> None:
        data = (files("hybrid_rt.live") / "page" / name).read_bytes()
        if name == "live.html":
            data = data.replace(b"TOKEN", self.server.token)
        self._send(HTTPStatus.OK, data, f"{TYPES[name]}; charset=utf-8")

    def _send_picture(self, query: dict[str, str]) -> None:
        after = _whole(query.get("after", "0"))
        if after is None:
            self._refuse(HTTPStatus.BAD_REQUEST, "after: pass a number of passes")
            return
        self._send_halves(self.server.shown.picture(after))

    def _send_halves(self, picture: HalfPicture | None) -> None:
        if picture is None:
            self._send(HTTPStatus.NO_CONTENT, b"", "text/plain")
            return
        began = time.thread_time()
        names = ("passes", "width", "height", "exponent")
        headers = {f"X-{name.capitalize()}": str(getattr(picture, name)) for name in names}
        self._send(HTTPStatus.OK, picture.data, "application/octet-stream", headers)
        self.server.shown.note_sent(time.thread_time() - began)

    def _send_probe(self, query: dict[str, str]) -> None:
        column, row = (_whole(query.get(name, "")) for name in ("column", "row"))
        if column is None or row is None:
            self._refuse(HTTPStatus.BAD_REQUEST, "column, row: pass whole numbers from 0 on")
            return
        try:
            found = self.server.shown.probe(column, row)
        except ValueError as error:
            self._refuse(HTTPStatus.BAD_REQUEST, str(error))
            return
        if found is None:
            self._refuse(HTTPStatus.SERVICE_UNAVAILABLE, "the first pass has not begun")
            return
        self._send_json(found)

    def _stop(self, _: dict[str, str]) -> None:
        self.server.shown.ask_to_stop()
        self._send_json({"stop_asked": True})

    def _send_events(self, _: dict[str, str]) -> None:
        """Send the state as it changes, until the render or the page ends."""
        server = self.server
        with server.count_lock:
            is_full = server.n_listening >= MOST_PAGES
            server.n_listening += not is_full
        if is_full:
            self._refuse(HTTPStatus.SERVICE_UNAVAILABLE, f"{MOST_PAGES} pages listen already")
            return
        try:
            self.close_connection = True
            self._send_head(HTTPStatus.OK, "text/event-stream", {"Connection": "close"})
            # Browsers that lose the connection wait this long, and the page ends that itself.
            self.wfile.write(b"retry: 5000\n\n")
            self._tell()
        finally:
            with server.count_lock:
                server.n_listening -= 1

    def _tell(self) -> None:
        before, phase, sent_at = "", "", 0.0
        while phase not in LAST:
            state = self.server.shown.now()
            if state["phase"] != phase:  # with a phase more is known
                self._event("about", json.dumps(self.server.shown.about()))
            phase, text = state["phase"], json.dumps(state)
            if text != before or time.perf_counter() - sent_at > SIGN_OF_LIFE:
                self._event("state", text)
                before, sent_at = text, time.perf_counter()
            if phase in LAST:
                # Left open for a moment: the page closes it when it has the last picture.
                select.select([self.connection], [], [], 1.0)
            elif self._is_gone():
                return
            elif not self.server.woken.is_set():
                self.server.woken.wait(TICK)

    def _is_gone(self) -> bool:
        """Tell whether the page has closed the connection: it never sends anything."""
        return bool(select.select([self.connection], [], [], 0.0)[0])

    def _event(self, name: str, text: str) -> None:
        self.wfile.write(f"event: {name}\ndata: {text}\n\n".encode())

    def _send_json(self, value: dict[str, Any]) -> None:
        data = json.dumps(value, allow_nan=False).encode()
        self._send(HTTPStatus.OK, data, "application/json")

    def _refuse(self, status: HTTPStatus, why: str, headers: dict[str, str] | None = None) -> None:
        self.close_connection = True  # a body may still be on its way
        more = {"Connection": "close", **(headers or {})}
        self._send(status, f"{why}\n".encode(), "text/plain; charset=utf-8", more)

    def _send(
        self,
        status: HTTPStatus,
        data: bytes | memoryview,
        kind: str,
        headers: dict[str, str] | None = None,
    ) -> None:
        self._send_head(status, kind, {"Content-Length": str(len(data)), **(headers or {})})
        if self.command != "HEAD":
            self.wfile.write(data)

    def _send_head(self, status: HTTPStatus, kind: str, headers: dict[str, str]) -> None:
        self.send_response(status)
        for name, value in {**HEADERS, "Content-Type": kind, **headers}.items():
            self.send_header(name, value)
        self.end_headers()

    def log_message(self, format: str, *args: Any) -> None:
        """Write no log: the terminal is for the render."""


def _whole(text: str) -> int | None:
    """Return a whole number from 0 on, or None."""
    return int(text) if text.isascii() and text.isdecimal() and len(text) < 12 else None
