"""Frames to measure on: the 15 of the paper's dataset where they lie beside the checkout, else those of the demo."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from vm_embedded import Lens, Orientation, read_lens_file
from vm_embedded.arrays import Image
from vm_embedded.cameras.image_files import read_image

_TOP = Path(__file__).parents[1]


@dataclass(frozen=True)
class Frame:
    """A frame with all that a detector needs, and the files that it comes from."""

    path: Path
    lens_path: Path
    image: Image
    lens: Lens
    orientation: Orientation

    @property
    def name(self) -> str:
        return self.path.name

    @property
    def size(self) -> tuple[int, int]:
        return self.image.shape[1], self.image.shape[0]


def frames() -> tuple[str, list[Frame]]:
    """A description of the frames, and the frames.

    Those of the paper's tab:visualmesh_performance have 1280 x 1024 px, as the reference images do.
    """
    folder = frame_folder("reference/images")
    if folder is not None:
        return "the 15 reference images", read_frames(folder)
    return "the demo's frames, since the reference images are not there", demo_frames()


def frame_folder(name: str) -> Path | None:
    """A folder in ../shared; None if there is no ../shared. Raises SystemExit if VM_SHARED names another place that
    lacks it."""
    folder = Path(os.environ.get("VM_SHARED", _TOP.parent / "shared")) / name
    if "VM_SHARED" in os.environ and not folder.is_dir():
        raise SystemExit(f"VM_SHARED: there is no folder {folder}")
    return folder if folder.is_dir() else None


def demo_frames() -> list[Frame]:
    """The frames of the demo."""
    return read_frames(_TOP / "tests" / "fixtures" / "demo")


def read_frames(folder: Path) -> list[Frame]:
    """The frames of a folder."""
    found = []
    for path in sorted(folder.glob("image*.jpg")):
        lens_path = path.with_name(f"lens{path.stem[5:]}.yaml")
        file = read_lens_file(lens_path)
        assert file.orientation is not None
        found.append(Frame(path, lens_path, read_image(path), file.lens, file.orientation))
    return found
