"""The proof that a model file works: its self-tests, and its canary, found end to end."""

from __future__ import annotations

import math

from ..cameras.decoding import decode
from ..detection.detection import Detection
from ..detection.detector import Detector
from ..detection.settings import Settings
from ..errors import ModelError, VisualMeshError
from ..geometry.lens_files import LensFile, format_lens_file, parse_lens_yaml
from ..network.canary import Canary, CanaryObject
from ..network.look_contract import LookContract
from ..network.manifest import Manifest
from ..network.model_file import ModelFile

_MOST_MEGAPIXELS = 2.0
"""Largest picture of a canary [Mpx]: a small one is quick to search."""

_OFF_CENTER, _OFF_SIZE = 0.5, 0.25
"""Largest differences of an object's center [its radii] and of its radius [share] from what the exporter saw."""

_OFF_POINTS, _FEW = 0.2, 5
"""Largest difference of a class's number of points from what the exporter saw: a share, or a few if they are few."""


def prove(model: ModelFile) -> str:
    """Run a model's self-tests and search its canary's picture with default settings; say what was proved.

    Raises ModelError if a self-test or an object of the canary is missing, or has another answer than the exporter saw.
    """
    manifest = model.manifest
    parts: dict[str, Manifest | LookContract] = {"mesh network": manifest}
    if manifest.look is not None:
        parts["close look"] = manifest.look
    for name, part in parts.items():
        if not part.self_test:
            raise ModelError(f"{model.path}: its {name} has no self-test; export it again")
    detector = Detector(model, Settings())  # which runs the self-tests
    if model.canary is None:
        return "self-test passed, no canary"
    expected = model.canary
    try:
        found = find_canary(detector, expected.picture, parse_lens_yaml(expected.lens))
    except VisualMeshError as error:
        raise ModelError(f"{model.path}: its canary can't be searched: {error}") from error
    difference = _difference(found, expected)
    if difference:
        raise ModelError(f"{model.path}: it does not find its canary: {difference}")
    return f"self-test passed, canary found ({_in_words(expected)})"


def find_canary(detector: Detector, picture: bytes, camera: LensFile) -> Canary:
    """The canary of a picture: what the detector finds in it.

    Raises InputError or ModelError for a picture that can't be searched, GeometryError for a camera that is too low.
    """
    if camera.orientation is None:
        raise ModelError("the lens file of a canary needs Hoc, the camera's pose")
    found = detector.detect(decode(picture, max_megapixels=_MOST_MEGAPIXELS), camera.orientation, camera.lens)
    objects = tuple(_rounded(each) for each in found)
    points = {each.name: len(found.points_of(each.name)) for each in detector.manifest.classes}
    return Canary(picture, format_lens_file(camera.lens, camera.orientation), objects, points)


def _rounded(found: Detection) -> CanaryObject:
    """Rounded to a tenth of a pixel: processors differ in the last digits, but the file shall be the same."""
    (x, y), radius = found.center, found.radius
    return CanaryObject(found.class_name, (round(float(x), 1), round(float(y), 1)), round(radius, 1))


def _in_words(canary: Canary) -> str:
    """What a canary shows: the number of objects of each class, and of points of the other classes."""
    names = [each.class_name for each in canary.objects]
    objects = [f"{names.count(name)} {name}" for name in dict.fromkeys(names)]
    points = [f"{count} points of {name}" for name, count in canary.points.items() if name not in names]
    return ", ".join(objects + points)


def _difference(found: Canary, expected: Canary) -> str:
    """What is different in the answer; empty if nothing is."""
    left = list(found.objects)
    for each in expected.objects:
        same = next((other for other in left if _is_same(other, each)), None)
        x, y = each.center
        if same is None:
            return f"no {each.class_name} at ({x:.0f}, {y:.0f}) px"
        left.remove(same)
    if left:
        x, y = left[0].center
        return f"a {left[0].class_name} at ({x:.0f}, {y:.0f}) px, where the exporter saw none"
    if set(found.points) != set(expected.points):
        return f"points of the classes {sorted(expected.points)}, the model has {sorted(found.points)}"
    for name, count in expected.points.items():
        if abs(found.points[name] - count) > max(_OFF_POINTS * count, _FEW):
            return f"{found.points[name]} points of class {name} instead of {count}"
    return ""


def _is_same(one: CanaryObject, other: CanaryObject) -> bool:
    return (
        one.class_name == other.class_name
        and math.dist(one.center, other.center) <= _OFF_CENTER * other.radius
        and abs(one.radius - other.radius) <= _OFF_SIZE * other.radius
    )
