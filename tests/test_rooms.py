"""Imports point down between the rooms and packages, and heavy packages load only where they are used."""

import ast
import importlib
import json
import subprocess
import sys

import pytest

import vm_embedded

from . import rooms
from .rooms import CHECKOUT, ROOMS, read_package, read_project, top_names

PROJECT = read_project()

FEWEST = {
    "vm_programs": 1,
    "vm_embedded": 70,
    "vm_workstation": 4,
    "vm_export": 12,
    "vm_synth": 35,
    "vm_mesh": 6,
    "vm_label": 8,
    "vm_calibrate": 12,
    "vm_ros": 8,
    "vm_train": 55,
}
"""Fewer modules than these mean that a check below looks in the wrong place."""

OUTSIDE = {
    "vm_programs": set(),
    "vm_embedded": {"numpy", "cv2", "onnxruntime", "tomli", "typing_extensions", "rosbags"},
    "vm_workstation": {"numpy", "cv2", "matplotlib"},
    "vm_export": {"numpy", "torch", "onnx", "yaml"},
    "vm_synth": {"numpy", "cv2", "mitsuba", "drjit", "matplotlib", "typing_extensions"},
    "vm_mesh": {"numpy", "matplotlib"},
    "vm_label": {"numpy", "cv2"},
    "vm_train": {"numpy", "cv2", "torch", "matplotlib", "google", "google_crc32c"},
    "vm_calibrate": {"numpy", "cv2", "scipy"},
    "vm_ros": {"numpy", "cv2", "rclpy", "cyclonedds"},
}
"""Packages of others that each package may import."""

RAY_TRACING = ["vm_synth.render.mitsuba", "vm_synth.render.tracer"]
"""The only modules that import mitsuba or drjit."""

HEAVY = {"mitsuba", "drjit", "matplotlib", "scipy", "rosbags"}
"""Packages that are only imported inside functions, and for types."""


def of(package):
    return {name: module for name, module in PROJECT.items() if module.package == package}


def loaded_by(module):
    """Top-level names of all that a fresh interpreter has loaded after it imported a module."""
    program = f"import sys, json, {module}; print(json.dumps(sorted({{name.split('.')[0] for name in sys.modules}})))"
    return set(json.loads(subprocess.run([sys.executable, "-c", program], capture_output=True, check=True).stdout))


@pytest.mark.parametrize("package", ROOMS)
def test_every_module_is_in_a_known_room(package):
    modules = of(package)
    assert len(modules) >= FEWEST[package]
    assert len(modules) == len(list(modules[package].path.parent.rglob("*.py")))
    assert rooms.without_room(modules) == []


def test_imports_point_down():
    assert rooms.upward_imports(PROJECT) == []


def test_a_module_that_can_run_is_complete_before_it_does():
    """`python -m` runs the program where it stands: what a module defines behind it does not exist yet."""
    runs = 0
    for module in PROJECT.values():
        body = ast.parse(module.path.read_text()).body
        starts = [isinstance(each, ast.If) and "__main__" in ast.unparse(each.test) for each in body]
        assert not any(starts[:-1]), module.path
        runs += any(starts)
    assert runs >= 10


def test_no_modules_import_each_other():
    assert rooms.circles(PROJECT) == []


def test_every_room_has_modules():
    for package in ROOMS:
        used = {rooms.room_of(name) for name in of(package) if name.count(".")}
        assert used == set(rooms.levels(package)), package


def test_a_room_s_init_holds_one_docstring_line():
    inits = [module.path for name, module in PROJECT.items() if module.path.name == "__init__.py" and "." in name]
    assert len(inits) >= 20
    for path in inits:
        (line,) = ast.parse(path.read_text()).body
        assert isinstance(line, ast.Expr), path
        assert isinstance(line.value, ast.Constant), path
        assert len(path.read_text().splitlines()) == 1, path
        assert len(line.value.value) > 20, path


def test_only_one_module_imports_onnxruntime():
    assert rooms.importers(PROJECT, "onnxruntime") == ["vm_embedded.network.onnx_model"]


def test_packages_import_what_they_may_and_the_standard_library():
    for module in PROJECT.values():
        allowed = OUTSIDE[module.package] | rooms.PACKAGES[module.package] | {module.package}
        unknown = top_names(module.imports) - allowed - set(sys.stdlib_module_names)
        assert not unknown, module.name


def test_heavy_packages_are_imported_inside_functions():
    for module in PROJECT.values():
        assert not top_names(module.at_import) & HEAVY, module.name
        assert not any(name.startswith("torch.utils.tensorboard") for name in module.at_import), module.name


def test_heavy_packages_are_imported_where_they_are_used():
    for package in ("mitsuba", "drjit"):
        assert set(rooms.importers(PROJECT, package)) <= set(RAY_TRACING)
    assert rooms.importers(of("vm_synth"), "matplotlib") == ["vm_synth.dataset.plots"]


