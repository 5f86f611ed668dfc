"""The lens and pose of a frame of files: its own, those of the file beside it, or those that the user gave."""

from __future__ import annotations

from dataclasses import dataclass

from ..cameras.frame_source import Frame
from ..cameras.image_files import lens_beside, lens_place
from ..errors import InputError
from ..geometry.lens import Lens, Size
from ..geometry.lens_files import read_lens_file
from ..geometry.orientation import Orientation
from ..live.configuration import Configuration


@dataclass(frozen=True)
class DefaultPose:
    """Lens and orientation of the user, for frames without their own. orientation: None if the user gave none."""

    given: Configuration
    orientation: Orientation | None

    def of(self, frame: Frame, size: Size) -> tuple[Lens, Orientation]:
        """Lens and orientation of a frame of a size [px]: its own, else those of the file beside it, else the user's.

        Raises InputError without one.
        """
        if frame.lens is not None and frame.orientation is not None:
            return frame.lens, frame.orientation
        lens, orientation = frame.lens or self.given.lens_for(size), frame.orientation or self.orientation
        beside = lens_beside(frame.path)
        if beside is not None:
            file = read_lens_file(beside)
            lens, orientation = file.lens, file.orientation or orientation
        if lens is None:
            options = "no lens: give --lens or --fov"
            if frame.path is None:
                raise InputError(options)
            place = lens_place(frame.path)
            beside_it = "lensNAME.yaml beside imageNAME" if place is None else f"{place.name} beside it"
            raise InputError(f"{options}, or put {beside_it}")
        if orientation is None:
            raise InputError("no orientation: give --height (and --pitch, --roll), or Hoc in the lens file")
        return lens, orientation

    def replaced_beside(self, frame: Frame) -> str:
        """What the lens file beside a frame replaces of what the user gave, as a remark; empty if nothing."""
        beside = lens_beside(frame.path)
        if beside is None:
            return ""
        lens = self.given.lens is not None or self.given.fov is not None
        pose = self.orientation is not None and read_lens_file(beside).orientation is not None
        replaced = [name for name, is_given in (("lens", lens), ("pose", pose)) if is_given]
        return f"{beside} replaces the given {' and '.join(replaced)}" if replaced else ""
