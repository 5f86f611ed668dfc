"""The section "From paper to code" of docs/design.md: rows lead to code, and every label of the paper has a row."""

import ast
import os
import re
from pathlib import Path

import pytest

TOP = Path(__file__).resolve().parent.parent
DESIGN = TOP / "docs" / "design.md"
PAPER = Path(os.environ.get("VM_SHARED", TOP.parent / "shared")) / "paper" / "visual_mesh_paper.tex"

EQUATIONS = {"eqn:circle_phi1", "eqn:circle_dtheta", "eqn:sphere_phi_1"}
FIGURES = {
    *("fig:circle_phi", "fig:sphere_phi", "fig:circle_theta", "fig:geometry", "fig:multi_sphere_intersections"),
    *("fig:mesh_projection", "fig:mesh_distance", "fig:plots", "fig:pr_curve", "fig:ball_distance_graph", "fig:pr_map"),
    *(f"fig:ball_detection_images{number}" for number in ("", "_1", "_2", "_3")),
}
LABELS = EQUATIONS | FIGURES | {"tab:visualmesh_performance"}


def rows():
    """(label or section of the paper, claim, code) of each row."""
    section = re.search(r"^## From paper to code\n(.*?)^## ", DESIGN.read_text(), re.MULTILINE | re.DOTALL)
    cells = [line.strip("| ").split(" | ") for line in section[1].splitlines() if line.startswith("| ")]
    assert all(len(row) == 3 for row in cells)
    return [tuple(row) for row in cells if row[0] not in ("in the paper", "---")]


ROWS = rows()


def defined_in(path):
    """Names of a file's functions, classes and constants, and of methods and fields as Class.name."""
    names = set()
    for node in ast.parse(path.read_text()).body:
        names |= _names_of(node)
        if isinstance(node, ast.ClassDef):
            names |= {f"{node.name}.{name}" for each in node.body for name in _names_of(each)}
    return names


def _names_of(node):
    if isinstance(node, ast.FunctionDef | ast.ClassDef):
        return {node.name}
    targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
    return {each.id for each in targets if isinstance(each, ast.Name)}


@pytest.mark.parametrize(("label", "code"), [(label, code) for label, _, code in ROWS])
def test_every_row_leads_to_its_code(label, code):
    if code.startswith(("not here: ", "measured: ")):
        assert label.strip("`") not in EQUATIONS
        return
    for entry in code.split("<br>"):
        match = re.fullmatch(r"\[`([\w./]+)`\]\(\.\./([\w./]+)\): ((?:`[\w.]+`(?:, )?)+)", entry)
        assert match, f"{label}: {entry}"
        assert match[1] == match[2]
        path = TOP / match[1]
        assert path.is_file(), f"{label}: {path} is missing"
        for name in re.findall(r"`([\w.]+)`", match[3]):
            assert name in defined_in(path), f"{label}: {match[1]} has no {name}"
        if label.startswith("`"):
            assert re.search(rf"{label.strip('`')}\b", path.read_text()), f"{match[1]} does not name {label}"


def test_every_label_of_the_paper_has_a_row():
    named = {label.strip("`") for label, _, _ in ROWS if label.startswith("`")}
    assert named == LABELS
    assert len(ROWS) > 50


def test_labels_and_sections_are_the_papers():
    if not PAPER.is_file():
        pytest.skip(f"needs the paper, which is not at {PAPER}; set VM_SHARED to the folder above it")
    text = PAPER.read_text()
    assert {label for label in re.findall(r"\\label\{([^}]*)\}", text) if not label.startswith("sec:")} == LABELS
    sections = set(re.findall(r"section\{([^}]*)\}", text))
    named = {label for label, _, _ in ROWS if not label.startswith("`")}
    assert named <= sections, f"no sections of the paper: {sorted(named - sections)}"


def test_equations_stand_in_the_code_that_builds_meshes():
    shapes = "".join(path.read_text() for path in (TOP / "vm_embedded" / "geometry").glob("*.py"))
    only_for_tests = (TOP / "vm_embedded" / "geometry" / "paper_recursions.py").read_text()
    assert all(label in shapes.replace(only_for_tests, "") for label in EQUATIONS)
