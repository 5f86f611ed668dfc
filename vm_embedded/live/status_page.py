"""The status page of a running detector: what it shows, what it may change, and the servers of page and metrics."""

from __future__ import annotations

import asyncio
import math
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

from ..borders.credentials import without_password
from ..borders.text import to_json
from ..errors import InputError
from ..geometry.orientation import Orientation
from ..output.messages import Message
from .answering import Answer, Answerer
from .control import REFUSED
from .frame_views import FrameViews
from .http_server import HttpServer, Page, Query, Response
from .page_token import kept_token
from .system import read_temperatures
from .threshold import threshold_name, with_settings, with_threshold

_FRAME_RATE = 10.0
"""Of the stream [1/s]."""

_PAGE = Path(__file__).with_name("status_page.html")

_REST = 4.0
"""Pause after a preview, in times of its duration: frames wait for a preview, and browsers may ask for many."""


class StatusPage:
    """The page and its two changes: a recording, and another threshold. Changes need `token`, which the log
    prints. not_kept: why the next start will have another token; "" if it has the same.

    answerer: has detector and configuration. status, record, metrics: texts of the daemon. use_threshold: is called
    with name and value of a threshold that was changed.
    """

    def __init__(
        self,
        answerer: Answerer,
        status: Callable[[], Message],
        record: Callable[[], str],
        metrics: Callable[[], str],
        use_threshold: Callable[[str, float], None],
    ) -> None:
        self.token, self.not_kept = kept_token() if answerer.configuration.status.page else ("", "")
        self._answerer, self._status, self._record, self._metrics = answerer, status, record, metrics
        self._use_threshold = use_threshold
        self._html = _PAGE.read_bytes()
        self._views = FrameViews(_FRAME_RATE)
        self._pose: Message | None = None  # of the last frame
        self._previewing = asyncio.Lock()
        self._next_preview = 0.0  # when the next one may begin [s]

    def servers(self) -> Iterator[HttpServer]:
        """The servers that the configuration asks for."""
        status, views = self._answerer.configuration.status, self._views
        metrics: dict[str, Page] = {"/metrics": self._metrics_page}
        if status.page:
            pages: dict[str, Page] = {"/": self._page, "/state": self._state, "/preview": self._preview}
            pages |= metrics | {"/map": views.map, "/view": views.view}
            actions: dict[str, Page] = {"/record": self._start_recording, "/threshold": self._change_threshold}
            yield HttpServer(status.page, "--status-page", pages, {"/stream": views.stream}, actions, self.token)
        if status.metrics:
            yield HttpServer(status.metrics, "--status-metrics", metrics)

    def show(self, answer: Answer) -> None:
        """Show an answer."""
        self._views.show(answer.detections)
        self._pose = _describe_pose(answer.orientation, self._answerer.configuration.pose.source)

    def _page(self, _: Query) -> Response:
        return Response("text/html; charset=utf-8", self._html)

    def _state(self, _: Query) -> Response:
        """The status of the daemon, and what runs, as JSON."""
        detector, configuration = self._answerer.detector, self._answerer.configuration
        name = threshold_name(detector)
        content = self._status() | {
            "model": Path(configuration.model).name,
            "camera": without_password(configuration.camera.source),
            "pose": self._pose,
            "temperatures": read_temperatures(),
            "threshold": {"name": name, "value": getattr(detector.settings, name)},
            "records": bool(configuration.recorder.folder),
        }
        return Response("application/json", to_json(content, allow_nan=False).encode())

    async def _preview(self, query: Query) -> Response:
        """The latest frame with the threshold of a query; null before the first one. Raises VisualMeshError."""
        async with self._previewing:
            await asyncio.sleep(max(self._next_preview - time.monotonic(), 0.0))
            detector, detections = self._answerer.detector, self._views.latest
            if detections is None:
                return Response("application/json", b"null")
            settings = with_threshold(detector, query.get("value", ""))
            started = time.monotonic()
            # Here, and not in a thread: the detector belongs to the thread of the loop.
            found = with_settings(detector, detections, settings)
            ended = time.monotonic()
            self._next_preview = ended + _REST * (ended - started)
        return await self._views.preview(found)

    def _metrics_page(self, _: Query) -> Response:
        return Response("text/plain; version=0.0.4", self._metrics().encode())

    def _start_recording(self, _: Query) -> Response:
        reply = self._record()
        if reply.startswith(REFUSED):
            raise InputError(reply.removeprefix(REFUSED))
        return _text(reply)

    def _change_threshold(self, query: Query) -> Response:
        """Use another threshold until the configuration is read again. Raises InputError."""
        detector = self._answerer.detector
        settings, name = with_threshold(detector, query.get("value", "")), threshold_name(detector)
        detector.settings = settings
        self._answerer.configuration = replace(self._answerer.configuration, detector=settings)
        value = getattr(settings, name)
        self._use_threshold(name, value)
        return _text(
            f"{name} = {value:g} until a restart or reload; to keep it, write it to [detector] in vm.toml. Recordings "
            "begin with this frame."
        )


def _text(text: str) -> Response:
    return Response("text/plain; charset=utf-8", f"{text}\n".encode())


def _describe_pose(orientation: Orientation, source: str) -> Message:
    """A pose: height [m], pitch and roll [degrees], and where it comes from."""
    return {
        "height": round(orientation.height, 3),
        "pitch": round(math.degrees(orientation.pitch), 1),
        "roll": round(math.degrees(orientation.roll), 1),
        "source": source,
    }
