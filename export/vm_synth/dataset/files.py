"""The folder that vm-synth writes: for each picture its image, masks, lens with pose, and truth.

image0000012.jpg, mask0000012.png, lens0000012.yaml    as the reference has them
coverage0000012.png                                    share of each pixel that the ball covers, 0 to 255
scene0000012.json                                      what the picture shows; written last: with it the picture is done
set.json                                               seed, count, configuration and maps of the whole set
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from vm_embedded.arrays import Image
from vm_embedded.errors import InputError
from vm_embedded.files import atomic_write
from vm_embedded.geometry.lens_files import lens_text
from vm_workstation.sphere_outline import polygon_area, sphere_outline

from ..render.image_processing import encode_jpeg, process_image
from ..render.picture import UNLABELED, Picture
from ..scene.configuration import CLASSES, SceneConfiguration
from ..scene.scene import PlacedBall, Scene

FORMAT = 1
"""Of set.json and the scenes' files."""

COLORS = {
    "ball": (255, 0, 0),
    "goal": (255, 255, 0),
    "line": (255, 255, 255),
    "field": (0, 255, 0),
    "environment": (0, 0, 0),
    "robot": (0, 0, 255),
}
"""RGB colors of the classes in masks; transparent is unlabeled."""

PARTS = {"image": ".jpg", "mask": ".png", "coverage": ".png", "lens": ".yaml", "scene": ".json"}
"""Files of a picture and their suffixes; the last one is written last."""


def file_of(folder: Path, part: str, index: int) -> Path:
    """The path of a picture's part, one of PARTS."""
    return folder / f"{part}{index:07d}{PARTS[part]}"


def is_done(folder: Path, index: int) -> bool:
    """Whether a picture is complete: all its parts are there, none of them empty."""
    paths = (file_of(folder, part, index) for part in PARTS)
    return all(path.is_file() and path.stat().st_size > 0 for path in paths)


def indices_in(folder: Path) -> list[int]:
    """Numbers of all complete pictures of a folder."""
    names = (path.stem.removeprefix("scene") for path in folder.glob("scene*.json"))
    return sorted(int(name) for name in names if name.isdecimal())


@dataclass(frozen=True)
class Plan:
    """What defines a set: the same plan gives the same pictures.

    maps: names of maps, each with the SHA-256 of its file.
    """

    seed: int
    count: int
    configuration: SceneConfiguration
    maps: dict[str, str]

    def as_json(self) -> str:
        return json.dumps({"format": FORMAT, **asdict(self)}, indent=1, sort_keys=True) + "\n"

    def write(self, folder: Path) -> None:
        """Write set.json, or check that the folder's own is of the same set, which may have another count.

        Raises InputError naming what differs.
        """
        path = folder / "set.json"
        wanted = json.loads(self.as_json())
        if path.exists():
            found = read_plan(folder)
            for key in ("format", "seed", "maps", "configuration"):
                if found.get(key) != wanted[key]:
                    shown = f"{found.get(key)}, not {wanted[key]}" if key in ("format", "seed") else "another one"
                    raise InputError(
                        f"{folder} holds a set whose {key} is {shown}: continue it with what it was begun with, "
                        "or write to another folder"
                    )
            if found.get("count", 0) >= self.count:
                return
        elif strangers := sorted(each for part, suffix in PARTS.items() for each in folder.glob(f"{part}*{suffix}")):
            raise InputError(
                f"{folder} holds {strangers[0].name} and no set.json, so it is no set of vm-synth: pictures would be "
                "lost or mixed; write to another folder"
            )
        with atomic_write(path) as part:
            part.write_text(self.as_json(), encoding="utf-8")


def read_plan(folder: Path) -> dict[str, Any]:
    """The set.json of a folder. Raises InputError."""
    path = folder / "set.json"
    try:
        return _read_table(path)
    except OSError as error:
        raise InputError(f"{folder} holds no set: can't read {path.name}: {error.strerror or error}") from error


