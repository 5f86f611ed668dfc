"""The page docs/paper.md: its lines lead to code, and every label of the paper has a line."""

import ast
import os
import re
from functools import cache
from pathlib import Path

import pytest

TOP = Path(__file__).resolve().parent.parent
PAGE = TOP / "docs" / "paper.md"
PAPER = Path(os.environ.get("VM_SHARED", TOP.parent / "shared")) / "paper" / "visual_mesh_paper.tex"

EQUATIONS = {"eqn:circle_phi1", "eqn:circle_dtheta", "eqn:sphere_phi_1"}
FIGURES = {
    *("fig:circle_phi", "fig:sphere_phi", "fig:circle_theta", "fig:geometry", "fig:multi_sphere_intersections"),
    *("fig:mesh_projection", "fig:mesh_distance", "fig:plots", "fig:pr_curve", "fig:ball_distance_graph", "fig:pr_map"),
    *(f"fig:ball_detection_images{number}" for number in ("", "_1", "_2", "_3")),
}
LABELS = EQUATIONS | FIGURES | {"tab:visualmesh_performance"}
CLAIMS = {
    "Visual Mesh Geometry": "plane, height, orientation, radius, recursi, cones, segment, cylinders",
    "Circle": "adds its diameter/adding the diameter, singularity",
    "Sphere": "shadow, circle",
    "Object Dependent Sample Density": "rings, fraction, r1/r_1",
    "Graph Structure of the Mesh": "project, four, number of points, 1 in, two, six, below the camera, ball",
    "Network": "3 x 3, six neighbors, two fewer values, 5 x 5",
    "Dataset": "160,000, mask, orientation, panorama/360 degree, over a hundred, equisolid, rectilinear, ten meters, "
    "size, uniform, intensity of the light",
    "Network Architecture": "two to nine, two to eight, width four, significantly better, SELU, ELU, ReLU, three, "
    "half, one and two ball radii, hexagonal grid, pixels",
    "Training": "gather, equal, weighting, overfitting/over-fitting, 5 %, error, greatly improve, TensorFlow, "
    "fine-tuned, five",
    "Precision": "75 %, hexagonal, deep/depth, 2.5 m, constant, nois, peak, 0 m, distance, five",
    "Detections": "false positives, distan, size",
    "Execution performance": "1280 x 1024, project, GPU",
    "Discussion and Conclusion": "nine, five, SSD MobileNet, RCNN, YOLOv3, 4 m, graph diameter, "
    "best fitting subgraph, resolution, declin, scale/scaling, rotations, orientation, goal posts, lens, height, "
    "below the camera, twice as many points",
    "Abstract": "sixteen times, fastest competitor",
}
"""What the paper claims in each section: words, some in the form of this page and in that of the paper."""

CODE = re.compile(r"\[`([\w./]+)`\]\(\.\./([\w./]+)\): ((?:`[\w.]+`(?:, )?)+)")
LINK = r"\[[^\]]+\]\([\w./]+(?:#[\w-]+)?\)"
ELSEWHERE = re.compile(rf"not here: [^`]+\.|{LINK}|see the next (?:two|three) lines")
"""What a line names instead of code. test_docs.py follows the links."""


def lines():
    """(label or section of the paper, claim, code) of each item of the page."""
    found, section = [], ""
    for line in re.sub(r"\n  (?=\S)", " ", PAGE.read_text()).splitlines():
        if line.startswith("## "):
            section = line.removeprefix("## ")
        elif line.startswith("- "):
            claim, code = line.removeprefix("- ").split(" → ")
            label = re.match(r"`(?:eqn|fig|tab):\w+`", claim)
            found.append((label[0] if label else section, claim[label.end() :] if label else claim, code))
    return found


LINES = lines()


def terms():
    """(section, words of a claim in the page's and in the paper's form) of all claims."""
    return [(section, each.split("/")) for section, text in CLAIMS.items() for each in text.split(", ")]


def sections(text):
    """The text of each section, by its title, of a page or of the paper; without the TeX of units and formulas."""
    text = re.sub(r"\\SI\{([^}]*)\}\{(.*?)\}(?!\})", r"\1 \2", text)
    for tex, plain in (("\\percent", "%"), ("\\meter", "m"), ("\\degree", "degree"), ("\\times", " x "), ("$", "")):
        text = text.replace(tex, plain)
    _, *parts = re.split(r"^## (.*)\n|\\(?:sub)*section\{([^}]*)\}|\\begin\{(abstract)\}", text, flags=re.MULTILINE)
    titles = [page or paper or tex.title() for page, paper, tex in zip(*(parts[i::4] for i in range(3)), strict=True)]
    return {title: " ".join(part.split()).casefold() for title, part in zip(titles, parts[3::4], strict=True)}


