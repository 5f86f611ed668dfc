"""Angles, pixels and the useful range against outlines and simple cases."""

import math

import numpy as np
import pytest

from vm_embedded.geometry.shapes import Circle, Cylinder, Sphere
from vm_mesh.built_mesh import MeshPlan
from vm_mesh.useful_range import angular_size, useful_range


@pytest.mark.parametrize("shape", [Circle(0.1), Sphere(0.1), Cylinder(0.1, 0.4), Cylinder(0.05, 1.8)], ids=str)
def test_angular_size_is_that_of_the_outline(shape):
    plan = MeshPlan(shape, 1.0, 4.0, 10.0)
    for distance in (0.5, 1.0, 3.0, 8.0):
        center = np.array([distance, 0.0, shape.center_height - 1.0])
        outline = shape.outline(center, 1.0, 2000)
        across = np.arctan2(outline[:, 1], outline[:, 0])
        up = np.arctan2(outline[:, 2], np.hypot(outline[:, 0], outline[:, 1]))
        found = angular_size(plan, np.array([distance]))[0]
        assert found[1] == pytest.approx(np.ptp(up), rel=2e-2)
        if isinstance(shape, Cylinder):  # as a bearing; of the others as an angle in space
            assert found[0] == pytest.approx(np.ptp(across), rel=1e-2)


def test_the_limit_is_infinite_for_a_camera_of_any_fineness():
    plan = MeshPlan(Sphere(0.1), 1.0, 1.0, 10.0)
    assert useful_range(plan, 1e9, np.array([1.0])).limit == math.inf
    assert useful_range(plan, 1e-3, np.array([1.0])).limit == 0.0
