"""Imports inside vm_synth point down, and what is heavy is loaded only where it is used."""

import ast
import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import vm_synth

PACKAGE = Path(vm_synth.__file__).parent
MODULES = sorted(path for path in PACKAGE.glob("*.py") if path.stem != "__init__")

LAYERS = [
    {"ranges", "llvm", "progress", "stopping", "worker_process"},
    {"paints", "environment", "smoothing", "outlines", "ball_sphere", "ball_design"},
    {"solids", "camera", "field", "sensor", "ball_prints"},
    {"primitives", "ball_patterns"},
    {"people", "clutter", "distractors", "goals", "robots", "balls"},
    {"carrier"},
    {"bodies"},
    {"configuration", "scene"},
    {"placing"},
    {"drawing"},
    {"tracer"},
    {"things"},
    {"picture"},
    {"dataset"},
    {"workers", "inspection", "sheet"},
    {"report"},
    {"plots"},
    {"cli"},
    {"__main__"},
]
LAYER_OF = {name: number for number, names in enumerate(LAYERS) for name in names}

EVERYWHERE = {"numpy", "cv2", "vm_embedded"}
HEAVY = {"mitsuba": {"llvm", "tracer"}, "drjit": {"llvm", "tracer"}, "matplotlib": {"plots"}}
"""Packages that are imported only by these modules, and only inside their functions."""


def names_of(node: ast.AST) -> Iterator[str]:
    """Names of the modules that a statement imports, relative ones with their dots."""
    if isinstance(node, ast.Import):
        yield from (alias.name for alias in node.names)
    elif isinstance(node, ast.ImportFrom):
        yield "." * node.level + (node.module or "")


def imports(path: Path) -> set[str]:
    """All that a module imports, anywhere."""
    return {name for node in ast.walk(ast.parse(path.read_text())) for name in names_of(node)}


def imports_at_once(path: Path) -> set[str]:
    """What importing a module imports: not what its functions do, nor what only type checkers read."""

    def executed(node: ast.AST) -> Iterator[ast.AST]:
        yield node
        for each in ast.iter_child_nodes(node):
            types_only = isinstance(each, ast.If) and ast.unparse(each.test) == "TYPE_CHECKING"
            if not types_only and not isinstance(each, ast.FunctionDef | ast.AsyncFunctionDef):
                yield from executed(each)

    return {name for node in executed(ast.parse(path.read_text())) for name in names_of(node)}


def within(path: Path) -> set[str]:
    """Modules of vm_synth that a module imports."""
    return {name[1:] for name in imports(path) if name.startswith(".")}


def tops(names: set[str]) -> set[str]:
    """Packages that absolute names are of."""
    return {name.split(".")[0] for name in names if not name.startswith(".")}


def test_every_module_has_a_layer():
    assert {path.stem for path in MODULES} == set(LAYER_OF)


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.stem)
def test_imports_point_down(path):
    for name in within(path):
        assert LAYER_OF[name] < LAYER_OF[path.stem], f"{path.stem} imports {name}, which is not below it"


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.stem)
def test_of_the_project_only_vm_embedded_is_imported(path):
    allowed = EVERYWHERE | set(sys.stdlib_module_names) | {name for name, users in HEAVY.items() if path.stem in users}
    assert tops(imports(path)) <= allowed


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.stem)
def test_what_is_heavy_is_imported_inside_functions(path):
    assert tops(imports_at_once(path)) <= EVERYWHERE | set(sys.stdlib_module_names)


def test_the_robot_s_side_does_not_know_of_pictures():
    import vm_embedded

    for path in Path(vm_embedded.__file__).parent.glob("*.py"):
        assert "vm_synth" not in tops(imports(path)), path.stem


def test_a_fresh_interpreter_loads_nothing_heavy_with_the_program():
    program = "import sys, json, vm_synth.cli; print(json.dumps(sorted({name.split('.')[0] for name in sys.modules})))"
    loaded = json.loads(subprocess.run([sys.executable, "-c", program], capture_output=True, check=True).stdout)
    assert "vm_synth" in loaded
    assert not set(loaded) & {"mitsuba", "drjit", "torch", "matplotlib", "onnx", "scipy", "vm_export"}


def test_a_module_that_imports_at_once_is_told_from_one_that_waits(tmp_path):
    """So that the tests above are no accident."""
    path = tmp_path / "made.py"
    path.write_text(
        "import numpy\nfrom typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    import torch\n"
        "class A:\n    import drjit\n    def b(self):\n        import scipy\n"
        "try:\n    import mitsuba\nexcept ImportError:\n    import onnx\n"
    )
    assert tops(imports(path)) == {"numpy", "typing", "torch", "drjit", "scipy", "mitsuba", "onnx"}
    assert tops(imports_at_once(path)) == {"numpy", "typing", "drjit", "mitsuba", "onnx"}
