"""vm-export as a user types it."""

import json
import subprocess
import sys
from functools import partial

import numpy as np
import pytest
import yaml

from tests.programs import run_program
from tests.vm_export.checkpoints import checkpoint, manifest
from tests.vm_export.test_reference import reference_file
from vm_embedded.network.manifest import EDGES, ObjectClass
from vm_embedded.network.model_file import read_model
from vm_embedded.network.session import Session
from vm_export import export

run = partial(run_program, "vm-export")


def test_command_exports_a_checkpoint_and_prints_the_difference(tmp_path):
    checkpoint().save(tmp_path / "model.pt")
    done = run(tmp_path / "model.pt", "-o", tmp_path / "model.onnx", "--object-radius", 0.05, "--edge", "same")
    assert "largest difference" in done.stdout
    read = read_model(tmp_path / "model.onnx").manifest
    assert read.object_radius == 0.05
    assert read.edge == "same"


@pytest.mark.long
def test_command_names_its_output_after_the_model(tmp_path):
    checkpoint().save(tmp_path / "model.pt")
    run(tmp_path / "model.pt")
    run(tmp_path / "model.pt", "--to-yaml")
    assert (tmp_path / "model.onnx").exists()
    assert yaml.safe_load((tmp_path / "model.yaml").read_text())["mesh"] == "RING6"


def names_in(folder):
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize("mesh", ["ring6", "nmgrid8", "cap6", "octaves"])
def test_command_writes_a_model_file(mesh, tmp_path):
    made = checkpoint(mesh=mesh)
    made.save(tmp_path / "model.pt")
    done = run(tmp_path / "model.pt")
    assert names_in(tmp_path) == ["model.onnx", "model.pt"]
    read = read_model(tmp_path / "model.onnx")
    assert read.manifest.mesh == mesh
    test = export.random_example(made.network, 300, 1)
    np.testing.assert_allclose(Session(read).answer(test), test.probabilities[:-1], atol=1e-5)
    assert f"{tmp_path / 'model.onnx'}: mesh network" in done.stdout
    assert "largest difference" in done.stdout


@pytest.mark.long
def test_command_takes_class_names(tmp_path):
    path = reference_file(tmp_path / "model.yaml")
    run(path, "--classes", "penguin:object, nothing:background")
    classes = read_model(tmp_path / "model.onnx").manifest.classes
    assert classes == (ObjectClass("penguin", "object"), ObjectClass("nothing", "background"))
    assert "2 outputs" in run(path, "--classes", "ball", code=1).stderr
    assert "penguin" in run(path, "--classes", "penguin,field", code=1).stderr


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("missing.pt",), "missing.pt"),
        (("missing.yaml",), "missing.yaml"),
        (("model.txt",), "checkpoint"),
        (("soccr", "--no-look"), "unknown network 'soccr'; did you mean 'soccer'?"),
        (("model.pt", "--look", "bal"), "unknown network 'bal'; did you mean 'ball'?"),
        (("model.pt", "-o", "model.pt"), "would be overwritten; give another output"),
        (("model.pt", "-o", "no/such/folder/model.onnx"), "can't write"),
        (("model.pt", "--intersections", "-1"), "intersections"),
        (("model.pt", "--object-radius", "nan"), "object_radius"),
    ],
)
def test_command_says_in_one_line_what_is_wrong(tmp_path, arguments, message):
    checkpoint().save(tmp_path / "model.pt")
    here = [tmp_path / each if each.endswith((".pt", ".yaml", ".txt", ".onnx")) else each for each in arguments]
    done = run(*here, code=1)
    assert message in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert sorted(path.name for path in tmp_path.iterdir()) == ["model.pt"]


@pytest.mark.long
@pytest.mark.parametrize("missing", ["torch", "onnx", "yaml"])
def test_command_without_its_extra_says_what_to_install(missing, tmp_path):
    program = f"import sys; sys.modules['{missing}'] = None; from vm_export.cli import main; sys.exit(main(['m.yaml']))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 1
    advice = "run: pip install '.[export]' in the folder of vm-embedded"
    assert done.stderr == f"vm-export: {missing} is not installed; {advice}\n"


def test_edges_are_the_manifest_s():
    assert EDGES == ("hard", "same")
    assert json.loads(manifest(edge="same").as_json())["edge"] == "same"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("ball", "--no-look", "-o", "new.pt"), "--output must end in .onnx, not new.pt"),
        (("ball", "--no-look", "-o", "."), ". is a folder: give a file"),
        ((".",), ". is a folder: give a file"),
    ],
)
def test_a_file_must_have_the_suffix_of_its_content(tmp_path, arguments, message):
    done = run_program("vm-export", *arguments, code=1, cwd=tmp_path)
    assert done.stderr == f"vm-export: {message}\n"
    assert not list(tmp_path.iterdir())
