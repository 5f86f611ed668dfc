"""The documentation says what the programs do, is complete, and its links lead somewhere."""

import ast
import importlib
import importlib.util
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterable
from pathlib import Path

import cv2
import pytest

import vm_embedded
from vm_synth.scene.configuration import SceneConfiguration

from .rooms import ROOMS

TOP = Path(__file__).parents[1]
DOCS = TOP / "docs"
README = TOP / "README.md"
OUTSIDE = [
    *(README, TOP / "CHANGELOG.md", TOP / "deploy" / "README.md", TOP / "benchmarks" / "README.md"),
    TOP / ".github" / "CONTRIBUTING.md",
]
PAGES = [*OUTSIDE, *sorted(DOCS.glob("*.md"))]
EXPERIMENTS = sorted((TOP / "benchmarks" / "experiments").glob("*.md"))
OPTIONAL = ("pandas", "supervision")
"""Packages that programs of the pages may use and that users install themselves."""


def name_of(page: Path) -> str:
    return str(page.relative_to(TOP))


every_page = pytest.mark.parametrize("page", [*PAGES, *EXPERIMENTS], ids=name_of)


@pytest.fixture
def docs_script(monkeypatch):
    """Imports a script of docs/ by its name."""
    monkeypatch.syspath_prepend(str(DOCS))
    yield __import__
    for name in ("help_pages", "api_page", "message_pages"):
        sys.modules.pop(name, None)


def test_generated_pages_are_current(docs_script):
    for path, text in docs_script("help_pages").pages().items():
        assert path.read_text() == text, f"{path.name} is out of date; run: python docs/help_pages.py"


def test_the_api_page_has_every_public_name(docs_script):
    api_page = docs_script("api_page")
    grouped = [name for names in api_page.GROUPS.values() for name in names]
    assert sorted(grouped) == sorted([*vm_embedded.__all__, *api_page.OTHERS])
    page = api_page.page()
    assert all(f"\n### {name}\n" in page for name in grouped)


def test_the_command_line_page_has_every_program(docs_script):
    help_pages = docs_script("help_pages")
    page = help_pages.command_line()
    assert all(f"\n## {name}\n" in page for name in help_pages.parsers())


def test_tables_of_the_pages_are_the_published_figures():
    from benchmarks import report

    check_parts(report.tables())


def test_claims_of_the_readme_are_the_published_figures():
    from benchmarks import fine_tuning, report, shipped_report

    speed = report.speed(json.loads(report.RESULTS.read_text()))
    gain = fine_tuning.sentence(json.loads(fine_tuning.RESULTS.read_text()))
    check_parts({README: {"speed": speed, **shipped_report.readme()}, DOCS / "own-frames.md": {"fine-tuning": gain}})
    demo = sorted((TOP / "tests" / "fixtures" / "demo").glob("image*.jpg"))
    assert len(demo) == 12
    assert "finds balls and field features in twelve rendered pictures" in README.read_text()
    assert {cv2.imread(str(each)).shape for each in demo} == {(512, 640, 3)}


def check_parts(made):
    """Made parts, by page and by the name of their mark, are on their pages."""
    for page, parts in made.items():
        for name, text in parts.items():
            assert f"<!-- {name} -->\n{text}\n<!-- end -->" in page.read_text(), f"{name_of(page)}: {name}"


def test_the_changelog_has_this_version():
    assert f"## {vm_embedded.__version__} " in (TOP / "CHANGELOG.md").read_text()


def test_the_readme_is_short():
    assert len(README.read_text().splitlines()) <= 150


