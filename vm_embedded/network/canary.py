"""The canary of a model file: a small picture, and what the exporter's detector found in it."""

from __future__ import annotations

import base64
import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ..errors import ModelError

CANARY_KEY = "visual_mesh_canary"
"""Key of the canary in the metadata of a model file."""

PACKAGE_PICTURE = Path(__file__).parents[1] / "models" / "canary.jpg"
"""The picture of the package: a ball, lines, a goal post and robots on a field. Model files contain only its hash."""

_HASH = "sha256:"


@dataclass(frozen=True)
class CanaryObject:
    """An object in the picture. center (x, y) [px]. radius [px]: of a disk of the same area."""

    class_name: str
    center: tuple[float, float]
    radius: float


@dataclass(frozen=True)
class Canary:
    """A picture and what it shows.

    picture: a JPEG or PNG file. lens: the text of a lens file for it, with Hoc. objects: all that were found. points:
    number of mesh points of each class, by its name.
    """

    picture: bytes
    lens: str
    objects: tuple[CanaryObject, ...]
    points: Mapping[str, int]

    def as_json(self) -> str:
        """The canary as the model file holds it."""
        digest = hashlib.sha256(self.picture).hexdigest()
        in_package = self.picture == PACKAGE_PICTURE.read_bytes()
        picture = _HASH + digest if in_package else base64.b64encode(self.picture).decode()
        objects = [asdict(each) for each in self.objects]
        data = {"picture": picture, "lens": self.lens, "objects": objects, "points": dict(self.points)}
        return json.dumps(data, sort_keys=True, separators=(",", ":"))

    @classmethod
    def from_json(cls, text: str) -> Canary:
        """Inverse of `as_json`. Raises ModelError."""
        try:
            data = json.loads(text)
            return cls(
                _picture(_text(data["picture"])),
                _text(data["lens"]),
                tuple(_object(each) for each in data["objects"]),
                {_text(name): int(count) for name, count in data["points"].items()},
            )
        except (KeyError, TypeError, ValueError, OverflowError, AttributeError, RecursionError) as error:
            raise ModelError(f"its canary can't be read: {error}") from error


def _picture(text: str) -> bytes:
    """The picture from the JSON. Raises ValueError."""
    if not text.startswith(_HASH):
        return base64.b64decode(text, validate=True)
    picture = PACKAGE_PICTURE.read_bytes()
    if hashlib.sha256(picture).hexdigest() != text.removeprefix(_HASH):
        raise ValueError("its picture is not the one of this release; export the model again")
    return picture


def _object(data: Mapping[str, Any]) -> CanaryObject:
    """An object of the JSON. Raises KeyError, TypeError or ValueError."""
    (x, y), radius = data["center"], float(data["radius"])
    center = float(x), float(y)
    if not all(map(math.isfinite, (*center, radius))) or radius <= 0:
        raise ValueError(f"object at {center} px with a radius of {radius} px")
    return CanaryObject(_text(data["class_name"]), center, radius)


def _text(value: object) -> str:
    if not isinstance(value, str):
        raise TypeError(f"expected text, not {str(value)[:60]!r}")
    return value
