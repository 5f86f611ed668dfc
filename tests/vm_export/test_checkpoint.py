"""Checkpoints are read back as they were written, and broken ones are refused."""

import pytest
import torch

from tests.vm_export.checkpoints import checkpoint, manifest
from vm_embedded.errors import InputError, ModelError
from vm_export.checkpoint import Checkpoint


@pytest.mark.parametrize("mesh", ["ring6", "octaves"])
def test_checkpoints_are_plain_values_and_read_back(mesh, tmp_path):
    made = checkpoint(7, mesh=mesh)
    made.save(tmp_path / "model.pt")
    torch.load(tmp_path / "model.pt", weights_only=True)
    read = Checkpoint.load(tmp_path / "model.pt")
    assert read.network.shape == made.network.shape
    assert read.manifest.as_json() == made.manifest.as_json()
    for name, value in made.network.state_dict().items():
        assert torch.equal(read.network.state_dict()[name], value)


@pytest.mark.parametrize("content", [b"", b"nothing", b"PK\x03\x04 broken"])
def test_broken_checkpoints_are_refused(tmp_path, content):
    (tmp_path / "model.pt").write_bytes(content)
    with pytest.raises(InputError, match="checkpoint"):
        Checkpoint.load(tmp_path / "model.pt")


def test_foreign_and_mismatched_checkpoints_are_refused(tmp_path):
    torch.save({"weights": torch.zeros(3)}, tmp_path / "foreign.pt")
    with pytest.raises(InputError, match="format"):
        Checkpoint.load(tmp_path / "foreign.pt")
    with pytest.raises(InputError, match="can't read"):
        Checkpoint.load(tmp_path / "missing.pt")
    checkpoint().save(tmp_path / "model.pt")
    content = torch.load(tmp_path / "model.pt", weights_only=True)
    state = {f"first.{name}": value for name, value in content["state"].items()}
    torch.save(content | {"state": state}, tmp_path / "model.pt")
    with pytest.raises(InputError, match="the weights do not fit the network"):
        Checkpoint.load(tmp_path / "model.pt")
    with pytest.raises(ModelError, match="outputs"):
        Checkpoint(checkpoint().network, manifest(("ball", "line", "field")))
    rings, canvas = checkpoint(), checkpoint(mesh="octaves")
    for one, other in ((rings, canvas), (canvas, rings)):
        with pytest.raises(ModelError, match=f"mesh {other.manifest.mesh} is for another kind of network"):
            Checkpoint(one.network, other.manifest)
