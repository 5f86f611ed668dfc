"""The last seconds, kept in memory, and written to disk when it was worth it.

A recording is a folder of images without loss, each with a lens file that says where the camera was, as vm-detect
--camera takes any folder; vm.toml with the network and the settings; and recording.jsonl with what was found. Detecting
in it again finds the same to the last bit.
"""

from __future__ import annotations

import shutil
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import cv2

from ..cameras.camera import Shot
from ..config.entries import check_entries, number, text_line
from ..errors import InputError
from ..geometry.lens import Lens
from ..geometry.lens_files import lens_text
from ..geometry.orientation import Orientation
from .messages import Message, to_json_line

_PNG = (cv2.IMWRITE_PNG_COMPRESSION, 1)
CONFIGURATION, MESSAGES = "vm.toml", "recording.jsonl"


@dataclass(frozen=True, kw_only=True)
class RecorderSettings:
    """Section [recorder]: what is kept, and when it is written."""

    folder: str = text_line("", "where recordings go, a folder each; none: nothing is kept")
    seconds: float = number(5.0, "how far back a recording reaches", "s", (0.1, 600))
    memory_mib: float = number(256.0, "memory for it; less far back once that is full", "MiB", (1, 65536))
    disk_mib: float = number(1024.0, "disk for all recordings; the oldest make room", "MiB", (1, 1e6))
    trigger_class: str = text_line("", "class whose sight makes a recording, as signal USR1 and vm-detect --record do")
    pause: float = number(60.0, "shortest time between two recordings that a class makes", "s", (0, 1e6))

    def __post_init__(self) -> None:
        check_entries(self)


@dataclass(frozen=True, eq=False)
class Moment:
    """A frame with all that its detections came from, and the message about them."""

    shot: Shot
    lens: Lens
    orientation: Orientation
    message: Message

    @property
    def nbytes(self) -> int:
        """Memory that it takes."""
        return self.shot.image.nbytes + len(self.shot.encoded or b"")


class Recorder:
    """Keeps moments, and writes them in a thread of its own.

    report: takes an event and what belongs to it, in that thread.
    """

    def __init__(self, settings: RecorderSettings, report: Callable[[str, str], None]) -> None:
        self.settings = settings
        self._report = report
        self._moments: deque[Moment] = deque()
        self._nbytes = 0
        self._ends = False
        self._writing: threading.Thread | None = None
        self._last = -float("inf")  # when a class last made a recording

    def keep(self, moment: Moment, configuration: str) -> None:
        """Keep a moment, let go of those that are too old, and record if its class is the one that is waited for."""
        if not self.settings.folder:
            return
        self._moments.append(moment)
        self._nbytes += moment.nbytes
        oldest = moment.shot.captured - self.settings.seconds
        while self._nbytes > 2**20 * self.settings.memory_mib or self._moments[0].shot.captured < oldest:
            self._nbytes -= self._moments.popleft().nbytes
            if not self._moments:
                return
        wanted = self.settings.trigger_class
        if wanted and any(each["class"] == wanted for each in moment.message["detections"]):
            now = time.monotonic()
            if now - self._last >= self.settings.pause:
                self._last = now
                with suppress(InputError):
                    self.record(configuration)

    def record(self, configuration: str) -> str:
        """Begin to write what is kept, with a vm.toml, and say so. Raises InputError if nothing is written."""
        if not self.settings.folder:
            raise InputError("nothing is kept: [recorder] has no folder")
        if self._writing is not None and self._writing.is_alive():
            raise InputError("the last recording is still being written")
        if not self._moments:
            raise InputError("nothing is kept yet")
        now = time.time()
        name = f"{time.strftime('%Y-%m-%dT%H-%M-%S', time.localtime(now))}.{int(1e3 * now) % 1000:03d}"
        folder = Path(self.settings.folder) / name
        moments = list(self._moments)
        arguments = (folder, moments, configuration)
        self._writing = threading.Thread(target=self._write, args=arguments, name="recorder", daemon=True)
        self._writing.start()
        return f"recording {len(moments)} frames to {folder}"

    def _write(self, folder: Path, moments: Sequence[Moment], configuration: str) -> None:
        part = folder.with_name(folder.name + ".part")
        try:
            part.mkdir(parents=True)
            written = 0
            for index, each in enumerate(moments):
                if self._ends:
                    raise InputError("the detector stops")
                written += _write_moment(part, index, each)
                if written > 2**20 * self.settings.disk_mib:
                    raise InputError(f"more than {self.settings.disk_mib:g} MiB")
            (part / CONFIGURATION).write_text(configuration, encoding="utf-8")
            (part / MESSAGES).write_bytes(b"".join(to_json_line(each.message) for each in moments))
            part.rename(folder)
            delete_oldest_recordings(folder.parent, 2**20 * self.settings.disk_mib)
        except (OSError, InputError) as error:
            shutil.rmtree(part, ignore_errors=True)
            self._report("recording failed", f"{folder}: {getattr(error, 'strerror', None) or error}")
        else:
            self._report("recorded", str(folder))

    def forget(self) -> None:
        """Let go of all moments, because what follows comes of other settings."""
        self._moments.clear()
        self._nbytes = 0

    def close(self, seconds: float) -> None:
        """Give up a recording that is being written, and wait so long until its half is removed."""
        self._ends = True
        if self._writing is not None:
            self._writing.join(seconds)


def _write_moment(folder: Path, index: int, moment: Moment) -> int:
    """Write image and lens file, and return the bytes of the image."""
    encoded = moment.shot.encoded
    if encoded is None:
        content, suffix = cv2.imencode(".png", moment.shot.image, _PNG)[1].tobytes(), "png"
    else:
        content, suffix = encoded, "jpg"
    (folder / f"image{index:07d}.{suffix}").write_bytes(content)
    (folder / f"lens{index:07d}.yaml").write_text(lens_text(moment.lens, moment.orientation), encoding="utf-8")
    return len(content)


def delete_oldest_recordings(folder: Path, limit: float) -> None:
    """Remove the oldest recordings of a folder until the others take no more than `limit` [bytes]."""
    recordings = sorted(each for each in folder.iterdir() if (each / MESSAGES).is_file())
    sizes = [sum(file.stat().st_size for file in each.iterdir()) for each in recordings]
    while len(recordings) > 1 and sum(sizes) > limit:
        shutil.rmtree(recordings.pop(0), ignore_errors=True)
        sizes.pop(0)
