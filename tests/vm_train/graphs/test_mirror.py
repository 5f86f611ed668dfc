"""Mirror images of pictures, told and true."""

import numpy as np
import pytest

from tests.manifests import ball_manifest
from vm_embedded.geometry.lens_files import LensFile
from vm_embedded.geometry.orientation import Orientation
from vm_embedded.geometry.radial_lenses import Rectilinear
from vm_embedded.mesh.models import MESH_MODELS
from vm_train.data.pictures import Picture
from vm_train.graphs.labeled_graph import graph_of
from vm_train.graphs.mirror import mirrored, mirrored_columns

SIZE = (161, 121)


def manifest(model):
    entries = {"intersections": 3.0, "mesh": model, "max_distance": 6.0}
    if model == "wall6":
        return ball_manifest("ball:upright", "other", shape="cylinder", object_height=1.0, **entries)
    return ball_manifest("ball", "other", **entries)


def pictures():
    """A picture of noise, and the same in a mirror, both seen by a level camera that looks straight ahead."""
    random = np.random.default_rng(3)
    image = random.integers(0, 256, (SIZE[1], SIZE[0], 3), dtype=np.uint8)
    labels = random.integers(0, 2, (SIZE[1], SIZE[0]), dtype=np.int8)
    lens = LensFile(
        Rectilinear(focal_length=110.0, fov=2.8, center=(0.5, 0.0)), Orientation.from_roll_pitch(1.0, 0.0, 0.5)
    )
    return [Picture(image[:, ::turn], labels[:, ::turn], lens) for turn in (1, -1)]


@pytest.mark.parametrize("model", MESH_MODELS)
def test_places_of_a_mirror_image_in_a_mirror_are_where_they_were(model):
    places = mirrored_columns(MESH_MODELS[model])
    assert sorted(places.tolist()) == list(range(MESH_MODELS[model].neighbors))
    assert places[places].tolist() == list(range(len(places)))


@pytest.mark.parametrize("model", MESH_MODELS)
def test_a_mirror_image_is_what_a_network_sees_of_a_picture_that_is_mirrored(model):
    """Each point has a twin of the same color on the other side, and nearly all have their twins' neighbors: of a point
    that lies exactly between two of the next ring, one is always on the same side."""
    told, true = (graph_of(each, manifest(model)) for each in pictures())
    seen = mirrored(told, MESH_MODELS[model])
    turned = np.stack([SIZE[0] - 1.0 - seen.pixels[:, 0], seen.pixels[:, 1]], axis=1)
    apart = np.hypot(*(turned[:, None] - true.pixels[None]).transpose(2, 0, 1))
    twin = np.append(apart.argmin(axis=1), len(true))
    assert len(seen) == len(true) > 100
    assert apart.min(axis=1).max() < 1e-6
    assert np.allclose(seen.points, true.points[twin], atol=1e-6)
    assert np.array_equal(seen.labels, true.labels[twin[:-1]])
    expected = true.neighbors[twin]
    shown = expected < len(true)
    assert (twin[seen.neighbors] == expected)[shown].mean() > 0.9
    stay = np.mean(mirrored_columns(MESH_MODELS[model]) == np.arange(expected.shape[1]))
    assert (twin[told.neighbors] == expected)[shown].mean() < stay + 0.1
