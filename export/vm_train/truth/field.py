"""The true field features of a picture: posts, robots, lines and border, from vm-synth's sceneX.json and the mask."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from vm_embedded.arrays import Floats, Mask
from vm_embedded.errors import InputError
from vm_embedded.files import exists, read_regular

from ..data.pictures import Picture
from ..scores.border_scores import distances_along
from ..scores.field_scores import FieldTruth, TrueField
from ..scores.line_shapes import Lines
from ..scores.upright_scores import TrueUpright
from .field_model import FieldModel
from .ground_view import GroundView

CLASSES = ("goal", "line", "field", "robot")
"""Classes that a network needs for scores of field features."""

KINDS = ("post", "robot", "person")

FARTHEST = 12.0
"""Distance up to which the border counts [m]: one pixel is too many meters beyond."""

_NEAR = 2
"""Distance from a pixel of a class within which the mask shows something of this class [px]."""

_FOOT = 0.2
"""Share of a robot's height that counts as its foot."""

_FOOT_SHOWN = 0.05
"""Least share of the outline of a robot's foot that shows a robot, if the foot is visible. Much of the outline is
field: between two legs, and below the body of a robot that lies on the ground."""

_FAR_OUTSIDE = 1e4
"""Pixels of this size are too far outside of the picture to draw with them [px]."""

_STEP = math.radians(2.0)
"""Angle between directions of the border."""


@dataclass(frozen=True)
class Standing:
    """A goal post, robot or person: kind, base (2,) [m] in the frame of the picture's orientation, width and height
    [m]."""

    kind: str
    base: tuple[float, float]
    width: float
    height: float


@dataclass(frozen=True)
class FieldScene:
    """What a scene file tells about the field.

    standing: what stands on it, or None if the file lacks it, as those of older versions do. has_field: whether the
    file tells about a field. field: the field, or None if there is none.
    """

    standing: tuple[Standing, ...] | None
    has_field: bool
    field: FieldModel | None


def read_field(path: Path) -> FieldScene | None:
    """What a sceneX.json tells about the field; None if the file is missing. Raises InputError naming file and
    fault."""
    if not exists(path):
        return None
    try:
        table = json.loads(read_regular(path))
        standing = table.get("standing")
        found = None if standing is None else tuple(map(_standing, standing))
        model = table.get("field")
        return FieldScene(found, "field" in table, None if model is None else FieldModel.from_table(model))
    except (OSError, AttributeError, KeyError, TypeError, ValueError, OverflowError, RecursionError) as error:
        raise InputError(f"{path.name}: is not a scene file of vm-synth: {error!r}") from error


def _standing(table: dict[str, Any]) -> Standing:
    x, y = map(float, table["base"])
    found = Standing(str(table["kind"]), (x, y), float(table["width"]), float(table["height"]))
    if found.kind not in KINDS:
        raise ValueError(f"unknown kind {found.kind!r} in standing")
    numbers = (x, y, found.width, found.height)
    if not (all(map(math.isfinite, numbers)) and found.width > 0.0 and found.height > 0.0):
        raise ValueError(f"a number of a {found.kind} in standing is out of range")
    return found


def field_truth(picture: Picture, scene: FieldScene | None, classes: Sequence[str]) -> FieldTruth:
    """The true field features of a picture. classes: names in the order of the labels; they include CLASSES."""
    view = GroundView.of(picture)
    line = picture.labels == classes.index("line")
    field = _true_field(view, line, scene.field) if scene is not None and scene.has_field else None
    return FieldTruth(true_uprights(picture, scene, classes), field, view.shows)


def true_uprights(
    picture: Picture, scene: FieldScene | None, classes: Sequence[str]
) -> dict[str, Sequence[TrueUpright]] | None:
    """What stands on the plane, by kind; None if no scene file tells.

    classes: names in the order of the labels. A class that is missing there hides no foot and shows no post.
    """
    if scene is None or scene.standing is None:
        return None
    view = GroundView.of(picture)
    nowhere = np.zeros(picture.labels.shape, dtype=np.bool_)
    by_name = dict.fromkeys(CLASSES, nowhere)
    by_name |= {name: picture.labels == number for number, name in enumerate(classes) if name in CLASSES}
    return {kind: _uprights(view, by_name, scene.standing, kind) for kind in KINDS}


