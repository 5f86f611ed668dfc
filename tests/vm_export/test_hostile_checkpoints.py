"""Checkpoints with parts missing, damaged, or with code in them: one line says so, and advises nothing dangerous."""

import pickle
import random

import pytest
import torch

from tests.vm_export.checkpoints import checkpoint
from tests.vm_export.looks import look_checkpoint
from vm_embedded.errors import InputError, VisualMeshError
from vm_export.checkpoint import Checkpoint
from vm_export.cli import main
from vm_export.look_checkpoint import LookCheckpoint


def told(path, capsys):
    """What vm-export says about a checkpoint that it refuses."""
    assert main([str(path)]) == 1
    error = capsys.readouterr().err
    assert error.startswith("vm-export: ")
    assert error.count("\n") == 1
    assert "weights_only" not in error
    return error


@pytest.mark.parametrize("value", [..., None, 7, [], {"a": 1}, "text"], ids=str)
@pytest.mark.parametrize("key", ["network", "state", "manifest", "grid"])
def test_attack_8_a_checkpoint_with_a_missing_or_wrong_part_is_refused_in_a_line(key, value, tmp_path, capsys):
    path = tmp_path / "model.pt"
    checkpoint().save(path)
    content = torch.load(path, weights_only=True)
    content[key] = value
    if value is ...:
        del content[key]
    torch.save(content, path)
    assert str(path) in told(path, capsys)


class Evil:
    def __reduce__(self):
        return print, ("executed",)


def test_attack_8_the_refusal_of_a_pickle_does_not_advise_to_load_it_without_protection(tmp_path, capsys):
    path = tmp_path / "model.pt"
    torch.save({"format": Evil()}, path)
    assert "more than plain values" in told(path, capsys)
    path.write_bytes(pickle.dumps(Evil(), protocol=2))
    told(path, capsys)


def test_a_pickle_of_another_protocol_is_refused_without_a_warning(tmp_path, capfd, recwarn):
    path = tmp_path / "model.pt"
    path.write_bytes(pickle.dumps({"format": "other"}, protocol=3))
    told(path, capfd)
    assert [str(each.message) for each in recwarn] == []


@pytest.mark.parametrize(("kind", "made"), [(Checkpoint, checkpoint), (LookCheckpoint, look_checkpoint)])
def test_attack_8_damaged_checkpoints_raise_nothing_else(kind, made, tmp_path):
    path = tmp_path / "model.pt"
    made().save(path)
    whole, chance = path.read_bytes(), random.Random(1)
    messages = []
    for _ in range(60):
        content = bytearray(whole)
        for _ in range(chance.randrange(1, 4)):
            content[chance.randrange(len(content))] ^= 1 << chance.randrange(8)
        path.write_bytes(content[: chance.choice((len(content), chance.randrange(len(content))))])
        try:
            kind.load(path)
        except VisualMeshError as error:
            messages.append(str(error))
    assert len(messages) > 20
    assert "weights_only" not in "".join(messages)


@pytest.mark.parametrize(("kind", "made"), [(Checkpoint, checkpoint), (LookCheckpoint, look_checkpoint)])
def test_a_checkpoint_that_was_cut_short_is_not_called_unreadable(kind, made, tmp_path):
    path = tmp_path / "model.pt"
    made().save(path)
    whole = path.read_bytes()
    for share in (0.05, 0.2, 0.4, 0.6, 0.8, 0.95):
        path.write_bytes(whole[: int(share * len(whole))])
        with pytest.raises(InputError, match="is not a checkpoint"):
            kind.load(path)
