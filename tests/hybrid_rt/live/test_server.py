"""Who may ask a live page, and for what."""

import contextlib
import http.client
import json
import resource
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

import numpy as np
import pytest

from hybrid_rt.live import server as served
from hybrid_rt.live.picture import halved
from hybrid_rt.live.server import PageServer

IMAGE = np.linspace(0.0, 4.0, 2 * 3 * 3).reshape(2, 3, 3)


class Still:
    """A render that is told what to say."""

    def __init__(self):
        self.phase, self.n_stops = "rendering", 0

    def now(self):
        return {"phase": self.phase}

    def about(self):
        return {"title": "a <title>"}

    def picture(self, after):
        return halved(IMAGE, passes=5) if after < 5 else None

    def compared(self):
        return None

    def probe(self, column, row):
        if column > 2:
            raise ValueError(f"pixel ({column}, {row}): pass a column below 3")
        return {"column": column, "row": row}

    def note_sent(self, seconds):
        assert seconds >= 0.0

    def ask_to_stop(self):
        self.n_stops += 1


@pytest.fixture
def still():
    return Still()


@pytest.fixture
def page(still):
    server = PageServer(0, "a-token", still)
    server.start()
    yield server
    server.stop()


def ask(page, path, method="GET", token="a-token", **headers):
    link = http.client.HTTPConnection("127.0.0.1", page.port, timeout=10)
    mark = "&" if "?" in path else "?"
    headers = {name.replace("_", "-"): value for name, value in headers.items()}
    try:
        link.request(method, path if token is None else f"{path}{mark}token={token}", None, headers)
        answer = link.getresponse()
        return answer.status, answer.read(), answer.headers
    finally:
        link.close()


def test_the_address_leads_to_the_page(page):
    parts = urlsplit(page.address)
    assert (parts.hostname, parts.port) == ("127.0.0.1", page.port)
    assert parse_qs(parts.query) == {"token": ["a-token"]}
    status, body, headers = ask(page, "/")
    assert (status, headers.get_content_type()) == (200, "text/html")
    assert b'data-token="a-token"' in body
    assert b"TOKEN" not in body.replace(b"const TOKEN", b"")
    for name, kind in served.TYPES.items():
        status, body, headers = ask(page, f"/{name}")
        assert (status, headers.get_content_type()) == (200, kind)
        assert b"http://" not in body.replace(
            b"http://www.w3.org/2000/svg", b""
        )  # from nowhere else
        assert b"https://" not in body


EVERYTHING = [
    "/",
    "/live.js",
    "/events",
    "/picture",
    "/compared",
    "/probe",
    "/about",
    "/stop",
    "/x",
]


@pytest.mark.parametrize(
    ("changed", "word"),
    [
        ({"token": None}, b"token"),
        ({"token": "a-tokeN"}, b"token"),
        ({"token": "%FF"}, b"token"),
        ({"Host": "evil.example"}, b"Host"),
        ({"Host": "127.0.0.1:1"}, b"Host"),
        ({"Origin": "http://evil.example"}, b"Origin"),
        ({"Sec_Fetch_Site": "cross-site"}, b"another site"),
    ],
)
def test_strangers_learn_nothing(page, still, changed, word):
    """Not even which pages there are: 403 comes before 404 and 405."""
    for path in EVERYTHING:
        status, body, _ = ask(page, path, "POST" if path == "/stop" else "GET", **changed)
        assert status == 403
        assert word in body
        assert body.count(b"\n") == 1
    assert still.n_stops == 0


def test_the_page_itself_may_ask(page):
    for name in ("127.0.0.1", "localhost", "LocalHost"):
        host = f"{name}:{page.port}"
        answer = ask(page, "/about", Host=host, Origin=f"http://{host.lower()}")
        assert answer[0] == 200
    assert ask(page, "/about", Sec_Fetch_Site="same-origin")[0] == 200


def test_browsers_leave_out_port_80(still, monkeypatch):
    class AtEighty(served._Server):
        """Says that it is at port 80, which is not for everybody."""

        def __init__(self, address, handler):
            super().__init__((address[0], 0), handler)
            self.really, self.server_address = self.server_address[1], (address[0], 80)

    monkeypatch.setattr(served, "_Server", AtEighty)
    page = PageServer(80, "a-token", still)
    page.start()
    page.port = page._server.really
    try:
        for host in ("127.0.0.1", "localhost", "127.0.0.1:80"):
            assert ask(page, "/about", Host=host, Origin=f"http://{host}")[0] == 200
        assert ask(page, "/about", Host="evil.example")[0] == 403
    finally:
        page.stop()


def test_no_answer_allows_other_origins_or_other_content(page):
    for path, method in (("/", "GET"), ("/about", "GET"), ("/x", "GET"), ("/", "OPTIONS")):
        headers = ask(page, path, method, Origin=f"http://127.0.0.1:{page.port}")[2]
        assert not [name for name in headers if name.lower().startswith("access-control")]
        assert "default-src 'none'" in headers["Content-Security-Policy"]
        assert "unsafe" not in headers["Content-Security-Policy"]
        assert headers["X-Content-Type-Options"] == "nosniff"
        assert headers["Referrer-Policy"] == "no-referrer"
        assert headers["Cache-Control"] == "no-store"


