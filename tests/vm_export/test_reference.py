"""Networks in the reference's format: read, written, and refused with what is wrong."""

import numpy as np
import pytest
import torch
import yaml
from hypothesis import given
from hypothesis import strategies as st

from tests.vm_export.checkpoints import checkpoint, manifest
from vm_embedded.errors import InputError
from vm_export import export
from vm_export.checkpoint import Checkpoint
from vm_export.network_shape import Layer, NetworkShape
from vm_export.reference import Overrides, read_reference, write_reference


def test_reference_files_survive_a_round_trip(tmp_path):
    shape = NetworkShape(
        (
            Layer("convolution", 5, "selu"),
            Layer("dense", 4, "tanh"),
            Layer("separable", 3, "relu"),
            Layer("convolution", 2, "softmax"),
        )
    )
    made = Checkpoint(checkpoint(9, shape).network, manifest())
    write_reference(made, tmp_path / "model.yaml")
    stored = yaml.safe_load((tmp_path / "model.yaml").read_text())
    assert [len(group) for group in stored["network"]] == [2, 1, 1]
    assert len(stored["network"][0][0]["weights"]) == 4 * 7
    read = read_reference(tmp_path / "model.yaml", Overrides(object_radius=0.075))
    assert read.manifest.classes == made.manifest.classes
    test = export.random_example(made.network, 50, 0)
    with torch.inference_mode():
        again = read.network(torch.from_numpy(test.points), torch.from_numpy(test.neighbors))
    np.testing.assert_allclose(again.numpy(), test.probabilities, atol=1e-5)


@pytest.mark.parametrize("facts", [{"sampling": "footprint"}, {"colors": "relative"}])
def test_a_network_that_sees_other_colors_is_not_written(tmp_path, facts):
    with pytest.raises(InputError, match="this one takes"):
        write_reference(Checkpoint(checkpoint(9).network, manifest(**facts)), tmp_path / "model.yaml")
    assert not list(tmp_path.iterdir())


def test_the_authors_file_survives_a_round_trip(shared, tmp_path):
    source = shared / "reference/model.yaml"
    write_reference(read_reference(source, Overrides(intersections=6.0)), tmp_path / "again.yaml")
    before, after = (yaml.load(path.read_text(), yaml.CSafeLoader) for path in (source, tmp_path / "again.yaml"))
    assert after["mesh"] == before["mesh"]
    assert after["geometry"]["radius"] == before["geometry"]["radius"]
    for old, new in zip(before["network"], after["network"], strict=True):
        for a, b in zip(old, new, strict=True):
            assert a["activation"] == b["activation"]
            np.testing.assert_allclose(a["weights"], b["weights"], rtol=1e-6, atol=1e-6)
            np.testing.assert_allclose(a["biases"], b["biases"], rtol=1e-6)


def reference_file(path, **changes):
    made = Checkpoint(checkpoint(2).network, manifest())
    write_reference(made, path)
    data = yaml.safe_load(path.read_text())
    data.update(changes)
    path.write_text(yaml.safe_dump(data))
    return path


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"mesh": "RING7"}, "ring6"),
        ({"geometry": {"shape": "CUBE", "radius": 0.1, "intersections": 4}}, "sphere"),
        ({"geometry": {"shape": "SPHERE", "radius": 0.1, "intersections": 0.1}}, "--intersections"),
        ({"geometry": {"shape": "SPHERE"}}, "radius"),
        ({"network": []}, "convolution"),
        ({"network": [[{"weights": [[1.0]], "biases": [0.0], "activation": "softmax"}]]}, "channels"),
        ({"class_map": {"ball": 0, "field": 5}}, "--classes"),
        ({"class_map": {"ball": 0, "penguin": 1}}, "penguin"),
        ({"class_map": 3}, "--classes"),
        ({"class_map": {"ball": "first", "field": 1}}, "'first'"),
        ({"geometry": {"shape": "SPHERE", "radius": "wide", "intersections": 4}}, "'wide'"),
        ({"network": [[{"weights": [[1.0, 2.0], [3.0]], "biases": [0.0]}]]}, "the weights of layer 0 must be numbers"),
        ({"network": [[{"weights": [[1.0]], "biases": ["none"]}]]}, "the biases of layer 0 must be numbers"),
        ({"network": [[{"weights": [[1.0]]}]]}, "lacks its biases"),
    ],
)
def test_wrong_reference_files_are_refused_with_what_is_wrong(tmp_path, changes, message):
    with pytest.raises(InputError, match=message):
        read_reference(reference_file(tmp_path / "model.yaml", **changes), Overrides())


def test_a_network_that_reads_alpha_is_refused(tmp_path):
    path = reference_file(tmp_path / "model.yaml")
    data = yaml.safe_load(path.read_text())
    data["network"][0][0]["weights"][3][0] = 0.5
    path.write_text(yaml.safe_dump(data))
    with pytest.raises(InputError, match="fourth input channel"):
        read_reference(path, Overrides())


@pytest.mark.parametrize("content", ["", "[1, 2]", "projection: RECTILINEAR"])
def test_a_yaml_file_of_another_kind_is_refused_with_what_it_lacks(tmp_path, content):
    path = tmp_path / "lens.yaml"
    path.write_text(content)
    with pytest.raises(InputError, match="is not a network of the reference implementation: it lacks geometry, mesh"):
        read_reference(path, Overrides())


def test_a_file_that_was_cut_short_is_refused(tmp_path):
    path = reference_file(tmp_path / "model.yaml")
    whole = path.read_bytes()
    for share in (0.2, 0.5, 0.8, 0.95):
        path.write_bytes(whole[: int(share * len(whole))])
        with pytest.raises(InputError):
            read_reference(path, Overrides())


@given(st.text(max_size=200))
def test_random_text_is_no_reference_file(tmp_path_factory, text):
    path = tmp_path_factory.mktemp("fuzz") / "model.yaml"
    path.write_text(text)
    with pytest.raises(InputError):
        read_reference(path, Overrides())
