"""Brightness along stretches of the plane is that of the pixels there, in every format."""

import cv2
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from vm_embedded.detection.field_points import brightness_along
from vm_embedded.detection.pixel_formats import checked_image
from vm_embedded.detection.pyramid import Pyramid
from vm_embedded.geometry.radial_lenses import Equidistant, Rectilinear

from .views import SIZE, view_at

LENSES = [Rectilinear(focal_length=420.0, fov=1.8), Equidistant(focal_length=300.0, fov=2.6)]


def slope():
    """A gray picture that is brighter to the right and darker to the bottom, so that a color tells its pixel."""
    x, y = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
    return (120.0 + 60.0 * x / SIZE[0] - 60.0 * y / SIZE[1]).astype(np.uint8)


@given(st.sampled_from(LENSES), st.floats(0.5, 3.0), st.floats(-1.0, 1.0), st.floats(-3.1, 3.1), st.floats(0.1, 0.6))
def test_a_stretch_has_the_brightness_of_its_pixels(lens, x, y, heading, length):
    view = view_at(0.7, 0.5, lens)
    half = 0.5 * length * np.array([np.cos(heading), np.sin(heading)])
    middle = np.array([x, y])
    stretch = np.array([[middle - half, middle + half]])
    at = np.linspace(0.0, 1.0, 21)[:, None]
    pixels = view.plane_pixels((1.0 - at) * stretch[0, 0] + at * stretch[0, 1])
    assume(np.isfinite(pixels).all() and (pixels > 3.0).all() and (pixels < np.array(SIZE) - 4.0).all())
    found, steps = brightness_along(view, Pyramid(slope(), "gray"), stretch, 21)
    expected = 120.0 + 60.0 * pixels[:, 0] / SIZE[0] - 60.0 * pixels[:, 1] / SIZE[1]
    assert np.abs(found[0] - expected).max() < 3.0
    assert steps[0] == pytest.approx(np.hypot(*(pixels[-1] - pixels[0])) / 20.0)


@pytest.mark.parametrize("format", ["gray", "bgr", "rgb", "bgra", "rgba"])
def test_formats_have_the_same_brightness(format):
    gray = slope()
    codes = {"bgr": cv2.COLOR_GRAY2BGR, "rgb": cv2.COLOR_GRAY2RGB, "bgra": cv2.COLOR_GRAY2BGRA}
    codes["rgba"] = cv2.COLOR_GRAY2RGBA
    image = cv2.cvtColor(gray, codes[format]) if format in codes else gray
    view = view_at(0.7, 0.5, LENSES[0])
    stretches = np.array([[[1.0, -0.2], [1.4, 0.3]], [[2.0, 0.0], [2.5, 0.0]]])
    found, _ = brightness_along(view, Pyramid(checked_image(image, format), format), stretches, 9)
    expected, _ = brightness_along(view, Pyramid(gray, "gray"), stretches, 9)
    assert found == pytest.approx(expected, abs=1.0)


def test_what_the_picture_does_not_show_has_no_brightness():
    view = view_at(0.7, 0.5, LENSES[0])
    behind, beside = [[-3.0, 0.0], [-3.5, 0.0]], [[1.0, -9.0], [1.0, 0.0]]
    found, steps = brightness_along(view, Pyramid(slope(), "gray"), np.array([behind, beside]), 5)
    assert np.isnan(found[0]).all()
    assert np.isnan(found[1, 0])
    assert np.isfinite(steps).all()