def code_of(text):
    """(file, name) of all code behind the arrow of a line."""
    found = []
    for part in text.split("; "):
        match = CODE.fullmatch(part)
        assert match or ELSEWHERE.fullmatch(part), part
        if match:
            assert match[1] == match[2]
            found += [(match[1], name) for name in re.findall(r"`([\w.]+)`", match[3])]
    return found


@cache
def definitions(file):
    """Lines of a file's functions, classes and constants by name, and those of methods and fields as Class.name.

    The lines of a constant or field include the docstring below it.
    """
    text = (TOP / file).read_text()
    lines, tree = text.splitlines(), ast.parse(text)
    classes = [node for node in tree.body if isinstance(node, ast.ClassDef)]
    found = {}
    for prefix, body in (("", tree.body), *((f"{each.name}.", each.body) for each in classes)):
        for node, following in zip(body, [*body[1:], None], strict=True):
            described = isinstance(node, ast.Assign | ast.AnnAssign) and isinstance(following, ast.Expr)
            last = following if described else node
            for name in _names_of(node):
                found.setdefault(prefix + name, []).append("\n".join(lines[node.lineno - 1 : last.end_lineno]))
    return found


def _names_of(node):
    if isinstance(node, ast.FunctionDef | ast.ClassDef):
        return {node.name}
    targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
    return {each.id for each in targets if isinstance(each, ast.Name)}


@pytest.mark.parametrize(("label", "code"), [(label, code) for label, _, code in LINES])
def test_every_line_leads_to_its_code(label, code):
    code = code_of(code)
    assert code or label.strip("`") not in EQUATIONS
    for file, name in code:
        assert (TOP / file).is_file(), f"{label}: {file} is missing"
        texts = definitions(file).get(name, [])
        assert len(texts) == 1, f"{label}: {file} defines {name} {len(texts)} times"
        if label.startswith("`"):
            assert re.search(rf"{label.strip('`')}\b", texts[0]), f"{name} in {file} does not name {label}"


@pytest.mark.parametrize(("title", "code"), [(label, code) for label, _, code in LINES if not label.startswith("`")])
def test_a_named_file_says_the_section_that_it_comes_from(title, code):
    files = {file for file, _ in code_of(code)}
    texts = [re.sub(r"\n *(?:# )?", " ", (TOP / file).read_text()) for file in files]
    assert not texts or any(f'"{title}"' in text for text in texts), f'none of {sorted(files)} has "{title}"'


@pytest.mark.parametrize(("claim", "code"), [(claim, code) for _, claim, code in LINES if "`" in claim])
def test_claims_name_only_what_their_code_has(claim, code):
    texts = "".join((TOP / file).read_text() for file, _ in code_of(code)) + (TOP / "docs" / "meshes.md").read_text()
    for name in re.findall(r"`([^`]+)`", claim):
        assert name in texts, f"{claim}: no {name} in {code}"


def test_the_text_of_a_definition_ends_with_it():
    label = "eqn:sphere_phi_1"
    sphere = definitions("vm_embedded/geometry/shapes.py")
    assert label in sphere["Sphere.phi"][0]
    assert label not in sphere["Sphere.theta"][0]
    assert "0.75" in definitions("export/vm_train/scores/object_scores.py")["OVERLAPS"][0]


def test_every_label_of_the_paper_has_a_line():
    named = {label.strip("`") for label, _, _ in LINES if label.startswith("`")}
    assert named == LABELS


@pytest.mark.parametrize(("section", "words"), terms())
def test_every_claim_of_the_paper_is_in_its_section(section, words):
    assert words[0].casefold() in sections(PAGE.read_text())[section]


def test_labels_and_sections_are_the_papers():
    if not PAPER.is_file():
        pytest.skip(f"needs the paper, which is not at {PAPER}; set VM_SHARED to the folder above it")
    text = PAPER.read_text()
    assert {label for label in re.findall(r"\\label\{([^}]*)\}", text) if not label.startswith("sec:")} == LABELS
    found = sections(text)
    named = {label for label, _, _ in LINES if not label.startswith("`")}
    assert named <= {*found}, f"no sections of the paper: {sorted(named - {*found})}"
    with_claims = {*found} - {"Introduction", "Evaluation of the Visual Mesh", "Results"}
    assert {*CLAIMS} == with_claims == {*sections(PAGE.read_text())}
    missing = [(section, words) for section, words in terms() if words[-1].casefold() not in found[section]]
    assert not missing, f"not in the paper: {missing}"


def test_equations_stand_in_the_code_that_builds_meshes():
    shapes = "".join(path.read_text() for path in (TOP / "vm_embedded" / "geometry").glob("*.py"))
    assert all(label in shapes for label in EQUATIONS)