@pytest.mark.parametrize(
    ("module", "never"),
    [
        (
            "vm_embedded.cli.detect",
            {"torch", "onnx", "matplotlib", "yaml", "mitsuba", "scipy", "rosbags", "vm_export", "vm_synth", "vm_ros"},
        ),
        ("vm_export.cli", {"torch", "onnx", "matplotlib", "yaml", "mitsuba", "vm_synth", "vm_train"}),
        ("vm_synth.cli", {"mitsuba", "drjit", "torch", "matplotlib", "onnx", "scipy", "vm_export"}),
        ("vm_mesh.cli", {"torch", "onnx", "matplotlib", "mitsuba", "vm_export", "vm_synth", "vm_train"}),
        (
            "vm_label.cli",
            {"torch", "onnx", "matplotlib", "mitsuba", "vm_export", "vm_synth", "vm_train"},
        ),
        ("vm_calibrate.cli", {"torch", "onnx", "matplotlib", "mitsuba", "scipy", "vm_export", "vm_synth", "vm_train"}),
        ("vm_ros.cli", {"torch", "onnx", "matplotlib", "scipy", "cyclonedds", "rclpy", "rosbags", "vm_export"}),
        ("vm_train.cli.train", {"mitsuba", "drjit", "matplotlib", "tensorboard"}),
        ("vm_train.cli.evaluate", {"mitsuba", "drjit", "matplotlib", "tensorboard"}),
    ],
)
def test_a_program_s_help_loads_nothing_heavy(module, never):
    loaded = loaded_by(module)
    assert module.split(".")[0] in loaded
    assert not loaded & never


def test_public_names_resolve():
    assert len(vm_embedded.__all__) > 20
    assert all(hasattr(vm_embedded, name) for name in vm_embedded.__all__)
    for name, module in PROJECT.items():
        if name != "vm_embedded" and "__all__" in module.path.read_text():
            loaded = importlib.import_module(name)
            assert all(hasattr(loaded, each) for each in loaded.__all__), name


def test_top_level_is_as_agreed():
    tracked = subprocess.run(["git", "ls-files"], cwd=CHECKOUT, capture_output=True, text=True)
    if tracked.returncode:
        pytest.skip("not a git checkout")
    top = {line.split("/")[0] for line in tracked.stdout.splitlines()}
    visible = {name for name in top if not name.startswith(".")}
    assert visible == {
        *("pyproject.toml", "Makefile", "README.md", "LICENSE", "CHANGELOG.md", "MANIFEST.in"),
        *("vm_embedded", "export", "deploy", "tests", "benchmarks", "docs"),
    }


def test_the_runtime_is_a_short_list():
    entries = {path.name for path in (CHECKOUT / "vm_embedded").iterdir()} - {"__pycache__"}
    assert 10 < len(entries) <= 18, sorted(entries)


@pytest.fixture
def made(tmp_path, monkeypatch):
    """Writes a package of three rooms and returns its modules."""
    monkeypatch.setitem(ROOMS, "made", "top > left, right > low+lower")
    monkeypatch.setitem(rooms.PACKAGES, "made", {"vm_embedded"})

    def write(**files):
        contents = {
            "top/a": "from ..left.b import x\nfrom .. import low",
            "left/b": "import made.lower",
            "right/c": "from .d import x\nfrom ..low import y",
            "right/d": "",
            "low": "def f():\n    from . import lower",
            "lower": "import vm_embedded.errors",
        }
        contents |= {name.replace("__", "/"): text for name, text in files.items()}
        for name, text in contents.items():
            path = tmp_path / "made" / f"{name}.py"
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
        (tmp_path / "made/__init__.py").write_text("from .top.a import x")
        return read_package(tmp_path / "made")

    return write


def test_a_package_in_order_is_not_reported(made):
    modules = made()
    assert len(modules) == 7
    assert rooms.uses(modules["made.top.a"], modules) == {"made.left.b", "made.low"}
    assert rooms.without_room(modules) == rooms.upward_imports(modules) == rooms.circles(modules) == []
    assert rooms.measures(modules, "made") == (1, 1 / 2)


def test_a_reversed_import_is_reported(made):
    assert rooms.upward_imports(made(lower="def f():\n    from .top import a")) == ["made.lower imports made.top.a"]


def test_an_import_from_a_room_beside_is_reported(made):
    assert rooms.upward_imports(made(left__b="from made.right import d")) == ["made.left.b imports made.right.d"]


def test_an_import_of_the_public_names_is_reported(made):
    assert rooms.upward_imports(made(right__d="from .. import x")) == ["made.right.d imports made"]


def test_an_import_of_a_package_above_is_reported(made):
    modules = made(lower="from vm_embedded import errors\nfrom vm_train.learning import configuration") | PROJECT
    assert "made.lower imports vm_train.learning.configuration" in rooms.upward_imports(modules)
    assert "made.lower imports vm_embedded.errors" not in rooms.upward_imports(modules)


def test_a_circle_is_reported(made):
    assert rooms.circles(made(right__d="def f():\n    from . import c")) == ["made.right.c", "made.right.d"]


def test_a_module_in_no_room_is_reported(made, monkeypatch):
    modules = made(attic__e="", cellar="")
    assert rooms.without_room(modules) == ["made.attic.e", "made.cellar"]
    monkeypatch.setitem(ROOMS, "made", "")
    assert "made.top.a" in rooms.without_room(modules)


def test_an_import_of_onnxruntime_is_reported(made):
    modules = made(right__d="def f():\n    from onnxruntime.capi import states")
    assert rooms.importers(modules, "onnxruntime") == ["made.right.d"]


def test_imports_inside_functions_and_for_types_are_told_from_others(made):
    module = made(
        low="import numpy\nfrom typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    import torch\n"
        "class A:\n    import drjit\n    def b(self):\n        import scipy\n"
        "try:\n    import mitsuba\nexcept ImportError:\n    import onnx\n"
    )["made.low"]
    assert top_names(module.imports) == {"numpy", "typing", "torch", "drjit", "scipy", "mitsuba", "onnx"}
    assert top_names(module.at_import) == {"numpy", "typing", "drjit", "mitsuba", "onnx"}