def _uprights(view: GroundView, by_name: dict[str, Mask], standing: Iterable[Standing], kind: str) -> list[TrueUpright]:
    chosen = [each for each in standing if each.kind == kind]
    found = []
    for each in chosen:
        base = np.array(each.base)
        visible = kind != "person" and bool(view.shows(base[None])[0])
        if visible and kind == "post":
            visible = _shown_at(by_name["goal"], view.pixels(base[None]))[0]
        elif visible:
            visible = _shows_foot(by_name, _outline(view, each, _FOOT * each.height))
        hidden = visible and any(_covers(view, other, each) for other in chosen)
        found.append(TrueUpright(base, each.width, bool(visible and not hidden)))
    return found


def _shown_at(shown: Mask, pixels: Floats) -> Mask:
    """Whether a mask (h, w) has a pixel near each of the pixels (n, 2), which are inside the picture."""
    side = 2 * _NEAR + 1
    wide = cv2.dilate(shown.astype(np.uint8), cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side)))
    x, y = np.rint(pixels).astype(np.intp).T
    return np.asarray(wide[y, x] > 0)


def _outline(view: GroundView, upright: Standing, height: float) -> Floats:
    """Pixels (4, 2) of an upright board at the base, as wide as the upright and up to a height [m]."""
    base = np.array(upright.base)
    across = np.array([-base[1], base[0]]) / max(math.hypot(*base), 1e-9) * upright.width / 2.0
    ends = np.array([base - across, base + across])
    return np.concatenate([view.pixels(ends), view.pixels(ends[::-1], height)])


def _shows_foot(by_name: dict[str, Mask], outline: Floats) -> bool:
    """Whether the outline (4, 2) of a robot's foot shows more of the robot than of what may hide it.

    Robots and the field's colors hide nothing there; a ball, a goal, a person or a thing does.
    """
    if not np.isfinite(outline).all() or np.abs(outline).max() > _FAR_OUTSIDE:
        return False
    inside = np.zeros(by_name["robot"].shape, dtype=np.uint8)
    cv2.fillConvexPoly(inside, np.rint(outline).astype(np.int32), 1)
    robot, field, line = (float(by_name[name][inside > 0].mean()) for name in ("robot", "field", "line"))
    return robot >= max(_FOOT_SHOWN, 1.0 - robot - field - line)


def _covers(view: GroundView, other: Standing, upright: Standing) -> bool:
    """Whether another upright of the same class stands nearer and in front of the base."""
    if other is upright or math.hypot(*other.base) >= math.hypot(*upright.base):
        return False
    outline, base = _outline(view, other, other.height), view.pixels(np.array(upright.base)[None])[0]
    if not np.isfinite(outline).all():
        return False
    return cv2.pointPolygonTest(outline.astype(np.float32), (float(base[0]), float(base[1])), False) >= 0.0


def _true_field(view: GroundView, line: Mask, model: FieldModel | None) -> TrueField:
    if model is None:
        return TrueField(Lines(np.zeros((0, 2, 2))), np.zeros((0, 2)), np.zeros(0), np.zeros(0))
    lines = model.lines()
    samples = lines.samples()
    samples = samples[view.shows(samples)]
    visible = samples[_shown_at(line, view.pixels(samples))]
    directions, distances = _true_border(view, model)
    return TrueField(lines, visible, directions, distances)


def _true_border(view: GroundView, model: FieldModel) -> tuple[Floats, Floats]:
    """Directions (b,) [rad] and distances (b,) [m] where the edge of the carpet is inside the picture and not too far.

    The edge follows from the field. The mask would give the same edge to within a pixel, except where something hides
    it; a reported border bridges such gaps, too.
    """
    directions = np.arange(-math.pi, math.pi - 1e-9, _STEP)
    carpet = model.carpet()
    if carpet is None:
        return directions[:0], directions[:0]
    distances = distances_along(carpet, directions)
    near = np.flatnonzero(distances <= FARTHEST)  # NaN is not
    ends = distances[near, None] * np.column_stack([np.cos(directions[near]), np.sin(directions[near])])
    kept = near[view.shows(ends)]
    return directions[kept], distances[kept]