def read_truth(folder: Path, index: int) -> dict[str, Any]:
    """What a picture shows, as `truth` gave it. Raises InputError."""
    path = file_of(folder, "scene", index)
    try:
        return _read_table(path)
    except OSError as error:
        raise InputError(f"can't read {path}: {error.strerror or error}") from error


def _read_table(path: Path) -> dict[str, Any]:
    """The table of a JSON file. Raises InputError if it holds none, and OSError."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path} is damaged: {error}") from error
    if not isinstance(found, dict):
        raise InputError(f"{path} is damaged: it holds no table")
    return found


def digest(path: Path) -> str:
    """SHA-256 of a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def write_picture(folder: Path, index: int, map_name: str, scene: Scene, picture: Picture) -> None:
    """Write all parts of a picture, each beside and renamed, the scene last. Raises InputError if it can't."""
    image = process_image(picture.radiance, scene.sensor)
    contents = {
        "image": encode_jpeg(image, scene.sensor),
        "mask": _png(mask_colors(picture)),
        "coverage": _png(np.rint(picture.coverage * 255.0).astype(np.uint8)),
        "lens": lens_text(replace(scene.lens, size=None), scene.orientation).encode(),
        "scene": (json.dumps(truth(index, map_name, scene, picture), allow_nan=False) + "\n").encode(),
    }
    for part, content in contents.items():
        with atomic_write(file_of(folder, part, index)) as path:
            path.write_bytes(content)


def mask_colors(picture: Picture) -> Image:
    """Classes as BGRA colors (h, w, 4), transparent where unlabeled."""
    table = np.zeros((256, 4), dtype=np.uint8)
    for number, name in enumerate(CLASSES):
        table[number] = (*COLORS[name][::-1], 255)
    table[UNLABELED] = 0
    return table[picture.classes]


def _png(image: Image) -> bytes:
    return cv2.imencode(".png", image, [cv2.IMWRITE_PNG_COMPRESSION, 6])[1].tobytes()


def truth(index: int, map_name: str, scene: Scene, picture: Picture) -> dict[str, Any]:
    """What a picture shows, for its JSON file: lengths [m], angles [rad], pixels [px], world frame under the camera."""
    return {
        "index": index,
        "map": map_name,
        "ground": "photographed" if scene.field is None else "field",
        "height": scene.orientation.height,
        "pitch": scene.orientation.pitch,
        "roll": scene.orientation.roll,
        "ball_radius": scene.ball_radius,
        "ball": None if scene.ball is None else _ball_truth(scene, scene.ball, picture),
        "other_ball": None
        if scene.other is None
        else {**_placed(scene.other), "label": scene.other_label, "design": asdict(scene.other.design)},
        "field": None if scene.field is None else _finite(asdict(scene.field)),
        "things": list(scene.names),
        "sensor": asdict(scene.sensor),
        "seed": scene.seed,
    }


def _placed(ball: PlacedBall) -> dict[str, Any]:
    return {
        "center": [float(each) for each in ball.center],
        "radius": ball.radius,
        "distance": float(np.hypot(*ball.center[:2])),
    }


def _ball_truth(scene: Scene, ball: PlacedBall, picture: Picture) -> dict[str, Any]:
    pixels = sphere_outline(scene.lens, scene.orientation, ball.center, ball.radius, scene.size, unseen=True)
    toward = (ball.center - scene.camera) @ scene.orientation.rotation
    center = scene.lens.project((toward / np.linalg.norm(toward))[None], scene.size)[0]
    area = polygon_area(pixels)
    return {
        **_placed(ball),
        "pixel": [float(each) for each in center],
        "pixel_radius": math.sqrt(area / math.pi),
        "visible": float(min(picture.coverage.sum(dtype=np.float64) / max(area, 1e-9), 1.0)),
        "design": asdict(ball.design),
    }


def _finite(table: dict[str, Any]) -> dict[str, Any]:
    """The same table with null for infinity, which JSON does not have."""
    return {name: None if value in (math.inf, -math.inf) else value for name, value in table.items()}


def shard_of(indices: Sequence[int], number: int, count: int) -> list[int]:
    """Those indices that shard `number` of `count` renders, 1 to count."""
    return [index for index in indices if index % count == number - 1]
