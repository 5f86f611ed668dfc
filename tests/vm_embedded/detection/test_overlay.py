"""Features of the field and labels in pictures."""

from dataclasses import replace

import numpy as np
import pytest

from tests.vm_embedded.output.features import demo_frame, full, scene
from vm_embedded.detection.labels import INK, Labels


def colors_near(image, pixel):
    x, y = np.rint(pixel).astype(int).tolist()
    return image[max(y - 2, 0) : y + 3, max(x - 2, 0) : x + 3].reshape(-1, 3)


def test_every_feature_is_drawn_where_it_is():
    image, detections = demo_frame(6)
    view = detections.observation.view
    field = scene(view)
    plain = detections.draw(image)
    drawn = replace(detections, field=field).draw(image)
    middles = [each.ends.mean(axis=0) for each in field.lines] + [field.border.points[1:3].mean(axis=0)]
    places = [*middles, *(each.position for each in (*field.robots, *field.posts, *field.crossings))]
    places += [field.circle.center - (field.circle.radius, 0.0), field.circle.center - (0.0, field.circle.radius)]
    for pixel in view.plane_pixels(np.array(places)):
        assert (colors_near(drawn, pixel) != colors_near(plain, pixel)).any(), pixel
    magenta = colors_near(drawn, view.plane_pixels(middles[1][None])[0]).astype(int)
    assert (magenta @ (1, -2, 1)).max() > 300


def test_plane_pixels_are_those_of_the_mesh_points():
    detections = demo_frame(0)[1]
    view = detections.observation.view
    rays = detections.rays[detections.rays[:, 2] < -0.02]
    pixels = view.plane_pixels(view.height * rays[:, :2] / -rays[:, 2:])
    expected = detections.pixels[detections.rays[:, 2] < -0.02]
    np.testing.assert_allclose(pixels, expected, atol=1e-3)


@pytest.mark.parametrize("number", range(12))
def test_features_outside_of_the_view_do_no_harm(number):
    image, detections = demo_frame(number)
    for make in (scene, full):
        drawn = replace(detections, field=make(detections.observation.view)).draw(image)
        assert drawn.shape == image.shape
    behind = scene(detections.observation.view)
    behind = replace(behind, crossings=tuple(replace(each, position=-each.position) for each in behind.crossings))
    replace(detections, field=behind).draw(image)


def area(canvas):
    return int((canvas != 255).any(axis=2).sum())


def test_six_labels_at_one_place_are_all_readable():
    alone, together = (np.full((600, 800, 3), 255, np.uint8) for _ in range(2))
    Labels(alone, 1.0).write("post 3.20 m", np.array([400.0, 300.0]), 10.0, INK)
    labels = Labels(together, 1.0)
    for _ in range(6):
        labels.write("post 3.20 m", np.array([400.0, 300.0]), 10.0, INK)
    assert area(together) == 6 * area(alone)
    for _ in range(50):
        labels.write("post 3.20 m", np.array([400.0, 300.0]), 10.0, INK)
    assert 6 <= area(together) / area(alone) == area(together) // area(alone)


@pytest.mark.parametrize("place", [(0.0, 0.0), (799.0, 599.0), (799.0, 300.0)])
def test_a_label_at_the_edge_stays_inside_and_beside_its_place(place):
    canvas = np.full((600, 800, 3), 255, np.uint8)
    Labels(canvas, 1.0).write("post 3.20 m", np.array(place), 5.0, INK)
    x, y = np.rint(place).astype(int).tolist()
    assert area(canvas) > 1000
    assert (canvas[y, x] == 255).all()


def test_a_label_keeps_off_marks_while_there_is_room():
    canvas = np.full((600, 800, 3), 255, np.uint8)
    labels = Labels(canvas, 1.0)
    labels.avoid(np.array([440.0, 300.0]), 8.0)
    labels.write("post 3.20 m", np.array([400.0, 300.0]), 5.0, INK)
    assert (canvas[292:309, 432:449] == 255).all()
