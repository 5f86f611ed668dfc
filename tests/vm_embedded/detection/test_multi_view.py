"""Several cameras and planes in one detector, on the drawn frames."""

import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from vm_embedded import GROUND, CameraView, Detector, InputError, Plane, Pose, Sighting, detect_views, read_lens_file
from vm_embedded.cameras.image_files import read_image
from vm_embedded.detection import multi_view as views
from vm_embedded.geometry.orientation import rotation_z

FOLDER = Path(__file__).parents[2] / "fixtures/drawn"


@pytest.fixture(scope="module")
def detector():
    return Detector.from_file(FOLDER / "ball.onnx")


def frame(index):
    file = read_lens_file(FOLDER / f"lens{index:07d}.yaml")
    return read_image(FOLDER / f"image{index:07d}.jpg"), file.lens, file.orientation


def view(index, turn=None, shift=(0.0, 0.0, 0.0)):
    """A drawn frame, in a world that was turned and shifted."""
    image, lens, orientation = frame(index)
    turn = np.eye(3) if turn is None else turn
    return CameraView(image, lens, Pose(turn @ orientation.rotation, turn @ (0.0, 0.0, orientation.height) + shift))


@pytest.mark.parametrize("index", range(6))
def test_on_the_ground_sightings_are_the_detections(detector, index):
    image, lens, orientation = frame(index)
    plain = detector.detect(image, orientation, lens)
    seen = detect_views(detector, {"head": view(index)})
    assert len(seen) == len(plain) > 0
    for sighting, detection in zip(seen, plain, strict=True):
        assert (sighting.camera, sighting.plane, sighting.also) == ("head", "ground", ())
        np.testing.assert_allclose(sighting.position, detection.position, atol=1e-6)
        np.testing.assert_allclose(sighting.direction, detection.bearing, atol=1e-6)


# A ball on a table, on a wall to the left, and on a ceiling: the same pictures in other worlds.
TURNS = {
    "table": (np.eye(3), (0.3, -0.2, 0.75)),
    "wall": (np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]) @ rotation_z(0.4), (1.0, 2.0, 1.5)),
    "ceiling": (np.diag([1.0, -1.0, -1.0]), (0.0, 0.0, 2.6)),
}


@pytest.mark.parametrize("name", TURNS)
def test_a_plane_anywhere_is_looked_at_like_the_ground(detector, name):
    turn, shift = TURNS[name]
    plane = Plane.through(name, shift, turn @ (0.0, 0.0, 1.0))
    here = detect_views(detector, {"head": view(0)})
    there = detect_views(detector, {"head": view(0, turn, shift)}, [plane])
    assert len(there) == len(here) > 0
    for one, other in zip(here, there, strict=True):
        np.testing.assert_allclose(other.position, turn @ one.position + shift, atol=5e-3)
        assert other.detection.distance == pytest.approx(one.detection.distance, abs=5e-3)


def test_of_two_planes_that_show_the_same_pixels_the_clearer_one_is_right(detector):
    planes = [GROUND, Plane("a bit higher", offset=0.02)]
    alone = detect_views(detector, {"head": view(0)})
    both = detect_views(detector, {"head": view(0)}, planes)
    assert len(both) == len(alone)
    for each in both:
        assert all(each.detection.confidence >= other.detection.confidence for other in each.also)
        assert {each.plane, *(other.plane for other in each.also)} <= {"ground", "a bit higher"}
    assert any(each.also for each in both)


def test_two_cameras_see_one_ball_once(detector):
    seen = detect_views(detector, {"left": view(0), "right": view(0)})
    assert len(seen) == len(detect_views(detector, {"left": view(0)})) > 0
    for each in seen:
        assert {each.camera, *(other.camera for other in each.also)} == {"left", "right"}


def test_two_cameras_in_other_places_see_their_own_balls(detector):
    far = view(0, rotation_z(math.pi), (20.0, 0.0, 0.0))
    one = detect_views(detector, {"left": view(0)})
    seen = detect_views(detector, {"left": view(0), "right": far})
    assert len(seen) == 2 * len(one)
    assert not any(each.also for each in seen)


def test_a_camera_behind_a_plane_or_too_near_sees_nothing_on_it(detector):
    height = frame(0)[2].height
    for offset in (height + 1.0, height - 0.05):
        assert detect_views(detector, {"head": view(0)}, [Plane("shelf", offset=offset)]) == ()


def test_planes_need_different_names(detector):
    for planes in ([], [GROUND, GROUND]):
        with pytest.raises(InputError, match="different names"):
            detect_views(detector, {"head": view(0)}, planes)


def sighting(camera, plane, confidence, position, angular_radius=0.03):
    """A made-up one, seen from the world's origin at 1 m."""
    detection = SimpleNamespace(class_name="ball", confidence=confidence, angular_radius=angular_radius)
    away = np.array([*position, -0.9])
    return Sighting(camera, plane, detection, np.array([*position, 0.1]), away / np.linalg.norm(away))


def put_together(monkeypatch, *sightings):
    """What detect_views makes of them."""
    by_view = {}
    for each in sightings:
        by_view.setdefault((each.camera, each.plane), []).append(each)
    monkeypatch.setattr(views, "_sightings", lambda _, camera, __, plane: by_view.get((camera, plane.name), []))
    detector = SimpleNamespace(shape=SimpleNamespace(radius=0.1))
    planes = [GROUND, Plane("table", offset=0.75)]
    return detect_views(detector, {"left": None, "right": None}, planes)


def test_two_cameras_that_agree_outweigh_the_clearest_detection(monkeypatch):
    (seen,) = put_together(
        monkeypatch,
        sighting("left", "ground", 0.85, (3.0, 1.0)),
        sighting("left", "table", 0.95, (3.01, 1.0)),
        sighting("right", "ground", 0.9, (3.02, 1.0)),
    )
    assert (seen.camera, seen.plane, len(seen.also)) == ("right", "ground", 2)


def test_touching_balls_stay_two_and_each_finds_its_nearest(monkeypatch):
    seen = put_together(
        monkeypatch,
        sighting("left", "ground", 0.9, (3.0, 1.0)),
        sighting("left", "ground", 0.8, (3.0, 1.2)),
        sighting("right", "ground", 0.7, (3.0, 1.12)),
    )
    assert len(seen) == 2
    (both,) = (each for each in seen if each.also)
    assert both.position[1] == 1.2
