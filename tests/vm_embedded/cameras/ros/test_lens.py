"""Lenses of camera_info."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_embedded.cameras.ros.lens import camera_info_message, lens_of
from vm_embedded.errors import InputError
from vm_embedded.geometry.calibrated_lenses import BrownLens, FisheyeLens
from vm_embedded.geometry.radial_lenses import Equidistant, Equisolid, Rectilinear

from .rolling_ball import LENS, SIZE, TYPES, camera_info, stamp

HEADER = TYPES.Header(stamp=stamp(0.0), frame_id="camera_optical")
SMALL = st.floats(-0.05, 0.05)


def coefficients(*counts):
    return st.one_of(*(st.lists(SMALL, min_size=count, max_size=count) for count in counts)).map(tuple)


@given(
    st.one_of(
        st.builds(
            BrownLens,
            focal_lengths=st.tuples(st.floats(200, 900), st.floats(200, 900)),
            optical_center=st.tuples(st.floats(300, 340), st.floats(240, 270)),
            coefficients=coefficients(4, 5, 8),
            fov=st.just(math.radians(160.0)),
            size=st.just(SIZE),
        ),
        st.builds(
            FisheyeLens,
            focal_lengths=st.tuples(st.floats(200, 900), st.floats(200, 900)),
            optical_center=st.tuples(st.floats(300, 340), st.floats(240, 270)),
            coefficients=coefficients(4),
            fov=st.just(2.0 * math.pi),
            size=st.just(SIZE),
        ),
    )
)
def test_a_calibrated_lens_survives_camera_info(lens):
    message = camera_info_message(TYPES, HEADER, lens, SIZE)
    assert lens_of(message) == lens


def test_the_lens_of_a_camera_info_has_its_numbers():
    assert lens_of(camera_info(0.0)) == LENS


@pytest.mark.parametrize("kind", [Rectilinear, Equidistant, Equisolid])
@given(
    st.floats(150.0, 500.0),
    st.tuples(st.floats(-30.0, 30.0), st.floats(-30.0, 30.0)),
    st.tuples(st.integers(-10, 10).map(lambda k: 1e-7 * k), st.integers(-9, 9).map(lambda k: 1e-13 * k)),
    st.floats(0.5, 3.0),
)
def test_a_radial_lens_survives_camera_info(kind, focal_length, center, distortion, fov):
    lens = kind(focal_length=focal_length, center=center, distortion=distortion, fov=fov)
    message = camera_info_message(TYPES, HEADER, lens, SIZE)
    again = lens_of(message)
    x, y = np.meshgrid(np.linspace(0.0, SIZE[0] - 1.0, 23), np.linspace(0.0, SIZE[1] - 1.0, 19))
    pixels = np.column_stack([x.ravel(), y.ravel()])
    rays = lens.unproject(pixels, SIZE)
    seen = np.isfinite(rays).all(axis=1)
    seen[seen] = lens.sees(rays[seen])
    assert again.sees(rays[seen]).sum() > 0.98 * seen.sum() - 2
    assert np.abs(again.project(rays[seen], SIZE) - pixels[seen]).max(initial=0.0) < 0.15
    if distortion == (0.0, 0.0):
        assert message.distortion_model == ("plumb_bob" if kind is Rectilinear else "equidistant")


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"k": np.zeros(9)}, "k is zero; calibrate the camera, or give --lens"),
        ({"binning_x": 2}, "binned images"),
        ({"distortion_model": "plum_bob"}, "unknown distortion_model 'plum_bob'; did you mean 'plumb_bob'?"),
        ({"roi": TYPES.RegionOfInterest(x_offset=8, y_offset=0, height=9, width=9, do_rectify=False)}, "part of the"),
    ],
)
def test_a_camera_info_that_does_not_fit_is_an_error(change, reason):
    message = camera_info(0.0)
    for name, value in change.items():
        setattr(message, name, value)
    with pytest.raises(InputError) as error:
        lens_of(message)
    assert reason in str(error.value)
