"""The page of a shoot: who may open it, what it is told, and what is asked for on it."""

from __future__ import annotations

import json
import secrets
from collections.abc import Callable
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from ipaddress import IPv4Address
from pathlib import Path
from queue import Queue
from threading import Condition, Thread
from typing import Any

from cubicfish import OutputError, UsageError, quoted
from cubicfish_cli.extensions.shoot.camera import Camera
from cubicfish_cli.render import pages

_HERE = Path(__file__).parent
_PATIENCE_SECONDS = 10.0  # after which a line that says nothing keeps a connection open
_MOST_BYTES = 10_000
_HTML, _JPEG, _JSON = "text/html; charset=utf-8", "image/jpeg", "application/json"
_EVENTS, _FRAME = "text/event-stream", "frame"


class Page:
    """Serves the page of a shoot at an address with a random token.

    Attributes:
        asked: what is asked for on the page, in order.
        address: the page's.
        picture: the last photo, a JPEG file.
        report: the page about a calibration, once there is one.

    """

    def __init__(self, listen: str, camera: Camera | None) -> None:
        """Begin to serve on an address of this machine.

        Raises:
            UsageError: it is not one address.
            OutputError: it is not this machine's.

        """
        try:
            if IPv4Address(listen).is_unspecified:
                raise ValueError
        except ValueError as problem:
            raise UsageError(
                f"--listen {quoted(listen)} is not one address: name that of this machine in the "
                "network, such as 192.168.1.20"
            ) from problem
        self.asked: Queue[dict[str, Any]] = Queue()
        self.picture, self.report, self.camera = b"", Path(), camera
        self._said, self._number, self._changed = b"{}", 0, Condition()
        self.token, self.nonce = secrets.token_urlsafe(24), secrets.token_urlsafe(12)
        style = (Path(str(pages.__file__)).parent / "page.css").read_text(encoding="utf-8")
        text = (_HERE / "page.html").read_text(encoding="utf-8")
        self.html = text.replace("{{style}}", style).replace("{{nonce}}", self.nonce).encode()
        try:
            server = ThreadingHTTPServer((listen, 0), _Handler)
        except OSError as problem:
            raise OutputError(
                f"no page can be served on {listen} ({problem.strerror}): is it this machine's?"
            ) from problem
        server.daemon_threads = True
        vars(server).update(page=self, handle_error=lambda *_: None)  # closed pages are no errors
        self.host = f"{listen}:{server.server_port}"
        self.address = f"http://{self.host}/{self.token}/"
        Thread(target=server.serve_forever, daemon=True).start()

    def tell(self, said: dict[str, Any]) -> None:
        """Tell all who look at the page."""
        with self._changed:
            self._said, self._number = json.dumps(said).encode(), self._number + 1
            self._changed.notify_all()

    def told(self, after: int, seconds: float) -> tuple[int, bytes]:
        """Wait for what is told after a number: its own number, and JSON."""
        with self._changed:
            self._changed.wait_for(lambda: self._number > after, seconds)
            return self._number, self._said


class _Handler(BaseHTTPRequestHandler):
    """Answers those alone who know the token and come from the page itself."""

    @property
    def _page(self) -> Page:
        page: Page = vars(self.server)["page"]
        return page

    def log_message(self, format: str, *args: Any) -> None:
        """Say nothing: addresses hold the token."""

    def _find_asked(self, *, writes: bool) -> str | None:
        """What of the page is asked for; None, and refused, from elsewhere or without the token."""
        page, (_, token, *rest) = self._page, [*self.path.partition("?")[0].split("/", 2), ""]
        origin, site = self.headers.get("Origin"), self.headers.get("Sec-Fetch-Site", "none")
        good = self.headers.get("Host") == page.host
        good &= origin == f"http://{page.host}" if writes or origin else True
        good &= site in ("none", "same-origin")
        if not good or not secrets.compare_digest(token.encode(), page.token.encode()):
            self._send(b"", _JSON, HTTPStatus.FORBIDDEN)
            return None
        return rest[0]

    def do_GET(self) -> None:
        """Send the page, a picture of it, or what is told as it is told."""
        asked, page = self._find_asked(writes=False), self._page
        if asked is None:
            return
        if asked == "events":
            self._stream(_EVENTS, page.told, lambda data: b"data: " + data + b"\n\n")
        elif asked == "live" and page.camera is not None:
            head = f"--{_FRAME}\r\nContent-Type: {_JPEG}\r\nContent-Length: %d\r\n\r\n".encode()
            kind = f"multipart/x-mixed-replace; boundary={_FRAME}"
            self._stream(kind, page.camera.live, lambda data: head % len(data) + data + b"\r\n")
        elif asked == "photo" and page.picture:
            self._send(page.picture, _JPEG)
        elif asked == "report" and page.report.is_file():
            self._send(page.report.read_bytes(), _HTML, policy="")
        elif asked == "":
            self._send(page.html, _HTML)
        else:
            self._send(b"", _JSON, HTTPStatus.NOT_FOUND)

    def do_POST(self) -> None:
        """Take what is asked for on the page."""
        if self._find_asked(writes=True) is None:
            return
        try:
            length = int(self.headers.get("Content-Length", 0))
            asked = json.loads(self.rfile.read(length)) if 0 < length < _MOST_BYTES else None
        except ValueError:
            asked = None
        if not isinstance(asked, dict):
            self._send(b"", _JSON, HTTPStatus.BAD_REQUEST)
            return
        self._page.asked.put(asked)
        self._send(b"{}", _JSON)

    def _begin(self, kind: str, status: HTTPStatus, policy: str | None = None) -> None:
        own = f"'nonce-{self._page.nonce}'"
        if policy is None:
            policy = (
                f"default-src 'none'; img-src 'self' data:; style-src {own}; script-src {own}; "
                "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
            )
        self.send_response(status)
        for name, value in {
            "Content-Type": kind,
            "Cache-Control": "no-store",
            "Referrer-Policy": "no-referrer",
            "X-Content-Type-Options": "nosniff",
            "Cross-Origin-Resource-Policy": "same-origin",
            **({"Content-Security-Policy": policy} if policy else {}),
        }.items():
            self.send_header(name, value)

    def _send(
        self,
        data: bytes,
        kind: str,
        status: HTTPStatus = HTTPStatus.OK,
        policy: str | None = None,
    ) -> None:
        self._begin(kind, status, policy)
        self.send_header("Content-Length", str(len(data)))
        self.end_headers()
        self.wfile.write(data)

    def _stream(
        self,
        kind: str,
        wait: Callable[[int, float], tuple[int, bytes]],
        wrap: Callable[[bytes], bytes],
    ) -> None:
        """Send one thing after the other until nobody listens."""
        self._begin(kind, HTTPStatus.OK)
        self.end_headers()
        number = 0
        try:
            while True:
                last, (number, data) = number, wait(number, _PATIENCE_SECONDS)
                if number > last:
                    self.wfile.write(wrap(data))
                elif kind == _EVENTS:
                    self.wfile.write(b":\n\n")
        except OSError:  # a closed page
            return
