"""A headless Chromium, driven over its DevTools protocol by the standard library alone."""

import base64
import json
import os
import secrets
import shutil
import socket
import struct
import subprocess
import tempfile
import time
from pathlib import Path
from urllib.parse import urlsplit
from urllib.request import urlopen

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")


def find_chromium():
    return next((path for name in NAMES if (path := shutil.which(name))), None)


class Browser:
    """One tab; a context manager."""

    def __init__(self, width=1280, height=900, dark=False):
        self._profile = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        command = [
            find_chromium(), "--headless=new", "--disable-gpu", "--no-first-run", "--mute-audio",
            "--disable-extensions", "--disable-background-networking", "--disable-sync",
            "--disable-dev-shm-usage", "--remote-debugging-port=0", "--hide-scrollbars",
            f"--user-data-dir={self._profile.name}", f"--window-size={width},{height}",
        ]  # fmt: skip
        if os.geteuid() == 0:
            command.append("--no-sandbox")  # Chromium has none for root
        self._process = subprocess.Popen(
            [*command, "about:blank"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        self._number, self.events, self._socket = 0, [], None
        try:
            self._socket = _connect(self._address())
            self.call("Page.enable")
            self.call("Runtime.enable")
            self.call("Log.enable")
            self.resize(width, height)
            features = [{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}]
            self.call("Emulation.setEmulatedMedia", features=features)
        except BaseException:
            self.close()
            raise

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def close(self):
        if self._socket is not None:
            self._socket.close()
        self._process.terminate()
        self._process.wait(10)
        self._profile.cleanup()

    def resize(self, width, height, mobile=False):
        self.call(
            "Emulation.setDeviceMetricsOverride",
            width=width, height=height, deviceScaleFactor=1, mobile=mobile,
        )  # fmt: skip

    def open(self, address):
        self.call("Page.navigate", url=address)

    def run(self, script):
        """Return what a script evaluates to; promises are waited for."""
        found = self.call(
            "Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True
        )
        if "exceptionDetails" in found:
            raise RuntimeError(found["exceptionDetails"]["exception"].get("description"))
        return found["result"].get("value")

    def wait_for(self, script, seconds=20):
        """Wait until a script is true, and return its value."""
        until = time.monotonic() + seconds
        while not (value := self.run(script)):
            if time.monotonic() > until:
                raise TimeoutError(script)
            time.sleep(0.05)
        return value

    def screenshot(self, path, full=False):
        found = self.call("Page.captureScreenshot", captureBeyondViewport=full)
        Path(path).write_bytes(base64.b64decode(found["data"]))

    @property
    def complaints(self):
        """Exceptions of scripts, and what the browser logged as an error."""
        self.run("0")
        thrown = [e["params"] for e in self.events if e["method"] == "Runtime.exceptionThrown"]
        logged = [e["params"]["entry"] for e in self.events if e["method"] == "Log.entryAdded"]
        return thrown + [entry for entry in logged if entry["level"] == "error"]

    def call(self, method, **params):
        self._number += 1
        text = json.dumps({"id": self._number, "method": method, "params": params}).encode()
        mask = secrets.token_bytes(4)
        head = b"\x81"
        if len(text) < 126:
            head += bytes([128 + len(text)])
        else:
            head += bytes([128 + 126]) + struct.pack(">H", len(text))  # none is longer than 64 kB
        masked = bytes(x ^ mask[i % 4] for i, x in enumerate(text))
        self._socket.sendall(head + mask + masked)
        while True:
            answer = json.loads(self._receive())
            if answer.get("id") == self._number:
                if "error" in answer:
                    raise RuntimeError(f"{method}: {answer['error']['message']}")
                return answer["result"]
            if "method" in answer:
                self.events.append(answer)

    def _receive(self):
        message, is_last = b"", False
        while not is_last:
            first, second = self._read(2)
            is_last, n = bool(first & 128), second & 127
            if n >= 126:
                n = int.from_bytes(self._read(2 if n == 126 else 8))
            part = self._read(n)
            if first & 15 < 8:  # others are pings, or the end
                message += part
        return message

    def _read(self, n):
        data = bytearray()
        while len(data) < n:
            part = self._socket.recv(n - len(data))
            if not part:
                raise ConnectionError("the browser hung up")
            data += part
        return bytes(data)

    def _address(self):
        file, until = Path(self._profile.name, "DevToolsActivePort"), time.monotonic() + 30
        while not (file.exists() and file.read_text().count("\n")):
            if self._process.poll() is not None or time.monotonic() > until:
                raise RuntimeError(f"{find_chromium()} does not start")
            time.sleep(0.05)
        port = int(file.read_text().split("\n")[0])
        with urlopen(f"http://127.0.0.1:{port}/json/list", timeout=10) as answer:
            tabs = json.load(answer)
        return next(tab["webSocketDebuggerUrl"] for tab in tabs if tab["type"] == "page")


def _connect(address):
    parts = urlsplit(address)
    opened = socket.create_connection((parts.hostname, parts.port), timeout=30)
    key = base64.b64encode(secrets.token_bytes(16)).decode()
    opened.sendall(
        f"GET {parts.path} HTTP/1.1\r\nHost: {parts.netloc}\r\nUpgrade: websocket\r\n"
        f"Connection: Upgrade\r\nSec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n\r\n".encode()
    )
    head = b""
    while not head.endswith(b"\r\n\r\n"):
        head += opened.recv(1)
    if b" 101 " not in head.split(b"\r\n")[0]:
        raise ConnectionError(head.decode())
    return opened
