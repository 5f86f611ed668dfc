import json
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.looks import look_contract
from tests.manifests import MESHES, ball_manifest
from vm_embedded.errors import GeometryError, InputError, ModelError
from vm_embedded.geometry.shapes import SHAPES, Circle, Sphere
from vm_embedded.mesh.models import MESH_MODELS
from vm_embedded.network.manifest import (
    EDGES,
    FORMAT_VERSION,
    KINDS,
    LAYOUTS,
    Manifest,
    ObjectClass,
)
from vm_embedded.network.self_test import SelfTest

from ..strategies import attempt, class_names, printable, reals, seeds


@st.composite
def self_tests(draw):
    """As the exporter makes them: colors of four digits, the off-screen point last."""
    random = np.random.default_rng(draw(seeds))
    points, width, classes = draw(st.integers(0, 8)), draw(st.sampled_from([4, 6, 8])), draw(st.integers(1, 4))
    colors = np.full((points + 1, 3), -1.0, dtype=np.float32)
    colors[:-1] = np.round(random.random((points, 3)), 4)
    neighbors = random.integers(0, points + 1, (points + 1, width)).astype(np.int32)
    cells = None if draw(st.booleans()) else np.stack([np.arange(points), np.zeros(points, dtype=int)], axis=1)
    return SelfTest(colors, neighbors, random.random((points + 1, classes)).astype(np.float32), cells)


classes = st.lists(
    st.builds(ObjectClass, class_names, st.sampled_from(KINDS)),
    min_size=1,
    max_size=4,
    unique_by=lambda each: each.name,
).map(tuple)

orders = st.sampled_from(
    [(edge, layout) for edge in EDGES for layout in LAYOUTS if edge == "hard" or layout == "plain"]
)
"""Edges and the layouts that there are for them."""


def _manifest(order, tall, **entries):
    """A cylinder has a height; layout canvas needs its mesh."""
    edge, layout = order
    if layout == "canvas":
        entries["peaks"] = tuple(each.name for each in entries["classes"][::-1] if each.kind in ("object", "upright"))
    mesh = entries.pop("mesh") if layout in ("plain", "runs") else MESHES[layout]
    entries = entries | {"mesh": mesh, "object_height": tall if entries["shape"] == "cylinder" else 0.0}
    return Manifest(edge=edge, layout=layout, **entries)


manifests = st.builds(
    _manifest,
    order=orders,
    tall=reals(0.01, 3.0),
    shape=st.sampled_from(sorted(SHAPES)),
    radius=reals(1e-3, 10.0),
    object_radius=reals(1e-3, 10.0),
    intersections=reals(0.1, 20.0),
    mesh=st.sampled_from(sorted(set(MESH_MODELS) - {"wall6", "octaves"})),
    max_distance=reals(0.1, 100.0),
    classes=classes,
    self_test=st.one_of(st.none(), self_tests()),
    operations=st.integers(0, 10**7),
    provenance=st.dictionaries(class_names, st.text(printable, max_size=8), max_size=3),
)

BALL = ball_manifest("ball", "line", "other", object_radius=0.075)


def changed(**entries):
    """BALL's JSON with other entries; an Ellipsis takes one away."""
    data = json.loads(BALL.as_json()) | entries
    return json.dumps({key: value for key, value in data.items() if value is not ...})


@given(manifests)
def test_from_json_is_the_inverse_of_as_json(manifest):
    again = Manifest.from_json(manifest.as_json())
    assert replace(again, self_test=None) == replace(manifest, self_test=None)
    assert (again.self_test is None) == (manifest.self_test is None)
    assert again.as_json() == manifest.as_json()


@given(self_tests())
def test_a_self_test_round_trips_with_the_digits_that_its_check_needs(test):
    again = SelfTest.from_dict(json.loads(json.dumps(test.as_dict())))
    np.testing.assert_array_equal(again.points, test.points)
    np.testing.assert_array_equal(again.neighbors, test.neighbors)
    np.testing.assert_allclose(again.probabilities, test.probabilities, atol=1e-6)
    assert (again.points.dtype, again.neighbors.dtype, again.probabilities.dtype) == (np.float32, np.int32, np.float32)


@given(manifests)
def test_a_manifest_is_json_in_ascii_with_its_version(manifest):
    text = manifest.as_json()
    assert text.isascii()
    assert json.loads(text)["format_version"] == FORMAT_VERSION


def test_the_shape_of_the_mesh_is_that_of_its_radius():
    assert BALL.mesh_shape == Sphere(0.1)
    assert replace(BALL, shape="circle").mesh_shape == Circle(0.1)


