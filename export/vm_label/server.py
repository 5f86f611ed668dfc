"""The web server of the labeling page. It needs no internet, and by default only this machine can reach it.

GET / is the page, /state the session as JSON, /alive a short sign of life, and /picture/ID a JPEG of a crop, or of a
whole image. /box/ID/X/Y is the box of an object whose center is at X, Y of a whole image, as shares of its size.

POST /answer takes {"session": ID, "crop": ID, "answer": "yes", "no", "skip" or null}, where ID may also be that of a
whole image. A box that a person drew has an ID that the page chose, and "drawn": {"picture": ID, "class": NAME, "box":
[x, y, width, height]}. The response comes after the answer is on disk.
"""

from __future__ import annotations

import json
import os
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from socketserver import TCPServer
from typing import Any

from vm_embedded.borders.text import to_json
from vm_embedded.errors import InputError, VisualMeshError
from vm_embedded.live.http_server import is_numeric_host

from .answers import ANSWERS
from .labeling import Labeling

_PAGE = Path(__file__).with_name("page.html")

_LONGEST_BODY = 4096
"""Longest body of an answer [bytes]."""


class LabelServer(ThreadingHTTPServer):
    """Serves a session. host: IPv4 address to listen at. port: 0 chooses a free one. Raises InputError."""

    daemon_threads = True

    def __init__(self, session: Labeling, host: str, port: int) -> None:
        self.session = session
        self._host = host
        self.page = _PAGE.read_bytes()
        try:
            super().__init__((host, port), _Handler)
        except OSError as error:
            reason = os.strerror(error.errno) if error.errno and error.errno > 0 else str(error)
            raise InputError(f"can't listen at {host}:{port}: {reason}; --port takes another port") from error

    @property
    def url(self) -> str:
        """The address of the page."""
        host = "127.0.0.1" if self._host == "0.0.0.0" else self._host
        return f"http://{host}:{self.server_address[1]}/"

    def server_bind(self) -> None:
        """Bind the socket. HTTPServer also looks for the name of the address, which may need a network."""
        TCPServer.server_bind(self)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Say nothing: a browser closes connections as it likes."""


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    timeout = 60.0  # [s], after which an idle connection is closed
    server: LabelServer

    def do_GET(self) -> None:
        session, (kind, *rest) = self.server.session, self.path.partition("?")[0].strip("/").split("/")
        crop = session.find(rest[0]) if rest else None
        if not is_numeric_host(self.headers.get("Host", "127.0.0.1")):
            self._refuse(HTTPStatus.FORBIDDEN, "use the IP address, not a host name")
        elif self.path == "/":
            self._send(HTTPStatus.OK, "text/html; charset=utf-8", self.server.page)
        elif self.path == "/state":
            self._send_json(session.state())
        elif self.path == "/alive":
            self._send_json({"session": session.id, "saved": session.saved})
        elif crop is not None and kind == "picture" and len(rest) == 1:
            try:
                picture = session.picture(crop)
            except InputError as error:
                self._refuse(HTTPStatus.INTERNAL_SERVER_ERROR, str(error))
            else:
                self._send(HTTPStatus.OK, "image/jpeg", picture)
        elif crop is not None and kind == "box" and len(rest) == 3:
            try:
                x, y = map(float, rest[1:])
                self._send_json({"box": session.box_at(crop, (x, y))})
            except (ValueError, VisualMeshError) as error:
                self._refuse(HTTPStatus.UNPROCESSABLE_ENTITY, str(error))
        else:
            self._refuse(HTTPStatus.NOT_FOUND, "page not found")

    def do_POST(self) -> None:
        length = self.headers.get("Content-Length", "")
        if not length.isdecimal() or int(length) > _LONGEST_BODY:
            self.close_connection = True
            self._refuse(HTTPStatus.BAD_REQUEST, "an answer needs a Content-Length")
            return
        body = self.rfile.read(int(length))
        # Another web site can send a form or text to this address, but not JSON.
        is_json = self.headers.get_content_type() == "application/json"
        if self.path != "/answer" or not is_json or not is_numeric_host(self.headers.get("Host", "127.0.0.1")):
            self._refuse(HTTPStatus.FORBIDDEN, "POST takes answers as JSON")
            return
        self._answer(body)

    def _answer(self, body: bytes) -> None:
        session = self.server.session
        try:
            fields = json.loads(body)
            ours, id, answer = fields["session"] == session.id, fields["crop"], fields["answer"]
            drawn = fields.get("drawn")
            good = isinstance(id, str) and (answer is None or answer in ANSWERS) and isinstance(drawn, dict | None)
        except (ValueError, KeyError, TypeError, RecursionError):
            good = False
        if not good:
            self._refuse(HTTPStatus.BAD_REQUEST, "an answer has a session, a crop and an answer")
            return
        try:
            crop = session.drawn(id, *map(drawn.get, ("picture", "class", "box"))) if ours and drawn else None
        except InputError as error:
            self._refuse(HTTPStatus.UNPROCESSABLE_ENTITY, str(error))
            return
        crop = crop or session.find(id)
        if not ours or crop is None:
            self._refuse(HTTPStatus.CONFLICT, "this crop is not of the folder that vm-label shows now")
            return
        try:
            replaced = session.answer(crop, answer)
        except InputError as error:
            self._refuse(HTTPStatus.INSUFFICIENT_STORAGE, str(error))
        except ValueError as error:
            self._refuse(HTTPStatus.BAD_REQUEST, str(error))
        else:
            self._send_json({"crop": id, "answer": answer, "replaced": replaced, "saved": session.saved})

    def _send_json(self, content: Any) -> None:
        self._send(HTTPStatus.OK, "application/json", to_json(content, allow_nan=False).encode())

    def _refuse(self, status: HTTPStatus, reason: str) -> None:
        self._send(status, "text/plain; charset=utf-8", reason.encode(errors="replace") + b"\n")

    def _send(self, status: HTTPStatus, media_type: str, content: bytes) -> None:
        self.send_response(status)
        self.send_header("Content-Type", media_type)
        self.send_header("Content-Length", str(len(content)))
        # A crop never changes: another box has another address.
        keep = status == HTTPStatus.OK and media_type == "image/jpeg"
        self.send_header("Cache-Control", "private, max-age=3600" if keep else "no-store")
        self.end_headers()
        self.wfile.write(content)

    def log_message(self, format: str, *values: Any) -> None:
        """Say nothing about requests."""
