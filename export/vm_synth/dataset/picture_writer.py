"""Writes a rendered picture with its masks, lens and scene description.

The paper's pictures come with masks and poses, too (section "Dataset").
"""

from __future__ import annotations

import json
import math
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from vm_embedded.arrays import Image
from vm_embedded.files import write_file
from vm_embedded.geometry.lens_files import format_lens_file
from vm_workstation.outlines import polygon_area, sphere_outline

from ..render.image_processing import encode_jpeg, process_image
from ..render.picture import UNLABELED, Render
from ..scene.configuration import CLASSES
from ..scene.scene import PlacedBall, Scene
from ..scene.standing import standing_objects
from .files import CLASS_COLORS, file_of


def write_picture(folder: Path, index: int, map_name: str, scene: Scene, picture: Render) -> None:
    """Write all files of a picture atomically, scene*.json last. Raises InputError if that fails."""
    image = process_image(picture.radiance, scene.sensor)
    contents = {
        "image": encode_jpeg(image, scene.sensor),
        "mask": _png(mask_colors(picture)),
        "coverage": _png(np.rint(picture.coverage * 255.0).astype(np.uint8)),
        "lens": format_lens_file(replace(scene.lens, size=None), scene.orientation).encode(),
        "scene": (json.dumps(scene_description(index, map_name, scene, picture), allow_nan=False) + "\n").encode(),
    }
    for part, content in contents.items():
        write_file(file_of(folder, part, index), content)


def mask_colors(picture: Render) -> Image:
    """The classes as BGRA colors (h, w, 4); unlabeled pixels are transparent."""
    table = np.zeros((256, 4), dtype=np.uint8)
    for number, name in enumerate(CLASSES):
        table[number] = (*CLASS_COLORS[name][::-1], 255)
    table[UNLABELED] = 0
    return table[picture.classes]


def _png(image: Image) -> bytes:
    return cv2.imencode(".png", image, [cv2.IMWRITE_PNG_COMPRESSION, 6])[1].tobytes()


def scene_description(index: int, map_name: str, scene: Scene, picture: Render) -> dict[str, Any]:
    """The content of scene*.json: lengths [m], angles [rad], pixels [px].

    The origin of the world frame is on the plane below the camera.
    """
    return {
        "index": index,
        "map": map_name,
        "ground": _ground(scene),
        "height": scene.orientation.height,
        "pitch": scene.orientation.pitch,
        "roll": scene.orientation.roll,
        "ball_radius": scene.ball_radius,
        "ball": None if scene.ball is None else _ball_description(scene, scene.ball, picture),
        "other_ball": None
        if scene.other is None
        else {**_ball_position(scene.other), "label": scene.other_label, "design": asdict(scene.other.design)},
        **_object_descriptions(scene, picture),
        "field": None if scene.field is None else _finite(asdict(scene.field)),
        "things": list(scene.names),
        "standing": [asdict(each) for each in standing_objects(scene)],
        "sensor": asdict(scene.sensor),
        "seed": scene.seed,
    }


def _ball_position(ball: PlacedBall) -> dict[str, Any]:
    return {
        "center": [float(each) for each in ball.center],
        "radius": ball.radius,
        "distance": float(np.hypot(*ball.center[:2])),
    }


def _ball_description(scene: Scene, ball: PlacedBall, picture: Render) -> dict[str, Any]:
    pixels = sphere_outline(scene.lens, scene.orientation, ball.center, ball.radius, scene.size, unseen=True)
    toward = (ball.center - scene.camera) @ scene.orientation.rotation
    center = scene.lens.project((toward / np.linalg.norm(toward))[None], scene.size)[0]
    area = polygon_area(pixels)
    return {
        **_ball_position(ball),
        "pixel": [float(each) for each in center],
        "pixel_radius": math.sqrt(area / math.pi),
        "visible": float(min(picture.coverage.sum(dtype=np.float64) / max(area, 1e-9), 1.0)),
        "design": asdict(ball.design),
    }


def _ground(scene: Scene) -> str:
    if scene.surface is not None:
        return "table" if scene.surface.is_table else "floor"
    return "photographed" if scene.field is None else "field"


def _object_descriptions(scene: Scene, picture: Render) -> dict[str, Any]:
    """The entries of objects that are not the ball; none if the object to detect is the ball."""
    if scene.surface is None:
        return {}
    described = []
    for number, each in enumerate(scene.objects):
        pixel, area = _hull_area(scene, number)
        described.append(
            {
                "center": [float(value) for value in each.center],
                "radius": each.radius,
                "height": each.height,
                "distance": float(np.hypot(*each.center[:2])),
                "pixel": pixel,
                "pixel_radius": math.sqrt(area / math.pi),
                "visible": float(min(picture.areas[number] / max(area, 1e-9), 1.0)),
            }
        )
    return {
        "object": {"name": scene.object_name, "radius": scene.ball_radius, "height": scene.object_height},
        "objects": described,
    }


def _hull_area(scene: Scene, number: int) -> tuple[list[float], float]:
    """Where the center of an object is in the picture [px], and the area of its convex hull there [px^2]."""
    start = sum(scene.counts[:number])
    vertices = scene.mesh.vertices[start : start + scene.counts[number]]
    points = np.concatenate([scene.objects[number].center[None], vertices]) - scene.camera
    rays = (points @ scene.orientation.rotation) / np.linalg.norm(points, axis=1, keepdims=True)
    pixels = scene.lens.project(rays, scene.size)
    hull = cv2.convexHull(pixels[1:].astype(np.float32))[:, 0]
    return [float(value) for value in pixels[0]], polygon_area(hull.astype(np.float64))


def _finite(table: dict[str, Any]) -> dict[str, Any]:
    """The same table with None in place of infinity, which JSON lacks."""
    return {name: None if value in (math.inf, -math.inf) else value for name, value in table.items()}
