"""Links and points on an object against values that are known."""

import numpy as np
import pytest

from vm_embedded.geometry.shapes import Sphere
from vm_mesh.built_mesh import BuiltMesh, MeshPlan
from vm_mesh.quality import measure_links, points_on_object


def test_links_of_a_lattice_in_its_middle_are_one_step_and_even_angles():
    """Straight below the camera an XY lattice of six neighbors is a regular hexagonal one."""
    links = measure_links(BuiltMesh.build("xygrid6", MeshPlan(Sphere(0.02), 1.0, 4.0, 1.0)), 0.0, 0.05)
    assert links.radial.mean == pytest.approx(1.0, abs=0.05)
    assert links.cyclic.mean == pytest.approx(1.0, abs=0.05)
    assert links.angular.mean == pytest.approx(60.0, abs=0.1)
    assert links.angular.deviation < 2.0


def test_points_on_an_object_are_as_many_as_k_says():
    for model in ("ring6", "cap6", "xmgrid4"):
        found = points_on_object(BuiltMesh.build(model, MeshPlan(Sphere(0.095), 1.0, 6.0, 6.0)), np.array([1.0, 2.0]))
        assert found.mean == pytest.approx(6.0, abs=0.5)
        assert (found.low <= found.mean).all()
        assert (found.mean <= found.high).all()
