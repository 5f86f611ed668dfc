"""vm-deploy rollback after vm-deploy model: it undoes the last change, whichever it was."""

import shutil
import sys
from pathlib import Path

import pytest

from tests.other_model import OTHER

from .bundles import CHECKOUT
from .prefixes import Prefix

pytestmark = pytest.mark.long

MODELS = {name: CHECKOUT / "vm_embedded" / "models" / f"{name}.onnx" for name in ("ball", "soccer")} | {"other": OTHER}


class Light(Prefix):
    """Releases that run the program of this checkout, without its packages."""

    def deploy(self, *words):
        return self._run(self.path / "current" / "bundle" / "vm-deploy", *words)

    @property
    def model(self):
        content = (self.path / "current" / "etc" / "model.onnx").read_bytes()
        return next(name for name, path in MODELS.items() if path.read_bytes() == content)


@pytest.fixture
def prefix(tmp_path):
    made = Light(tmp_path / "prefix", [])
    for release in ("1-first", "2-second"):
        folder = made.path / "releases" / release
        shutil.copytree(CHECKOUT / "deploy" / "robot", folder / "bundle")
        (folder / "venv" / "bin").mkdir(parents=True)
        (folder / "venv" / "bin" / "vm-detect").symlink_to(Path(sys.executable).parent / "vm-detect")
        (folder / "etc").mkdir()
        (folder / "etc" / "vm.toml").write_text('model = "model.onnx"\n')
        shutil.copy(MODELS["ball"], folder / "etc" / "model.onnx")
        (folder / "complete").touch()
    (made.path / "supervisor").write_text("none\n")
    (made.path / "run").mkdir()
    (made.path / "current").symlink_to("releases/2-second")
    (made.path / "previous").symlink_to("releases/1-first")
    return made


def test_a_model_is_taken_back_before_a_release(prefix):
    changed = prefix.deploy("model", MODELS["other"])
    assert (changed.returncode, prefix.model, prefix.link("current")) == (0, "other", "2-second"), changed.stderr
    assert "note:" not in changed.stdout
    for model in ("ball", "other"):
        back = prefix.deploy("rollback")
        assert (back.returncode, prefix.model, prefix.link("current")) == (0, model, "2-second"), back.stderr
    assert prefix.deploy("rollback", "2-second").returncode == 2
    for release, model in (("1-first", "ball"), ("2-second", "other")):  # the second one undoes the first
        back = prefix.deploy("rollback", *(["release"] if release == "1-first" else []))
        assert (back.returncode, prefix.model, prefix.link("current")) == (0, model, release), back.stderr


def test_a_model_with_other_classes_is_remarked(prefix):
    changed = prefix.deploy("model", MODELS["soccer"])
    assert (changed.returncode, prefix.model) == (0, "soccer"), changed.stderr
    (note,) = (line for line in changed.stdout.splitlines() if line.startswith("note:"))
    assert "goal" in note
    refused = prefix.deploy("model", CHECKOUT / "pyproject.toml")
    assert (refused.returncode, prefix.model) == (1, "soccer")
