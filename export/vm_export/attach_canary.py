"""The canary of a model file: searched by the file's own networks, and written there."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from vm_embedded.detection.detector import Detector
from vm_embedded.errors import InputError, ModelError, VisualMeshError
from vm_embedded.files import read_bytes
from vm_embedded.geometry.lens_files import LensFile, parse_lens_yaml, read_lens_file
from vm_embedded.live.proof import find_canary, prove
from vm_embedded.network.canary import CANARY_KEY, Canary
from vm_embedded.network.model_file import parse_model

from .metadata import with_metadata

_LARGEST = 2**20
"""Largest picture [bytes]: it becomes a part of the model file."""


class NotFoundError(InputError):
    """A picture in which the networks do not find every class."""


@dataclass(frozen=True, eq=False)
class CanaryPicture:
    """A picture for a canary. name: for messages. content: a JPEG or PNG file. camera: its lens and pose."""

    name: str
    content: bytes
    camera: LensFile

    @classmethod
    def read(cls, picture: Path, lens: Path) -> CanaryPicture:
        """Read the picture and its lens file. Raises InputError."""
        return cls(str(picture), read_bytes(picture, "canary", _LARGEST), read_lens_file(lens))

    @classmethod
    def of(cls, canary: Canary) -> CanaryPicture:
        """The picture of a canary. Raises InputError."""
        return cls("the canary of the model file", canary.picture, parse_lens_yaml(canary.lens))


def with_canary(content: bytes, picture: CanaryPicture) -> bytes:
    """A model file's bytes with a canary.

    Raises InputError for a picture that can't be searched, NotFoundError for one in which the networks do not find
    every class, and ModelError if the networks do not run.
    """
    model = parse_model("the new model", content)
    try:
        found = find_canary(Detector(model), picture.content, picture.camera)
    except ModelError:
        raise
    except VisualMeshError as error:
        raise InputError(f"{picture.name} can't be a canary: {error}") from error
    seen = {each.class_name for each in found.objects}
    for each in model.manifest.classes:
        if not (each.name in seen if each.kind == "object" else found.points[each.name]):
            raise NotFoundError(
                f"{picture.name} can't be a canary: the networks find no {each.name} in it; choose a picture in which "
                "they find every class"
            )
    made = with_metadata(content, {CANARY_KEY: found.as_json()})
    prove(parse_model("the new model", made))
    return made
