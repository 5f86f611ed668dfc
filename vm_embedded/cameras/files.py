"""Play video files and folders of images at their frame rate, as a camera would deliver them."""

from __future__ import annotations

import time
from collections.abc import Iterator

from ..errors import InputError
from ..geometry.lens_files import read_lens_file
from .camera import BrokenFrameError, CameraError, CameraSettings, Shot
from .frame_source import Frame
from .image_files import lens_beside, open_source

RATE = 30.0
"""Frame rate of files without their own [1/s]."""


class FileCamera:
    """Plays the frames that image_files.py reads. Raises CameraError if the source can't be opened."""

    def __init__(self, settings: CameraSettings, raw: bool = False) -> None:
        self.settings = settings
        self._raw = raw
        self._frames = self._open()
        self._due = time.monotonic()

    def _open(self) -> Iterator[Frame]:
        try:
            source = open_source(self.settings.source, self._raw, self.settings.max_megapixels)
        except InputError as error:
            raise CameraError(str(error)) from error
        self._period = 1.0 / (self.settings.fps or source.rate or RATE)
        return source.frames

    def read(self) -> Shot | None:
        """Return the next shot when it is due. Raises BrokenFrameError for an image that can't be read."""
        self._due = max(self._due + self._period, time.monotonic() - self._period)
        time.sleep(max(self._due - time.monotonic(), 0.0))
        frame = next(self._frames, None)
        if frame is None and self.settings.loop:
            self._frames = self._open()
            frame = next(self._frames, None)
        if frame is None:
            return None
        try:
            beside = lens_beside(frame.path)
            if beside is None:
                return Shot(frame.read(), self._due)
            file = read_lens_file(beside)
            return Shot(frame.read(), self._due, orientation=file.orientation, lens=file.lens)
        except InputError as error:
            raise BrokenFrameError(str(error)) from error

    def close(self) -> None:
        """Release the file."""
        self._frames = iter(())
