"""Imports inside vm_train point down, and its commands answer before anything heavy is loaded."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

import vm_train
from tests.vm_synth.test_layers import imports, imports_at_once, tops

PACKAGE = Path(vm_train.__file__).parent
MODULES = sorted(path for path in PACKAGE.glob("*.py") if path.stem != "__init__")
OTHERS = {"vm_embedded", "vm_export", "vm_synth"}
QUICK = {"cli", "options", "evaluate_cli", "configuration"}
"""What help texts and configurations need."""


def uses(path):
    return {name[1:] for name in imports(path) if name.startswith(".")} - {""}


def test_no_two_modules_import_each_other():
    remaining = {path.stem: uses(path) for path in MODULES}
    while remaining:
        free = [name for name, needs in remaining.items() if not needs & set(remaining)]
        assert free, f"circle among {sorted(remaining)}"
        for name in free:
            del remaining[name]


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.stem)
def test_nothing_below_knows_of_training(path):
    for package in OTHERS:
        for other in (PACKAGE.parent / package, PACKAGE.parents[1] / package):
            for each in other.glob("*.py"):
                assert "vm_train" not in tops(imports(each)), f"{package}.{each.stem}"


@pytest.mark.parametrize("name", ["vm_train.cli.train", "vm_train.cli.evaluate"])
def test_a_command_answers_before_torch_is_loaded(name):
    program = f"import sys, json, {name}; print(json.dumps(sorted({{n.split('.')[0] for n in sys.modules}})))"
    loaded = json.loads(subprocess.run([sys.executable, "-c", program], capture_output=True, check=True).stdout)
    assert not set(loaded) & {"mitsuba", "drjit", "matplotlib", "tensorboard"}


def test_matplotlib_is_imported_where_it_is_used():
    for path in MODULES:
        assert "matplotlib" not in tops(imports_at_once(path)), path.stem
