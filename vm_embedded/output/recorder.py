"""The recorder: it keeps the last seconds in memory and writes them to disk on request.

A recording is a folder that vm-detect --camera reads like any folder of images. It holds lossless images, each with a
lens file for lens and pose; vm.toml with the settings; the network, unless it comes with the package; and
recording.jsonl with the messages. Running the detector on a recording gives the same detections to the last bit.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import cv2

from ..cameras.camera import Shot
from ..cameras.image_files import MESSAGES
from ..config.entries import check_entries, file_name, number, text_line
from ..errors import InputError
from ..geometry.lens import Lens
from ..geometry.lens_files import format_lens_file
from ..geometry.orientation import Orientation
from .ended import ended
from .messages import Message, to_json_line
from .recordings import begin_recording, delete_oldest_recordings, finish, finish_left_recordings
from .result_files import encode_png

CONFIGURATION = "vm.toml"

_LAST_FRAME = 0.3
"""How long a closed recorder waits for the frame that is being written [s]."""


@dataclass(frozen=True, kw_only=True)
class RecorderSettings:
    """Section [recorder]: where recordings go, their limits, and the class that triggers one."""

    folder: str = file_name("", "folder for recordings; each gets a subfolder; empty: no recordings")
    seconds: float = number(5.0, "length of a recording", "s", (0.1, 600))
    memory_mib: float = number(256.0, "memory for recent frames; a full memory shortens recordings", "MiB", (1, 65536))
    disk_mib: float = number(1024.0, "disk space for all recordings; the oldest are deleted", "MiB", (1, 1e6))
    trigger_class: str = text_line(
        "", "class whose detection triggers a recording, like signal USR1 and vm-detect --record"
    )
    pause: float = number(60.0, "shortest time between two recordings that the class triggers", "s", (0, 1e6))

    def __post_init__(self) -> None:
        check_entries(self)


@dataclass(frozen=True, eq=False)
class Moment:
    """A frame with its lens, orientation and message."""

    shot: Shot
    lens: Lens
    orientation: Orientation
    message: Message

    @property
    def nbytes(self) -> int:
        """Memory of the image and its JPEG [bytes]."""
        return self.shot.image.nbytes + len(self.shot.encoded or b"")


class Recorder:
    """Keeps the moments of the last seconds and writes them in a separate thread.

    files: those of a recording besides its frames, by name: vm.toml and a model. report: gets an event, its level and
    its detail; that thread calls it.
    """

    def __init__(
        self, settings: RecorderSettings, files: Mapping[str, bytes], report: Callable[[str, str, str], None]
    ) -> None:
        self.settings = settings
        self._files = files
        self._report = report
        self._moments: deque[Moment] = deque()
        self._nbytes = 0
        self._closing = False  # hurry up
        self._closed = False  # keep what is written, and end
        self._writer: threading.Thread | None = None
        self._last_trigger = -float("inf")  # when a class last triggered a recording [s]

    def keep(self, moment: Moment) -> None:
        """Keep a moment and drop those that are too old. Record if the trigger class was detected."""
        if not self.settings.folder:
            return
        self._moments.append(moment)
        self._nbytes += moment.nbytes
        self._drop_old(moment.shot.captured - self.settings.seconds)
        if self._moments and self._is_triggered(moment):
            self._last_trigger = time.monotonic()
            try:
                self.record()
            except InputError as error:
                self._report("not recorded", "warning", str(error))

    def _drop_old(self, oldest: float) -> None:
        """Drop the moments before a time [s], and more if they take too much memory."""
        most = 2**20 * self.settings.memory_mib
        while self._moments and (self._nbytes > most or self._moments[0].shot.captured < oldest):
            self._nbytes -= self._moments.popleft().nbytes

    def _is_triggered(self, moment: Moment) -> bool:
        """Whether a moment shows the trigger class, after the pause since the last recording that it triggered."""
        name = self.settings.trigger_class
        is_shown = bool(name) and any(each["class"] == name for each in moment.message["detections"])
        return is_shown and time.monotonic() - self._last_trigger >= self.settings.pause

    def record(self) -> str:
        """Start to write the kept moments, and return a line that says so. Raises InputError if it can't start."""
        if not self.settings.folder:
            raise InputError("recording is off: set [recorder] folder")
        if self._writer is not None and self._writer.is_alive():
            raise InputError("the previous recording is still being written; try again later")
        if not self._moments:
            raise InputError("no frame to record yet")
        try:
            part, lock = begin_recording(Path(self.settings.folder))
        except OSError as error:
            raise InputError(
                f"can't create a recording in {self.settings.folder}: {error.strerror or error}"
            ) from error
        folder, moments = part.with_suffix(""), list(self._moments)
        arguments = (folder, part, lock, moments, self._files)
        self._writer = threading.Thread(target=self._write, args=arguments, name="recorder", daemon=True)
        try:
            self._writer.start()
        except RuntimeError as error:  # the system gives no thread
            part.rmdir()
            lock.close()
            raise InputError(f"can't write a recording: {error}") from error
        return f"recording {len(moments)} frame{'s' if len(moments) > 1 else ''} to {folder}"

    def _write(
        self, folder: Path, part: Path, lock: ExitStack, moments: Sequence[Moment], files: Mapping[str, bytes]
    ) -> None:
        """Write a recording into the folder `part`, which is locked, and gets the name `folder` at the end.

        If it can't be completed, keep the frames that were written.

        Each frame's message follows its files at once, so vm-detect reads even the folder of a process that was killed.
        """
        try:
            with lock:
                self._fill(part, folder, moments, files)
        except OSError as error:
            self._report("recording failed", "error", f"{folder}: {error.strerror or error}")

    def _fill(self, part: Path, folder: Path, moments: Sequence[Moment], files: Mapping[str, bytes]) -> None:
        """Write the files of a recording into its folder, and finish it. Raises OSError if it can't be finished."""
        written, trouble = 0, ""
        try:
            for name, content in files.items():
                (part / name).write_bytes(content)
            with (part / MESSAGES).open("wb") as messages:
                for written, nbytes in enumerate(self._write_moments(part, moments), start=1):
                    messages.write(to_json_line(moments[written - 1].message))
                    messages.flush()
                    if nbytes > 2**20 * self.settings.disk_mib:
                        raise InputError(f"it is larger than [recorder] disk_mib, {self.settings.disk_mib:g} MiB")
                if self._closed:
                    raise InputError("the detector has stopped")
        except (OSError, InputError) as error:
            trouble = getattr(error, "strerror", None) or str(error)
        self._delete_oldest(finish(part, written))
        if written == 0:
            self._report("recording failed", "error", f"{folder}: {trouble}")
        elif written < len(moments):
            self._report("recorded", "warning", f"{folder}: only {written} of {len(moments)} frames: {trouble}")
        else:
            self._report("recorded", "info", str(folder))

    def _write_moments(self, part: Path, moments: Sequence[Moment]) -> Iterator[int]:
        """Write the files of each moment, and yield the size of all images so far [bytes]. Ends early when closed."""
        nbytes = 0
        for index, each in enumerate(moments):
            if self._closed:
                return
            nbytes += _write_moment(part, index, each, self._closing)
            yield nbytes

    def _delete_oldest(self, newest: Path | None = None) -> None:
        """Hold the limit of the disk space, and report what can't be deleted: the newest recording is complete."""
        folder, limit = Path(self.settings.folder), 2**20 * self.settings.disk_mib
        try:
            for each in delete_oldest_recordings(folder, limit, newest):
                self._report("not deleted", "warning", f"{each}: a part of it can't be deleted; remove it yourself")
        except OSError as error:
            self._report("not deleted", "warning", f"{folder}: {error.strerror or error}")

    def finish_left(self) -> None:
        """Finish the recordings of killed detectors, so that they count for the disk limit. Call it at the start."""
        if not self.settings.folder:
            return
        folder = Path(self.settings.folder)
        try:
            for path, result in finish_left_recordings(folder):
                if isinstance(result, OSError):
                    self._report("recording failed", "error", f"{path}: {result.strerror or result}")
                    continue
                done = f"only {result} frames" if result else "removed, because it has no frames"
                self._report("recorded", "warning", f"{path}: {done}: the detector was killed")
        except OSError as error:
            self._report("recording failed", "error", f"{folder}: {error.strerror or error}")
        if folder.is_dir():
            self._delete_oldest()

    def begin_anew(self, files: Mapping[str, bytes]) -> None:
        """Drop all moments, and use other files from now on: a recording has one vm.toml."""
        self._files = files
        self._moments.clear()
        self._nbytes = 0

    async def close(self, seconds: float) -> None:
        """Finish a recording in progress, without compression. After `seconds`, keep the frames that are written."""
        self._closing = True
        if self._writer is not None:
            await ended(self._writer, seconds)
            self._closed = True
            await ended(self._writer, _LAST_FRAME)


def _write_moment(folder: Path, index: int, moment: Moment, quick: bool) -> int:
    """Write image and lens file of a moment, and return the size of the image [bytes].

    quick: write a BMP, which takes a thirtieth of the time of a PNG.
    """
    encoded = moment.shot.encoded
    if encoded is not None:
        content, suffix = encoded, "jpg"
    elif quick:
        content, suffix = cv2.imencode(".bmp", moment.shot.image)[1].tobytes(), "bmp"
    else:
        content, suffix = encode_png(moment.shot.image), "png"
    (folder / f"image{index:07d}.{suffix}").write_bytes(content)
    (folder / f"lens{index:07d}.yaml").write_text(format_lens_file(moment.lens, moment.orientation), encoding="utf-8")
    return len(content)
