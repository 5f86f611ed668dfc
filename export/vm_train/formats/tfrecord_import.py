"""vm-train import: training data of the reference implementation, TFRecord files, as a folder of pictures.

From each record come image0000012.jpg or .png and mask0000012.png, byte for byte as the record has them, and
lens0000012.yaml. The number is the record's place in all files together, from 0, so that a record that is skipped
leaves a gap and an import that was stopped goes on. The image is written last: with it the picture is done.
import.json names the files and options, so that another import does not take these pictures for its own.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from vm_embedded.arrays import Image
from vm_embedded.cli.progress import ProgressBar
from vm_embedded.errors import InputError, VisualMeshError, unknown
from vm_embedded.files import written_beside
from vm_embedded.geometry.lens import projection_named
from vm_embedded.geometry.lens_files import lens_text
from vm_embedded.geometry.orientation import Orientation

from ..data.picture_files import IMAGES
from .tfexample import BytesList, Example, FloatList
from .tfrecord import read_records

FORMAT = 1
"""Of import.json."""

KEYS = (
    "image",
    "mask",
    "Hoc",
    "lens/projection",
    "lens/focal_length",
    "lens/fov",
    "lens/centre",
    "lens/k",
)
"""What the reference calls the features of an example."""

_SUFFIXES = {b"\xff\xd8\xff": ".jpg", b"\x89PNG\r\n\x1a\n": ".png"}
"""Of pictures, by their first bytes."""

EXIT_OK = 0

_SHOWN = 20  # faults; a wrong name makes one for each record
_LARGEST_NORMALISED = 10.0  # focal length in image widths: 6 degrees; in pixels no camera has so short a one


@dataclass(frozen=True)
class Imported:
    """What an import did.

    count: pictures written. skipped: a line for each record that is no picture, with file, record and fault.
    there: pictures that an earlier run wrote.
    """

    count: int
    skipped: tuple[str, ...]
    there: int


def parser() -> argparse.ArgumentParser:
    """The options of vm-train import FILES... OUT."""
    made = argparse.ArgumentParser(
        prog="vm-train import",
        description="Turn TFRecord files (plain or gzip) of the reference implementation into a folder of pictures: "
        "images and masks as they are, lens and pose in a file beside them. An import that was stopped goes on with "
        "the same command. Records that are no pictures are named and skipped.",
    )
    made.add_argument("files", type=Path, nargs="+", metavar="FILES", help="TFRecord files, in this order")
    made.add_argument("out", type=Path, metavar="OUT", help="folder to write to; made if it is not there")
    made.add_argument(
        "--key",
        type=_renamed,
        action="append",
        default=[],
        metavar="OURS=THEIRS",
        help=f"what the files call a feature, as in lens/fov=camera/field_of_view; ours are {', '.join(KEYS)}; "
        "give it once for each",
    )
    made.add_argument(
        "--normalised",
        action="store_true",
        help="focal length, centre and k of the files are for an image of width 1; default: pixels",
    )
    made.add_argument("--strict", action="store_true", help="stop at the first record that is no picture")
    return made


def _renamed(text: str) -> tuple[str, str]:
    ours, _, theirs = text.partition("=")
    if not theirs:
        raise argparse.ArgumentTypeError(f"{text!r} is no renaming; write OURS=THEIRS, as in lens/k=lens/distortion")
    if ours not in KEYS:
        raise argparse.ArgumentTypeError(unknown("key", ours, KEYS))
    return ours, theirs


def run(options: argparse.Namespace) -> int:
    """Import as the options say and return the exit status. Raises InputError, also if no picture came of it."""
    bar = ProgressBar(100)
    try:
        made = import_records(
            options.files,
            options.out,
            dict(options.key),
            options.normalised,
            options.strict,
            lambda share: bar.show(int(100 * share)),
        )
    finally:
        bar.clear()
    for fault in made.skipped[:_SHOWN]:
        print(f"vm-train: skipped {fault}", file=sys.stderr)
    if len(made.skipped) > _SHOWN:
        print(f"vm-train: skipped {len(made.skipped) - _SHOWN} more records", file=sys.stderr)
    if not made.count and not made.there:
        raise InputError(f"no picture could be imported from {', '.join(str(each) for each in options.files)}")
    before = f", {made.there} were there already" if made.there else ""
    skipped = f", {len(made.skipped)} records skipped" if made.skipped else ""
    print(f"{options.out}: {made.count} pictures imported{before}{skipped}")
    return EXIT_OK


def import_records(
    files: Sequence[Path],
    out: Path,
    renaming: Mapping[str, str],
    normalised: bool,
    strict: bool,
    report: Callable[[float], None],
) -> Imported:
    """Write the pictures of TFRecord files to a folder, those that are not there yet.

    renaming: what the files call features, by their name in KEYS. normalised: the numbers of lenses are for an image
    of width 1, not [px]. report: gets the share of the files' bytes that are read, 0 to 1, after each record.
    A record that lacks a feature or can't be decoded is skipped, or with `strict` raised as InputError. Always raised
    are files that can't be read on, lenses in the other unit, and a folder that holds something else.
    """
    for key in renaming:
        if key not in KEYS:
            raise InputError(unknown("key", key, KEYS))
    plan = _plan(files, renaming, normalised)
    wanted = _prepared(out, plan)
    sizes = [each["bytes"] for each in plan["files"]]
    number = count = there = 0
    skipped: list[str] = []
    for position, path in enumerate(files):
        before = sum(sizes[:position])
        for record in read_records(path):
            if _is_done(out, number):
                there += 1
            else:
                try:
                    content = _content(record.example(), renaming, normalised, record.where)
                except _WrongUnitError:
                    raise
                except VisualMeshError as error:
                    if strict:
                        raise
                    skipped.append(str(error))
                else:
                    if wanted is not None:
                        _write(out / "import.json", wanted.encode())
                        wanted = None
                    for name, data in content.named(number).items():
                        _write(out / name, data)
                    count += 1
            number += 1
            report((before + record.position) / sum(sizes))
    return Imported(count, tuple(skipped), there)


def _plan(files: Sequence[Path], renaming: Mapping[str, str], normalised: bool) -> dict[str, Any]:
    """What defines an import. Files are known by name and size, so that they may be moved."""
    try:
        named = [{"name": path.name, "bytes": path.stat().st_size} for path in files]
    except (OSError, ValueError) as error:  # ValueError: a path with a zero byte
        raise InputError(f"can't read {getattr(error, 'filename', None) or files}: {error}") from error
    return {"format": FORMAT, "files": named, "renaming": dict(renaming), "normalised": normalised}


def _prepared(out: Path, plan: dict[str, Any]) -> str | None:
    """The text that import.json has to get before the first picture; None if it is right as it is.

    Files may be appended to an import, or left out at its end. Raises InputError if the folder holds something else.
    """
    path = out / "import.json"
    try:
        out.mkdir(parents=True, exist_ok=True)
        if not path.exists():
            if any(each.name.startswith("image") and each.suffix.lower() in IMAGES for each in out.iterdir()):
                raise InputError(f"{out} holds pictures that are of no import: write to another folder")
            return _text(plan)
        found = json.loads(path.read_text(encoding="utf-8"))
        same = all(found[key] == plan[key] for key in ("format", "renaming", "normalised"))
        same &= all(old == new for old, new in zip(found["files"], plan["files"], strict=False))
        longer = len(plan["files"]) > len(found["files"])
    except OSError as error:
        raise InputError(f"can't use folder {out}: {error.strerror or error}") from error
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise InputError(f"{path} is damaged") from error
    if not same:
        raise InputError(
            f"{out} holds an import of other files, or with other options: go on with those of its import.json, "
            "or write to another folder"
        )
    return _text(plan) if longer else None


def _text(plan: dict[str, Any]) -> str:
    return json.dumps(plan, indent=1) + "\n"


def _is_done(out: Path, number: int) -> bool:
    images = (out / f"image{number:07d}{suffix}" for suffix in _SUFFIXES.values())
    others = (out / f"mask{number:07d}.png", out / f"lens{number:07d}.yaml")
    return any(each.is_file() for each in images) and all(each.is_file() for each in others)


def _write(path: Path, data: bytes) -> None:
    with written_beside(path) as part:
        part.write_bytes(data)


class _WrongUnitError(InputError):
    """A lens in image widths that was taken for pixels, or the other way round: all others will be wrong too."""


@dataclass(frozen=True)
class _Content:
    """A picture's files: image and mask as they were, the lens file's text. suffix: of the image."""

    image: bytes
    suffix: str
    mask: bytes
    lens: str

    def named(self, number: int) -> dict[str, bytes]:
        """The files by name, the image last."""
        return {
            f"mask{number:07d}.png": self.mask,
            f"lens{number:07d}.yaml": self.lens.encode(),
            f"image{number:07d}{self.suffix}": self.image,
        }


def _content(example: Example, renaming: Mapping[str, str], normalised: bool, where: str) -> _Content:
    """The picture that an example holds. Raises InputError beginning with `where`."""
    try:
        found = _Found(example, {key: renaming.get(key, key) for key in KEYS})
        image, suffix, size = found.picture("image", cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION)
        mask, mask_suffix, mask_size = found.picture("mask", cv2.IMREAD_UNCHANGED)
        if mask_suffix != ".png":
            raise InputError("mask is not a PNG file")
        if mask_size != size:
            shown = (f"{width} x {height}" for width, height in (mask_size, size))
            raise InputError(f"mask has {' px, but the image has '.join(shown)} px")
        return _Content(image, suffix, mask, found.lens(size[0], normalised))
    except VisualMeshError as error:
        # The same error with the place in front, still of its own kind where it stops the import.
        kind = _WrongUnitError if isinstance(error, _WrongUnitError) else InputError
        raise kind(f"{where}: {error}") from error


@dataclass(frozen=True)
class _Found:
    """An example, and what it calls the features of KEYS. Its methods raise VisualMeshError naming the feature."""

    example: Example
    names: Mapping[str, str]

    def __post_init__(self) -> None:
        # Old files have no lens/k. One that was renamed is there by the user's word.
        needed = {key: name for key, name in self.names.items() if (key, name) != ("lens/k", "lens/k")}
        missing = [key for key, name in needed.items() if name not in self.example]
        if missing:
            shown = (f"{key} (as {self.names[key]!r})" if self.names[key] != key else key for key in missing)
            raise InputError(
                f"lacks {', '.join(shown)}; it has {', '.join(repr(name)[:60] for name in sorted(self.example)[:20])}; "
                "rename with --key OURS=THEIRS"
            )

    def text(self, key: str) -> bytes:
        feature = self.example[self.names[key]]
        if not isinstance(feature, BytesList) or len(feature.values) != 1:
            raise InputError(f"{key} is not one string of bytes")
        return feature.values[0]

    def floats(self, key: str, count: int) -> tuple[float, ...]:
        feature = self.example[self.names[key]]
        if not isinstance(feature, FloatList) or len(feature.values) != count:
            raise InputError(f"{key} is not {count} floats")
        return feature.values

    def picture(self, key: str, how: int) -> tuple[bytes, str, tuple[int, int]]:
        """A picture's bytes, suffix, and width and height [px]."""
        data = self.text(key)
        suffix = next((suffix for start, suffix in _SUFFIXES.items() if data.startswith(start)), None)
        if suffix is None:
            raise InputError(f"{key} is neither a JPEG nor a PNG file")
        decoded: Image | None
        try:
            decoded = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), how)  # type: ignore[assignment]
        except cv2.error:
            decoded = None
        if decoded is None:
            raise InputError(f"{key} can't be decoded")
        if decoded.ndim != 3 or decoded.dtype != np.uint8:
            raise InputError(f"{key} is not an RGB or RGBA picture of 8 bits")
        return data, suffix, (decoded.shape[1], decoded.shape[0])

    def lens(self, width: int, normalised: bool) -> str:
        """The text of the lens file, in pixels of an image of this width [px]."""
        focal_length = self.floats("lens/focal_length", 1)[0]
        if 0.0 < focal_length < _LARGEST_NORMALISED and not normalised:
            raise _WrongUnitError(
                f"lens/focal_length is {focal_length:g}, too short for pixels: it seems to be for an image of width 1; "
                "if so, import with --normalised"
            )
        if focal_length >= _LARGEST_NORMALISED and normalised:
            raise _WrongUnitError(
                f"lens/focal_length is {focal_length:g}, too long for an image of width 1: it seems to be in pixels; "
                "if so, import without --normalised"
            )
        scale = float(width) if normalised else 1.0
        x, y = self.floats("lens/centre", 2)
        k0, k1 = self.floats("lens/k", 2) if self.names["lens/k"] in self.example else (0.0, 0.0)
        lens = projection_named(self.text("lens/projection").decode("ascii", "replace"))(
            focal_length=focal_length * scale,
            fov=self.floats("lens/fov", 1)[0],
            center=(x * scale, y * scale),
            distortion=(k0 / scale**2, k1 / scale**4),
        )
        hoc = np.array(self.floats("Hoc", 16)).reshape(4, 4)
        return lens_text(replace(lens, size=None), Orientation.from_hoc(hoc))
