"""Imports point down, and the robot's side needs three packages."""

import ast
import json
import subprocess
import sys
from pathlib import Path

import pytest

import vm_embedded

PACKAGE = Path(vm_embedded.__file__).parent
TOP = PACKAGE.parent

LAYERS = [
    {
        "errors",
        "arrays",
        "files",
        "progress",
        "entries",
        "sections",
        "events",
        "notify",
        "metrics",
        "local_sockets",
        "decoding",
    },
    {"shape", "cylinder", "shapes", "recursion", "lens", "lens_opencv", "orientation", "planes", "yaml_reader"},
    {"mesh"},
    {"rings", "grids"},
    {"cap", "walls"},
    {"mesh_models"},
    {
        "projection",
        "sampling",
        "clustering",
        "manifest",
        "layout",
        "runs_layout",
        "lattice_layout",
        "layouts",
        "onnx_file",
        "detections",
        "lens_file",
        "settings",
        "objects",
        "shipped",
        "footprint",
        "relative",
    },
    {"cache", "session"},
    {"detector"},
    {"views"},
    {"sources", "overlay", "sinks", "bench", "poses", "pose_lines", "camera", "messages", "web"},
    {"camera_opencv", "camera_mjpeg", "camera_files", "camera_synthetic", "camera_fault"},
    {"cameras", "pose_stream", "outputs", "recorder", "status_settings", "deploy_settings", "status_page", "control"},
    {"configuration", "grabber", "health", "figures"},
    {"options", "tuning", "daemon", "doctor"},
    {"cli", "bench_cli", "doctor_cli"},
]
LAYER_OF = {name: number for number, names in enumerate(LAYERS) for name in names}


def imported_modules(path: Path) -> set[str]:
    """Names of all modules that a file imports, relative ones without their dots."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            names.add(("." * node.level) + (node.module or ""))
    return names


def runtime_modules() -> list[Path]:
    return sorted(path for path in PACKAGE.glob("*.py") if path.stem != "__init__")


def test_every_module_has_a_layer():
    assert {path.stem for path in runtime_modules()} == set(LAYER_OF)


@pytest.mark.parametrize("path", runtime_modules(), ids=lambda path: path.stem)
def test_imports_point_down(path):
    own = LAYER_OF[path.stem]
    for name in imported_modules(path):
        if name.startswith("."):
            assert LAYER_OF[name.lstrip(".")] <= own, f"{path.stem} imports {name}, which is above it"
        assert not name.startswith(("vm_export", "vm_synth")), f"{path.stem} imports the training side"


def test_no_two_modules_import_each_other():
    uses = {
        path.stem: {name.lstrip(".") for name in imported_modules(path) if name.startswith(".")}
        for path in runtime_modules()
    }
    remaining = dict(uses)
    while remaining:
        free = [name for name, needs in remaining.items() if not needs & set(remaining)]
        assert free, f"circle among {sorted(remaining)}"
        for name in free:
            del remaining[name]


def test_only_session_imports_onnxruntime():
    users = [path.stem for path in runtime_modules() if "onnxruntime" in imported_modules(path)]
    assert users == ["session"]


def test_runtime_imports_three_packages_and_the_standard_library():
    for path in runtime_modules():
        for name in imported_modules(path):
            top = name.split(".")[0]
            assert not top or top in sys.stdlib_module_names or top in ("numpy", "cv2", "onnxruntime"), (
                path.stem,
                name,
            )


def test_a_fresh_interpreter_does_not_load_the_training_side():
    program = (
        "import sys, json, vm_embedded, vm_embedded.cli.detect;"
        "print(json.dumps(sorted({name.split('.')[0] for name in sys.modules})))"
    )
    loaded = json.loads(subprocess.run([sys.executable, "-c", program], capture_output=True, check=True).stdout)
    assert not set(loaded) & {"torch", "onnx", "matplotlib", "yaml", "vm_export", "vm_synth", "mitsuba", "scipy"}


def test_all_names_resolve():
    assert all(hasattr(vm_embedded, name) for name in vm_embedded.__all__)


def test_top_level_is_as_agreed():
    tracked = subprocess.run(["git", "ls-files"], cwd=TOP, capture_output=True, text=True)
    if tracked.returncode:
        pytest.skip("not a git checkout")
    top = {line.split("/")[0] for line in tracked.stdout.splitlines()}
    visible = {name for name in top if not name.startswith(".")}
    assert visible == {
        *("pyproject.toml", "Makefile", "README.md", "LICENSE", "CHANGELOG.md"),
        *("vm_embedded", "export", "deploy", "tests", "benchmarks", "docs"),
    }