@pytest.mark.parametrize(("mesh", "count"), [("ring4", 4), ("ring6", 6), ("ring8", 8)])
def test_neighbors_are_those_of_the_mesh(mesh, count):
    assert replace(BALL, mesh=mesh).neighbors == count


def test_a_class_has_its_column():
    assert [BALL.column(name) for name in ("ball", "line", "other")] == [0, 1, 2]


def test_an_unknown_class_names_the_nearest():
    with pytest.raises(InputError, match=r"'bal'.*'ball'"):
        BALL.column("bal")


@pytest.mark.parametrize("entry", [key for key in json.loads(BALL.as_json()) if key != "format_version"])
def test_a_missing_entry_is_refused_by_name(entry):
    with pytest.raises(ModelError, match=rf"lacks {entry}$"):
        Manifest.from_json(changed(**{entry: ...}))


def test_files_without_peaks_lack_their_entry_as_before():
    assert "peaks" not in json.loads(BALL.as_json())


@pytest.mark.parametrize(
    ("entries", "said"),
    [
        *(
            ({"layout": layout, "mesh": mesh}, f"the mesh is {mesh}, the layout {layout}")
            for layout, mesh in (
                ("plain", "octaves"),
                ("runs", "octaves"),
                ("canvas", "xygrid6"),
            )
        ),
        ({"layout": "canvas", "mesh": "octaves", "edge": "same"}, "canvas"),
    ],
)
def test_a_layout_and_a_mesh_that_do_not_fit_are_refused(entries, said):
    with pytest.raises(ModelError, match=said):
        Manifest.from_json(changed(**entries))


STRIPS = ball_manifest("ball", "goal:upright", "line", "other", mesh="octaves", layout="canvas")


def test_peaks_are_outputs_after_the_classes():
    both = replace(STRIPS, peaks=("goal", "ball"))
    assert (STRIPS.outputs, both.outputs) == (4, 12)
    assert json.loads(both.as_json())["peaks"] == ["goal", "ball"]
    assert replace(both, object_radius=0.2).used_for(0.3, 5.0).peaks == ("goal", "ball")


@pytest.mark.parametrize(
    ("peaks", "said"),
    [
        (["bal"], r"'bal'.*'ball'.*allowed: ball, goal"),
        (["ball", "line"], "'line'"),
        (["other"], "'other'"),
        ([["ball"]], r"\['ball'\]"),
        ([None], "None"),
        (["ball", "goal", "ball"], r"\['ball', 'goal', 'ball'\]"),
        ("ball", "must be a list, not 'ball'"),
        ({"ball": 1}, "must be a list"),
    ],
)
def test_impossible_peaks_are_refused(peaks, said):
    data = json.loads(STRIPS.as_json()) | {"peaks": peaks}
    with pytest.raises(ModelError, match=said):
        Manifest.from_json(json.dumps(data))


@pytest.mark.parametrize("layout", ["plain", "runs"])
def test_other_layouts_have_no_peaks(layout):
    with pytest.raises(ModelError, match=f"peaks.*canvas.*{layout}"):
        ball_manifest("ball", layout=layout, mesh=MESHES[layout], peaks=("ball",))


def test_a_look_counts_scores_only_of_classes_with_peaks():
    weighing = look_contract(mesh_weight=0.4)
    assert replace(STRIPS, peaks=("ball",), look=weighing).look.mesh_weight == 0.4
    for peaks in ((), ("goal",)):
        with pytest.raises(ModelError, match=r"'ball'.*mesh_weight.*0\.4"):
            replace(STRIPS, peaks=peaks, look=weighing)


def test_an_unknown_entry_names_itself_and_the_nearest_known_one():
    with pytest.raises(ModelError, match=r"'max_distanse'.*'max_distance'"):
        Manifest.from_json(changed(max_distanse=1.0))


@pytest.mark.parametrize("version", [0, 1, FORMAT_VERSION + 1, "1", None, 1.5, ..., [1]], ids=str)
def test_another_version_is_refused_with_both_and_what_to_do(version):
    with pytest.raises(ModelError, match=rf"version .*reads version {FORMAT_VERSION}.*export the model again"):
        Manifest.from_json(changed(format_version=version))


@pytest.mark.parametrize("text", ["", "{", "ball", "[1, 2", "{'a': 1}", "\0", "[" * 100_000])
def test_what_is_not_json_is_refused(text):
    with pytest.raises(ModelError, match="not JSON"):
        Manifest.from_json(text)


@pytest.mark.parametrize("text", ["1", "null", "[]", '"ball"', "true"])
def test_json_that_is_no_table_is_refused(text):
    with pytest.raises(ModelError, match="not a JSON object"):
        Manifest.from_json(text)