def blocks(page: Path, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", page.read_text(), re.MULTILINE | re.DOTALL)


def programs(page: Path, without: Iterable[str]) -> list[str]:
    """The Python of a page, except what needs one of these packages."""
    return [each for each in blocks(page, "python") if not any(f"import {name}\n" in each for name in without)]


@pytest.mark.parametrize(
    ("page", "printed"),
    [
        (README, "ball 0."),
        (DOCS / "use.md", "detections, "),
        (DOCS / "meshes.md", "ball head ground ["),
        (DOCS / "recipes.md", "track 1 ["),
    ],
    ids=["README", "use", "meshes", "recipes"],
)
def test_the_python_of_a_page_works_as_pasted(page, printed, tmp_path, monkeypatch, capsys):
    """In the folder of the checkout, one program after the other, as in one interpreter."""
    (tmp_path / "tests").symlink_to(TOP / "tests")  # so that files that a program writes land elsewhere
    monkeypatch.chdir(tmp_path)
    names = {}
    for program in programs(page, without=[each for each in OPTIONAL if importlib.util.find_spec(each) is None]):
        exec(program, names)
    assert printed in capsys.readouterr().out


def test_the_python_of_the_pages_has_right_types(tmp_path):
    """A user's strict type checker accepts it: images as OpenCV's stubs declare them, py.typed, all annotations."""
    for page in (README, DOCS / "use.md", DOCS / "meshes.md", DOCS / "recipes.md"):
        (tmp_path / f"{page.stem}.py").write_text("".join(programs(page, without=OPTIONAL)))
    command = [sys.executable, "-m", "mypy", "--strict", "--follow-imports=silent", "--config-file", "", "."]
    environment = {**os.environ, "MYPYPATH": str(TOP)}
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout


@pytest.mark.long
def test_another_language_reads_the_lines_of_json(tmp_path):
    """The program for Node.js of the recipes, behind vm-detect."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("needs Node.js")
    page = DOCS / "recipes.md"
    (tmp_path / "balls.js").write_text("".join(blocks(page, "js")))
    detect, read = shell_lines(page)[0].split(" | ")
    command = [sys.executable, "-m", "vm_embedded.cli.detect", *shlex.split(detect)[1:]]
    lines = subprocess.run(command, cwd=TOP, capture_output=True, check=True).stdout
    reader = [node, *shlex.split(read)[1:]]
    done = subprocess.run(reader, cwd=tmp_path, input=lines, capture_output=True, check=True)
    expected = [
        rf"{frame['source']}: {ball['class']} .* m ahead, .* m to the left"
        for frame in map(json.loads, lines.splitlines())
        for ball in frame["detections"]
    ]
    printed = done.stdout.decode().splitlines()
    assert len(printed) == len(expected) > 5
    assert all(re.fullmatch(pattern, line) for pattern, line in zip(expected, printed, strict=True))


def test_the_training_of_the_readme_uses_the_radii_of_its_pictures():
    """vm-synth draws balls of several radii, so that one radius for all pictures would be wrong."""
    low, high = SceneConfiguration().ball.radius
    assert low < high
    commands = [line for line in shell_lines(README) if line.startswith(("vm-train data", "vm-evaluate runs"))]
    assert len(commands) == 2
    (recipe,) = re.findall(r"--config (\S+)", commands[0])
    assert tomllib.loads((TOP / recipe).read_text())["mesh"]["radius_of"] == "scene"
    assert "--radius-of scene" in commands[1]


def test_the_design_has_a_line_for_each_room():
    design = (DOCS / "design.md").read_text()
    parts = dict(re.findall(r"^\*\*(vm_\w+)\*\*(.*?)(?=^\*\*vm_|^## )", design, re.MULTILINE | re.DOTALL))
    assert set(parts) == set(ROOMS)
    for package, order in ROOMS.items():
        lines = re.findall(r"^\| (`.*`) \| \w", parts[package], re.MULTILINE)
        rooms = [room for room in re.split(r" > |, |\+", order) if room and room != "__main__"]
        assert re.findall(r"`(\w+)`", " ".join(lines)) == rooms, package


def test_the_index_has_every_page_by_its_title():
    index = (DOCS / "index.md").read_text()
    for page in PAGES:
        title = "README" if page == README else page.read_text().splitlines()[0].removeprefix("# ")
        target = page.name if page.parent == DOCS else f"../{name_of(page)}"
        assert page.name == "index.md" or f"[{title}]({target})" in index, f"{name_of(page)} is not in docs/index.md"


@every_page
def test_links_lead_somewhere(page):
    for path, anchor in re.findall(r"\]\(([^)#\s]*)(?:#([^)\s]*))?\)", page.read_text()):
        if path.startswith("http"):
            continue
        target = (page.parent / path).resolve() if path else page
        assert target.exists(), f"{name_of(page)} links to {path}"
        assert not anchor or anchor in anchors(target), f"{name_of(page)} links to {path}#{anchor}"


def anchors(page: Path) -> set[str]:
    """Anchors of a page's headings, as code hosts and mkdocs name them."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", each.lower()).strip().replace(" ", "-") for each in headings}


@every_page
def test_commands_are_what_the_programs_take(page, docs_script, capsys):
    parsers = docs_script("help_pages").parsers()
    programs = {name.split()[0] for name in parsers}
    for line in shell_lines(page):
        words = shlex.split(line, comments=True)
        while words and (words[0] in ("sudo", "&&") or "=" in words[0]):
            del words[0]
        program = Path(words[0]).name if words else ""
        if program not in programs:
            continue
        words = words[1 : next((place for place, word in enumerate(words) if word in (">", "|")), None)]
        command = f"{program} {words[0]}" if words else ""
        parser = parsers[command] if command in parsers else parsers[program]
        try:
            parser.parse_args(words[1:] if command in parsers and words[0][0] != "-" else words)
        except SystemExit:
            pytest.fail(f"{name_of(page)}: {line}\n{capsys.readouterr().err}")


@every_page
def test_imports_of_python_examples_resolve(page):
    for block in blocks(page, "python"):
        for node in ast.walk(ast.parse(block)):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("vm_"):
                module = importlib.import_module(node.module)
                missing = [each.name for each in node.names if not hasattr(module, each.name)]
                assert not missing, f"{name_of(page)} imports {missing} from {node.module}"


@every_page
def test_paths_of_the_repository_exist(page):
    text = page.read_text()
    for path in re.findall(r"`((?:vm_embedded|export|tests|benchmarks|docs|deploy)/[\w./-]+)`", text):
        assert (TOP / path).exists(), f"{name_of(page)} names {path}"


def shell_lines(page: Path) -> list[str]:
    """Lines of a page's blocks of shell commands, continued lines as one, variables as 1."""
    blocks = re.findall(r"^```sh\n(.*?)^```", page.read_text(), re.MULTILINE | re.DOTALL)
    return re.sub(r"\$[A-Z_]+", "1", "".join(blocks).replace("\\\n", " ")).splitlines()


@every_page
def test_targets_of_make_exist(page):
    makefile = (TOP / "Makefile").read_text()
    named = re.findall(r"`(?:.*&& )?make ([a-z-]+)", page.read_text())
    named += [words[1] for words in map(str.split, shell_lines(page)) if words[:1] == ["make"]]
    for target in named:
        assert re.search(rf"^{target}:", makefile, re.MULTILINE), f"{name_of(page)} names make {target}"


@pytest.mark.long
def test_the_site_builds_without_warnings_and_needs_no_network(tmp_path):
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--config-file", DOCS / "site" / "mkdocs.yml"]
    environment = {**os.environ, "NO_MKDOCS_2_WARNING": "1", "PATH": ""}
    done = subprocess.run([*command, "--site-dir", tmp_path], capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stderr
    assert "WARNING" not in done.stderr
    assert "INFO    -  The following pages" not in done.stderr
    pages = list(tmp_path.rglob("*.html"))
    assert len(pages) > len(PAGES)
    assert {"command-line.html", "api.html"} <= {page.name for page in pages}
    loaded = re.compile(r"<(?:script|img|iframe)[^>]* src=\"?(?:https?:)?//|<link[^>]* href=\"?(?:https?:)?//")
    for page in pages:
        assert not loaded.search(page.read_text()), f"{page.name} loads something from a network"
