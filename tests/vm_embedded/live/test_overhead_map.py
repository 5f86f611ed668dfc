"""The overhead map: the field of view on the plane, and what the page gets."""

import asyncio
import base64
import json
import math
from dataclasses import replace

import cv2
import numpy as np
import pytest

from tests.vm_embedded.output.features import demo_frame, scene
from vm_embedded import Detector, Equidistant, Orientation, Rectilinear
from vm_embedded.detection.field_of_view import REACH, field_of_view
from vm_embedded.detection.overlay import draw_horizon
from vm_embedded.live import frame_views
from vm_embedded.live.frame_views import FrameViews, overhead_map


def inside(polygons, places):
    """Whether places (n, 2) are inside of polygons, by the even-odd rule."""
    count = np.zeros(len(places), int)
    for each in polygons:
        contour = each.astype(np.float32)
        count += [cv2.pointPolygonTest(contour, tuple(map(float, place)), False) > 0 for place in places]
    return count % 2 == 1


def view_of(orientation, lens):
    image = np.full((480, 640, 3), 90, np.uint8)
    return Detector.from_file("ball").detect(image, orientation, lens).observation.view


VIEWS = {
    "ahead": (Orientation.from_roll_pitch(0.8, 0.1, 0.4, 2.0), Rectilinear(focal_length=448, fov=1.75)),
    "down": (Orientation.from_roll_pitch(0.8, 0.0, math.pi / 2), Rectilinear(focal_length=448, fov=1.75)),
    "wide": (Orientation.from_roll_pitch(0.6, 0.0, 0.9), Equidistant(focal_length=140, fov=3.0)),
    "up": (Orientation.from_roll_pitch(0.8, 0.0, -math.pi / 2), Equidistant(focal_length=120, fov=3.9)),
}


@pytest.mark.parametrize("name", [*VIEWS, *range(12)])
def test_the_field_of_view_holds_what_the_picture_shows(name):
    view = view_of(*VIEWS[name]) if name in VIEWS else demo_frame(name)[1].observation.view
    places = np.random.default_rng(1).uniform(-1.0, 1.0, (1500, 2)) * np.geomspace(1.0, 12.0, 1500)[:, None]
    distances = np.hypot(*places.T)
    pixels = view.plane_pixels(places)
    with np.errstate(invalid="ignore"):
        slack = np.minimum(pixels, np.array(view.size) - 1 - pixels).min(axis=1)  # NaN for unseen ones
    counts = inside(field_of_view(view), places)
    sure = (distances < REACH - 0.1) & (np.isnan(slack) | (np.abs(slack) > 12.0))
    seen = np.nan_to_num(slack, nan=-1.0) > 0
    assert (counts == seen)[sure].mean() > 0.995
    assert not counts[distances > REACH].any()


def test_the_picture_of_a_camera_that_looks_up_shows_a_ring():
    outer, inner = field_of_view(view_of(*VIEWS["up"]))
    assert np.hypot(*outer.T).min() > np.hypot(*inner.T).max() > 1.0


def test_the_sky_shows_nothing_of_the_plane():
    view = view_of(Orientation.from_roll_pitch(0.8, 0.0, -1.2), Rectilinear(focal_length=448, fov=1.75))
    assert field_of_view(view) == []


def test_the_map_has_what_the_messages_have():
    detections = demo_frame(6)[1]
    view = detections.observation.view
    made = json.loads(json.dumps(overhead_map(replace(detections, field=scene(view))), allow_nan=False))
    assert made["field"] == scene(view).as_dict()
    assert made["detections"] == [each.as_dict() for each in detections]
    assert made["yaw"] == pytest.approx(math.atan2(view.heading[1, 0], view.heading[0, 0]), abs=1e-4)
    assert overhead_map(detections)["field"] is None


def test_the_picture_and_the_map_of_a_view_are_of_one_frame(monkeypatch):
    """Also if the next frame comes while they are made."""
    views, drawn = FrameViews(1000.0), frame_views._jpeg
    first, second = demo_frame(0)[1], demo_frame(6)[1]

    def draw(detections):
        views.show(second)
        return drawn(detections)

    async def ask():
        assert (await views.view({})).content == b"null"
        views.show(first)
        monkeypatch.setattr(frame_views, "_jpeg", draw)
        one = json.loads((await views.view({"after": "0"})).content)
        monkeypatch.setattr(frame_views, "_jpeg", drawn)
        two = json.loads((await views.view({"after": str(one["number"])})).content)
        monkeypatch.setattr(frame_views, "_REPEAT", 0.01)
        assert (await views.view({"after": str(two["number"])})).content == b"null"
        return one, two

    for given, frame in zip((first, second), asyncio.run(ask()), strict=True):
        assert base64.b64decode(frame["picture"]) == drawn(given)
        assert frame["map"] == json.loads(json.dumps(overhead_map(given)))


@pytest.mark.parametrize("pitch", [0.0, 0.2, -0.3])
@pytest.mark.parametrize("roll", [0.0, 0.1])
def test_the_horizon_is_where_level_rays_are(pitch, roll):
    view = view_of(Orientation.from_roll_pitch(0.8, roll, pitch, 2.0), Rectilinear(focal_length=448, fov=1.75))
    canvas = np.zeros((view.size[1], view.size[0], 3), np.uint8)
    draw_horizon(canvas, view)
    rows, columns = np.nonzero(canvas.max(axis=2) > 150)
    middle = (view.size[0] - 1) / 2
    place = np.polyval(np.polyfit(columns, rows, 1), middle)
    level = (view.size[1] - 1) / 2 - 448 * math.tan(pitch) / math.cos(roll)
    assert place == pytest.approx(level, abs=1.5)
    assert columns.min() <= 1
    assert columns.max() >= view.size[0] - 2
    assert np.polyfit(columns, rows, 1)[0] == pytest.approx(-math.tan(roll), abs=0.01)


def test_a_picture_of_the_ground_has_no_horizon():
    view = view_of(Orientation.from_roll_pitch(0.8, 0.0, 1.4), Rectilinear(focal_length=448, fov=1.75))
    canvas = np.zeros((view.size[1], view.size[0], 3), np.uint8)
    draw_horizon(canvas, view)
    assert not canvas.any()


def test_maps_are_computed_when_asked_for_and_once_for_all(monkeypatch):
    computed = []
    monkeypatch.setattr(frame_views, "overhead_map", lambda each: computed.append(each) or {"n": len(computed)})
    views = FrameViews(10.0)

    async def ask():
        assert (await views.map({})).content == b"null"
        detections = demo_frame(0)[1]
        views.show(detections)
        assert computed == []
        answers = await asyncio.gather(views.map({}), views.map({}))
        assert {each.content for each in answers} == {b'{"n":1}'}
        views.show(replace(detections))
        assert (await views.map({})).content == b'{"n":2}'

    asyncio.run(ask())