@pytest.mark.parametrize(
    ("entry", "wrong", "near"),
    [
        ("shape", "spher", "sphere"),
        ("shape", "Sphere", "sphere"),
        ("mesh", "ring5", "ring6"),
        ("edge", "herd", "hard"),
        ("layout", "plane", "plain"),
        ("layout", "rows", "runs"),
        ("channels", "bgr", "rgb"),
        ("sampling", "linear", "bilinear"),
    ],
)
def test_a_word_that_this_runtime_does_not_know_is_refused_with_the_nearest(entry, wrong, near):
    with pytest.raises(ModelError, match=rf"{entry}.*'{wrong}'.*{near}"):
        Manifest.from_json(changed(**{entry: wrong}))


NUMBERS = ("radius", "object_radius", "intersections", "max_distance", "scale")


@pytest.mark.parametrize("entry", NUMBERS)
@pytest.mark.parametrize("wrong", [0, -1.0, math.nan, math.inf, "0.1", None, [0.1], {}])
def test_what_is_no_number_above_zero_is_refused_by_name(entry, wrong):
    with pytest.raises(ModelError, match=rf"^{entry} .*above 0.*not {wrong!r}".replace("[", r"\[")):
        Manifest.from_json(changed(**{entry: wrong}))


@pytest.mark.parametrize("entry", ["radius", "intersections"])
def test_true_is_no_number(entry):
    with pytest.raises(ModelError, match=rf"{entry} .*True"):
        Manifest.from_json(changed(**{entry: True}))


@pytest.mark.parametrize("entry", ["radius", "max_distance"])
def test_a_number_of_more_digits_than_a_float_has_is_refused(entry):
    with pytest.raises(ModelError, match=entry):
        Manifest.from_json(changed(**{entry: 10**400}))


@pytest.mark.parametrize("wrong", [-1, 1.5, 2.0, True, "3", None, math.nan, [1]])
def test_operations_are_a_whole_number(wrong):
    with pytest.raises(ModelError, match="operations"):
        Manifest.from_json(changed(operations=wrong))


@pytest.mark.parametrize("scale", [1.0, 1.0 / 256.0, 255.0])
def test_another_scale_of_colors_is_refused(scale):
    with pytest.raises(ModelError, match="1/255"):
        Manifest.from_json(changed(scale=scale))


def test_runs_are_refused_for_missing_neighbors_that_are_the_point_itself():
    assert Manifest.from_json(changed(layout="runs")).layout == "runs"
    assert Manifest.from_json(changed(edge="same")).layout == "plain"
    with pytest.raises(ModelError, match="runs needs edge hard"):
        Manifest.from_json(changed(layout="runs", edge="same"))


ONE = {"name": "ball", "kind": "object"}

WRONG_CLASSES = {
    "none": [],
    "null": None,
    "number": 3,
    "word": "ball",
    "words": ["ball"],
    "without a kind": [{"name": "ball"}],
    "without a name": [{"kind": "object"}],
    "unknown kind": [{"name": "ball", "kind": "objekt"}],
    "kind that is no word": [{"name": "ball", "kind": ["object"]}],
    "twice": [ONE, ONE],
    "name that is a list": [{"name": ["ball"], "kind": "object"}],
    "name that is a table": [{"name": {"en": "ball"}, "kind": "object"}],
    "name that is a number": [{"name": 5, "kind": "object"}],
    "name that is null": [{"name": None, "kind": "object"}],
}


@pytest.mark.parametrize("wrong", WRONG_CLASSES.values(), ids=WRONG_CLASSES)
def test_classes_that_make_no_sense_are_refused(wrong):
    with pytest.raises(ModelError, match="class"):
        Manifest.from_json(changed(classes=wrong))


def test_an_unknown_kind_of_class_names_class_and_nearest_kind():
    with pytest.raises(ModelError, match=r"class 'ball' 'objekt'.*'object'"):
        ObjectClass("ball", "objekt")


@pytest.mark.parametrize("wrong", [None, 5, "me", ["a"]])
def test_provenance_that_is_no_table_is_refused(wrong):
    with pytest.raises(ModelError, match="provenance"):
        Manifest.from_json(changed(provenance=wrong))


TEST = {
    "points": [[0.5, 0.5, 0.5], [-1, -1, -1]],
    "neighbors": [[1] * 6, [1] * 6],
    "probabilities": [[0.5], [0.5]],
    "cells": None,
}