@pytest.mark.parametrize(
    ("path", "method", "status", "allowed"),
    [
        ("/nothing", "GET", 404, None),
        ("/../watch.py", "GET", 404, None),
        ("/", "POST", 405, "GET"),
        ("/about", "HEAD", 405, "GET"),
        ("/stop", "GET", 405, "POST"),
        ("/probe?column=-1&row=0", "GET", 400, None),
        ("/picture?after=x", "GET", 400, None),
    ],
)
def test_what_cannot_be_answered(page, still, path, method, status, allowed):
    found, _, headers = ask(page, path, method)
    assert (found, headers["Allow"]) == (status, allowed)
    assert still.n_stops == 0


def test_only_a_post_stops(page, still):
    status, body, _ = ask(page, "/stop", "POST")
    assert (status, json.loads(body)) == (200, {"stop_asked": True})
    assert still.n_stops == 1


def test_pictures_are_half_precision_and_come_once(page):
    status, body, headers = ask(page, "/picture")
    assert status == 200
    sizes = [int(headers[name]) for name in ("X-Passes", "X-Height", "X-Width")]
    assert sizes == [5, 2, 3]
    image = np.frombuffer(body, "<f2").reshape(2, 3, 3) * 2.0 ** int(headers["X-Exponent"])
    np.testing.assert_allclose(image, IMAGE, rtol=2**-11)  # half of the last of 11 bits
    assert ask(page, "/picture?after=5")[:2] == (204, b"")
    assert ask(page, "/compared")[:2] == (204, b"")


@pytest.mark.parametrize("level", [0.0, 1e-9, 1e9])
def test_dark_and_bright_pictures_keep_their_digits(level):
    half = halved(level * IMAGE)
    image = np.frombuffer(half.data, "<f2").reshape(IMAGE.shape).astype(float) * 2.0**half.exponent
    np.testing.assert_allclose(image, level * IMAGE, rtol=2**-11)


def test_events_come_with_changes_and_end_with_the_render(page, still):
    link = http.client.HTTPConnection("127.0.0.1", page.port, timeout=10)
    link.request("GET", "/events?token=a-token")
    answer = link.getresponse()
    assert answer.headers.get_content_type() == "text/event-stream"
    lines = iter(answer.readline, b"")
    assert next(lines) == b"retry: 5000\n"
    text = b"".join(next(lines) for _ in range(7)).decode()
    assert "event: about" in text
    assert '{"phase": "rendering"}' in text
    assert page.n_listening == 1
    still.phase = "ended"
    page.wake()
    assert '{"phase": "ended"}' in answer.read().decode()  # and then the stream is over
    link.close()
    until = time.monotonic() + 5.0
    while page.n_listening and time.monotonic() < until:
        time.sleep(0.01)
    assert page.n_listening == 0


def test_listeners_are_limited(page, monkeypatch):
    monkeypatch.setattr(served, "MOST_PAGES", 0)
    assert ask(page, "/events")[0] == 503


def test_it_is_not_to_be_reached_from_elsewhere(page):
    with socket.socket() as other, pytest.raises(ConnectionRefusedError):
        other.connect(("127.0.0.2", page.port))  # only one address of this machine answers


def test_a_port_in_use_is_named(still):
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        with pytest.raises(OSError, match=f"port {port} of 127.0.0.1 is in use: name another"):
            PageServer(port, "a-token", still)


KNOCKS = """
import resource, socket, sys
most = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))
links = []
for _ in range(90):
    link = socket.create_connection(("127.0.0.1", int(sys.argv[1])), timeout=5)
    link.sendall(b"GET / HTTP/1.1\\r\\n")
    links.append(link)
print("there", flush=True)
sys.stdin.read()
"""


@pytest.fixture
def knock(page):
    """Another process that opens 90 connections, as other users of the machine can, and holds them."""
    client = subprocess.Popen(
        [sys.executable, "-I", "-S", "-c", KNOCKS, str(page.port)],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert client.stdout.readline() == "there\n"
    yield
    client.communicate("")


@contextlib.contextmanager
def descriptors(n):
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (n, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, before)


def answers(page):
    """Ask until there is an answer: while many others knock one may be sent away."""
    until = time.perf_counter() + 5.0
    while time.perf_counter() < until:
        with contextlib.suppress(http.client.HTTPException, ConnectionError):
            return ask(page, "/about")[0] == 200
        time.sleep(0.01)
    return False


def settled(count, most):
    """Connections that end do so in threads of their own."""
    until = time.perf_counter() + 5.0
    while count() > most and time.perf_counter() < until:
        time.sleep(0.01)
    return count() <= most


@pytest.mark.usefixtures("knock")
def test_connections_without_the_token_take_few_threads_and_keep_nobody_out(page):
    before = threading.active_count() - len(page._server._connections)
    assert ask(page, "/about")[0] == 200
    assert len(page._server._connections) <= served.MOST_CONNECTIONS
    assert settled(threading.active_count, before + served.MOST_CONNECTIONS)


def test_descriptors_stay_free_for_the_picture(page, request, tmp_path):
    """Of 24 more than are open, 16 are left, and the page still answers who has the token."""
    with descriptors(max(int(item.name) for item in Path("/dev/fd").iterdir()) + 25):
        request.getfixturevalue("knock")
        assert answers(page)
        with contextlib.ExitStack() as held:
            for k in range(served.RESERVE - served.FOR_A_MOMENT):
                held.enter_context((tmp_path / f"{k}").open("wb"))


def test_pages_with_the_token_stay_when_others_come(page, request):
    link = http.client.HTTPConnection("127.0.0.1", page.port, timeout=10)
    with contextlib.closing(link):
        link.request("GET", "/about?token=a-token")
        assert link.getresponse().read()
        before = link.sock
        request.getfixturevalue("knock")
        link.request("GET", "/about?token=a-token")
        assert link.getresponse().status == 200
        assert link.sock is before
