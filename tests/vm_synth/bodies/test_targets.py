"""Objects to detect fill their cylinder exactly, whatever their solid and colors."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_synth.bodies.primitives import box
from vm_synth.bodies.targets import TARGETS, draw_target, unit_sized

seeds = st.integers(0, 2**32 - 1)
sizes = st.floats(0.01, 2.0)


def span(solid):
    """Largest distance from the vertical axis, lowest and highest z [m]."""
    z = solid.vertices[:, 2]
    return float(np.hypot(*solid.vertices[:, :2].T).max()), float(z.min()), float(z.max())


@pytest.mark.parametrize("name", TARGETS)
@given(seed=seeds, radius=sizes, height=sizes)
def test_a_solid_has_the_radius_and_the_height(name, seed, radius, height):
    random = np.random.default_rng(seed)
    made = draw_target(random, TARGETS[name](random), radius, height, (), "thing")
    assert span(made) == pytest.approx((radius, 0.0, height), rel=1e-4, abs=1e-5)
    assert (made.label, made.name) == ("ball", "thing")
    assert ((made.colors >= 0.0) & (made.colors <= 1.0)).all()
    assert np.linalg.norm(made.normals, axis=1) == pytest.approx(1.0, abs=1e-4)


@given(x=sizes, y=sizes, z=sizes, shift=st.tuples(*3 * [st.floats(-5.0, 5.0)]))
def test_any_mesh_is_brought_to_unit_size(x, y, z, shift):
    assert span(unit_sized(box(x, y, z).shifted(shift))) == pytest.approx((1.0, 0.0, 1.0), abs=1e-3)


@given(seed=seeds)
def test_a_texture_is_wrapped_upright(seed):
    texture = np.zeros((40, 60, 3), dtype=np.float32)
    texture[:20] = (0.9, 0.1, 0.1)
    texture[20:] = (0.1, 0.1, 0.9)
    random = np.random.default_rng(seed)
    made = draw_target(random, TARGETS["cylinder"](random), 0.04, 0.1, (texture,), "can")
    upper = made.vertices[:, 2] > 0.051
    lower = made.vertices[:, 2] < 0.049
    assert (made.colors[upper] == texture[0, 0]).all()
    assert (made.colors[lower] == texture[-1, 0]).all()