WRONG_TESTS = {
    "number": 5,
    "word": "test",
    "list": [1, 2],
    "empty": {},
    "without neighbors": {key: value for key, value in TEST.items() if key != "neighbors"},
    "without points": TEST | {"points": []},
    "flat points": TEST | {"points": [0.5, 0.5]},
    "two colors": TEST | {"points": [[0.5, 0.5]] * 2},
    "ragged points": TEST | {"points": [[0.5, 0.5, 0.5], [1]]},
    "words for points": TEST | {"points": [["a", "b", "c"]] * 2},
    "null points": TEST | {"points": None},
    "flat neighbors": TEST | {"neighbors": [1, 1]},
    "too few neighbors": TEST | {"neighbors": [[1] * 6]},
    "neighbors that are no points": TEST | {"neighbors": [[2] * 6, [1] * 6]},
    "negative neighbors": TEST | {"neighbors": [[-1] * 6, [1] * 6]},
    "huge neighbors": TEST | {"neighbors": [[2**40] * 6, [1] * 6]},
    "NaN neighbors": TEST | {"neighbors": [[math.nan] * 6, [1] * 6]},
    "infinite neighbors": TEST | {"neighbors": [[math.inf] * 6, [1] * 6]},
    "too many probabilities": TEST | {"probabilities": [[0.5]] * 3},
    "too many cells": TEST | {"cells": [[0, 0], [1, 0]]},
    "cells without end": TEST | {"cells": [[10**6, 0]]},
    "flat probabilities": TEST | {"probabilities": [0.5, 0.5]},
}


@pytest.mark.parametrize("wrong", WRONG_TESTS.values(), ids=WRONG_TESTS)
def test_a_self_test_that_makes_no_sense_is_refused(wrong):
    with pytest.raises(ModelError, match="self-test"):
        Manifest.from_json(changed(self_test=wrong))


def test_a_self_test_that_makes_sense_is_read():
    test = Manifest.from_json(changed(self_test=TEST)).self_test
    assert test.points.shape == (2, 3)
    assert test.neighbors.shape == (2, 6)
    assert test.probabilities.shape == (2, 1)


values = st.recursive(
    st.one_of(st.none(), st.booleans(), st.integers(), st.floats(), st.sampled_from(["sphere", "ring6", "a", ""])),
    lambda inner: st.one_of(
        st.lists(inner, max_size=3),
        st.dictionaries(st.sampled_from(["name", "kind", "points", "neighbors", "probabilities"]), inner, max_size=3),
    ),
    max_leaves=6,
)


@given(
    st.dictionaries(st.sampled_from(sorted(json.loads(BALL.as_json()))), st.one_of(values, st.just(...)), max_size=3)
)
def test_no_json_raises_anything_but_model_error(entries):
    found = attempt(ModelError, Manifest.from_json, changed(**entries))
    if isinstance(found, ModelError):
        assert "\n" not in str(found)
    else:
        assert Manifest.from_json(found.as_json()).as_json() == found.as_json()


def test_a_manifest_checks_itself_wherever_it_comes_from():
    with pytest.raises(ModelError, match="mesh"):
        replace(BALL, mesh="ring5")
    with pytest.raises(ModelError, match="radius"):
        replace(BALL, radius=0.0)


def test_a_manifest_for_a_camera_below_the_ball_has_no_spacing():
    with pytest.raises(GeometryError):
        BALL.mesh_shape.spacing(0.15)


FIELD = tuple(ObjectClass(name, kind) for name, kind in (("ball", "object"), ("goal", "upright"), ("line", "area")))


def upright_look(name="goal", **changes):
    return look_contract(**{"object_class": name, "upright_radius": 0.3} | changes)


def test_looks_at_uprights_round_trip():
    manifest = replace(BALL, classes=FIELD, upright_looks=(upright_look(),))
    assert Manifest.from_json(manifest.as_json()) == manifest


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"upright_looks": (upright_look("ball"),)}, r"\['ball'\], but the classes of kind upright are \['goal'\]"),
        ({"upright_looks": (upright_look("pole"),)}, r"\['pole'\]"),
        ({"upright_looks": (upright_look(), upright_look())}, r"\['goal', 'goal'\]"),
        ({"upright_looks": (upright_look(upright_radius=0.0),)}, "upright_radius of at least 0.01 m, not 0 m"),
        ({"upright_looks": (upright_look(upright_radius=1e-300),)}, "upright_radius of at least 0.01 m"),
        ({"look": look_contract(upright_radius=0.3)}, "it must be 0"),
    ],
)
def test_looks_at_uprights_that_make_no_sense_are_refused(changes, message):
    with pytest.raises(ModelError, match=message):
        replace(BALL, classes=FIELD, **changes)


@pytest.mark.parametrize("wrong", [None, {}, 3, "goal"])
def test_looks_at_uprights_that_are_no_list_are_refused(wrong):
    with pytest.raises(ModelError, match="upright_looks"):
        Manifest.from_json(changed(upright_looks=wrong))


def test_operations_beyond_all_networks_are_refused():
    with pytest.raises(ModelError, match="operations"):
        Manifest.from_json(changed(operations=10**400))
