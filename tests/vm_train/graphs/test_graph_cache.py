"""Views that are kept are those that were made."""

import shutil
from dataclasses import replace

import numpy as np
import pytest

from tests.folders import contents
from vm_train.data.pictures import find_pictures
from vm_train.graphs.augmentation import Augmentation
from vm_train.graphs.graph_cache import GraphCache, remove_caches
from vm_train.graphs.graph_recipe import GraphRecipe
from vm_train.graphs.loading import PictureGraphs
from vm_train.graphs.schedule import Item
from vm_train.learning.configuration import TrainConfiguration

from ..drawn import draw_set

CONFIGURATION = TrainConfiguration()


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    return draw_set(tmp_path_factory.mktemp("drawn"), 3)


@pytest.fixture
def folder(drawn, tmp_path):
    return shutil.copytree(drawn, tmp_path / "pictures")


def graphs_of(folder, kept, count=2, **changes):
    recipe = GraphRecipe(
        CONFIGURATION.classes.mask_classes(),
        replace(CONFIGURATION.manifest, max_distance=4.0, colors="absolute", **changes),
        augmentation=Augmentation(brightness=0.0, contrast=0.0, saturation=0.0, hue=0.0, gamma=0.0, noise=0.0),
    )
    return PictureGraphs(find_pictures(folder), recipe, None, GraphCache(kept, count, recipe))


def same(first, second):
    return all(
        np.array_equal(getattr(first, name), getattr(second, name))
        for name in ("points", "neighbors", "labels", "distances", "pixels")
    )


def files_in(kept):
    return sorted(path for path in kept.rglob("*.raw"))


def test_views_are_made_once_and_are_the_same_when_read(folder, tmp_path):
    graphs = graphs_of(folder, tmp_path / "kept")
    made = [graphs[Item(0, (1, seed))] for seed in range(12)]
    assert len(files_in(tmp_path / "kept")) == 2
    times = [path.stat().st_mtime_ns for path in files_in(tmp_path / "kept")]
    read = [graphs_of(folder, tmp_path / "kept")[Item(0, (1, seed))] for seed in range(12)]
    assert all(same(*each) for each in zip(made, read, strict=True))
    assert [path.stat().st_mtime_ns for path in files_in(tmp_path / "kept")] == times
    lengths = {len(each) for each in made}
    assert len(lengths) == 2  # two poses, so two numbers of points


def test_validation_sees_the_picture_as_it_is(folder, tmp_path):
    graphs = graphs_of(folder, tmp_path / "kept")
    graphs[Item(0)]
    assert files_in(tmp_path / "kept") == []


@pytest.mark.parametrize("damage", [b"", b"vmviews1", b"x" * 100, None])
def test_damaged_and_stale_views_are_made_again(folder, tmp_path, damage):
    graphs = graphs_of(folder, tmp_path / "kept", count=1)
    made = graphs[Item(0, (1,))]
    path = files_in(tmp_path / "kept")[0]
    if damage is None:
        image = graphs.pictures[0].image
        content = image.read_bytes()
        image.write_bytes(content + b"\0")
        before = path.stat().st_mtime_ns
    else:
        path.write_bytes(damage)
        before = 0
    assert same(graphs[Item(0, (1,))], made)
    assert path.stat().st_mtime_ns != before
    assert path.stat().st_size > 1000


BALL = {"shape": "sphere", "radius": 0.1}
CYLINDER = {"shape": "cylinder", "radius": 0.1, "object_height": 0.3}


@pytest.mark.parametrize(
    ("mesh", "other"),
    [(BALL, {**BALL, "radius": 0.05}), (BALL, CYLINDER), (CYLINDER, {**CYLINDER, "object_height": 0.1})],
    ids=["radius", "shape", "height"],
)
def test_other_meshes_have_other_views(folder, tmp_path, mesh, other):
    made = [graphs_of(folder, tmp_path / "kept", count=1, **each)[Item(0, (1,))] for each in (mesh, other)]
    assert len(made[0]) != len(made[1])
    assert len(list((tmp_path / "kept").iterdir())) == 2


def test_only_caches_are_removed(folder, tmp_path):
    graphs = graphs_of(folder, tmp_path / "kept")
    assert len(graphs[Item(0, (1, 0))])
    assert files_in(tmp_path / "kept")
    (tmp_path / "kept" / "views-of-mine").mkdir()
    (tmp_path / "kept" / "views-of-mine" / "1.raw").write_bytes(b"camera")
    (tmp_path / "kept" / "views-link").symlink_to(folder)
    before = contents(folder)
    remove_caches(tmp_path / "kept")
    assert {each.name for each in (tmp_path / "kept").iterdir()} == {"views-of-mine", "views-link"}
    assert contents(tmp_path / "kept") == {"views-of-mine/1.raw": b"camera"}
    assert contents(folder) == before
    graphs_of(folder, tmp_path / "other")[Item(0, (1, 0))]
    remove_caches(tmp_path / "other")
    assert not (tmp_path / "other").exists()
