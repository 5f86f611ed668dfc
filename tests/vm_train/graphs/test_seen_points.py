"""The points that a network gets of a picture."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.manifests import ball_manifest
from vm_embedded.detection.projection import project
from vm_embedded.geometry.lens_files import LensFile
from vm_embedded.geometry.orientation import Orientation
from vm_embedded.geometry.radial_lenses import Equidistant, Equisolid, Rectilinear
from vm_embedded.mesh.models import build_mesh
from vm_train.graphs.seen_points import seen_points

MANIFEST = ball_manifest("ball", "other", intersections=2.0, max_distance=6.0)
SIZE = (160, 120)
LENSES = [
    Rectilinear(focal_length=90.0, fov=2.8, center=(60.0, -45.0)),
    Rectilinear(focal_length=300.0, fov=2.8, distortion=(1e-6, 0.0)),
    Equisolid(focal_length=60.0, fov=math.pi, center=(-8.0, 5.0)),
    Equidistant(focal_length=40.0, fov=2.0),
]


@given(
    st.sampled_from(LENSES), st.floats(0.3, 1.5), st.floats(-0.5, 0.5), st.floats(-0.3, math.pi / 2), st.floats(-3, 3)
)
def test_seen_points_are_those_of_the_mesh_that_are_on_screen(lens, height, roll, pitch, yaw):
    orientation = Orientation.from_roll_pitch(height, roll, pitch, yaw)
    seen = seen_points(LensFile(lens, orientation), SIZE, MANIFEST)
    mesh = build_mesh(MANIFEST.mesh_shape, height, MANIFEST.intersections, MANIFEST.max_distance)
    whole = project(mesh, orientation.level, lens, SIZE).visible
    assert np.array_equal(seen.graph.rays, whole.graph.rays)
    assert np.array_equal(seen.graph.neighbors, whole.graph.neighbors)
    assert np.array_equal(seen.pixels, whole.pixels)


@pytest.mark.parametrize("any_radius", [True, False])
def test_a_manifest_for_other_objects_has_another_mesh_only_if_the_network_knows_any(any_radius):
    manifest = replace(MANIFEST, any_radius=any_radius)
    other = manifest.used_for(0.05, None)
    assert other.object_radius == 0.05
    assert other.radius == (0.05 if any_radius else 0.1)
    assert manifest.used_for(None, None) == manifest
