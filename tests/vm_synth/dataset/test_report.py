"""Checks of sets: what is missing or broken is found and named, and what is there is counted right."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from vm_synth.cli import main
from vm_synth.dataset.files import PARTS, file_of, read_truth
from vm_synth.dataset.inspection import inspect
from vm_synth.dataset.report import as_json, categories, problems, quantities, runs_of, shard_of_missing, tables
from vm_synth.scene.configuration import CLASSES

from ..sets import SIZE, picture_of, scene_of, write_set

COUNT = 6


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    return write_set(tmp_path_factory.mktemp("sets") / "sound", range(COUNT))


@pytest.fixture
def folder(sound, tmp_path):
    """A set of its own for each test."""
    return Path(shutil.copytree(sound, tmp_path / "set"))


def cut(path):
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def swapped_with(number):
    """Another picture's file in the place of this one."""

    def damage(path):
        path.write_bytes(Path(str(path).replace("0000002", f"000000{number}")).read_bytes())

    return damage


def truth_with(**entries):
    def damage(path):
        path.write_text(json.dumps({**json.loads(path.read_text()), **entries}))

    return damage


DAMAGES = {
    "image cut": ("image", cut, "image0000002.jpg is cut short"),
    "image empty": ("image", lambda path: path.write_bytes(b""), "image0000002.jpg can't be decoded as an image"),
    "image of another size": (
        "image",
        lambda path: cv2.imwrite(str(path), np.zeros((64, 90, 3), np.uint8)),
        "image0000002.jpg has 90 x 64 px, not 96 x 64 px",
    ),
    "lens of another picture": (
        "lens",
        swapped_with(3),
        "lens0000002.yaml and scene0000002.json have different poses: one is of another picture",
    ),
    "image gone": ("image", lambda path: path.unlink(), "image0000002.jpg is missing"),
    "mask gone": ("mask", lambda path: path.unlink(), "mask0000002.png is missing"),
    "mask cut": ("mask", cut, "mask0000002.png is cut short"),
    "mask of another size": (
        "mask",
        lambda path: cv2.imwrite(str(path), np.zeros((32, 96, 4), np.uint8)),
        "mask0000002.png has 96 x 32 px, not 96 x 64 px",
    ),
    "mask without transparency": (
        "mask",
        lambda path: cv2.imwrite(str(path), np.zeros((64, 96, 3), np.uint8)),
        "mask0000002.png has 3 channels, not 4",
    ),
    "mask of other colors": (
        "mask",
        lambda path: cv2.imwrite(str(path), np.full((64, 96, 4), 200, np.uint8)),
        "mask0000002.png has colors that belong to no class",
    ),
    "coverage in color": (
        "coverage",
        lambda path: cv2.imwrite(str(path), np.zeros((64, 96, 3), np.uint8)),
        "coverage0000002.png has 3 channels, not 1",
    ),
    "lens gone": ("lens", lambda path: path.unlink(), "lens0000002.yaml is missing"),
    "lens damaged": ("lens", lambda path: path.write_text("projection: [1"), "lens0000002.yaml"),
    "lens without pose": (
        "lens",
        lambda path: path.write_text(path.read_text().split("Hoc")[0]),
        "lens0000002.yaml has no camera pose (Hoc)",
    ),
    "truth cut": ("scene", cut, "scene0000002.json is damaged"),
    "truth of another picture": ("scene", truth_with(index=4), "scene0000002.json describes picture 4, not 2"),
    "truth of another set": ("scene", truth_with(map="attic"), "map attic is not in set.json"),
    "truth without a height": ("scene", truth_with(height=None), "scene0000002.json is damaged"),
    "truth with another ball": ("scene", truth_with(ball={"distance": 1.0}), "scene0000002.json is damaged"),
    "truth no table": ("scene", lambda path: path.write_text("[]"), "it must contain a JSON object"),
}
QUICK = [name for name in DAMAGES if name.startswith(("lens", "truth")) or name.endswith("gone")]


def test_a_sound_set_passes(folder, capsys):
    assert main(["check", str(folder)]) == 0
    said = capsys.readouterr()
    assert said.out.startswith(f"{COUNT} of {COUNT} pictures exist, 0 of them are invalid\n")
    assert "ball distance [m]" in said.out
    assert said.err == ""


@pytest.mark.parametrize("name", DAMAGES)
def test_damage_is_found_and_named(folder, capsys, name):
    part, damage, text = DAMAGES[name]
    damage(file_of(folder, part, 2))
    assert main(["check", str(folder)]) == 1
    said = capsys.readouterr()
    assert f"{COUNT} of {COUNT} pictures exist, 1 of them are invalid" in said.out
    lines = said.err.splitlines()
    assert lines[0].startswith("vm-synth: picture 2: ")
    assert text in lines[0]
    assert "delete their scene*.json" in lines[1]
    assert len(lines) == 2


@pytest.mark.parametrize("name", DAMAGES)
def test_a_quick_check_finds_all_but_damaged_images(folder, name):
    part, damage, _ = DAMAGES[name]
    damage(file_of(folder, part, 2))
    assert inspect(folder, quick=True).complete == (name not in QUICK)


def test_as_advised_deleting_the_truth_leaves_a_gap_that_a_run_fills(folder, capsys):
    cut(file_of(folder, "image", 2))
    file_of(folder, "scene", 2).unlink()
    assert main(["check", str(folder)]) == 1
    assert "missing pictures (1): 2\n" in capsys.readouterr().err
    write_set(folder, [2], COUNT)
    assert main(["check", str(folder)]) == 0


def test_many_faults_are_counted_and_a_few_named(tmp_path):
    folder = write_set(tmp_path, range(2))
    for index in range(2, 40):
        file_of(folder, "scene", index).write_text("{}")
    plan = json.loads((folder / "set.json").read_text())
    (folder / "set.json").write_text(json.dumps({**plan, "count": 40}))
    lines = problems(inspect(folder))
    assert len(lines) == 22
    assert lines[20] == "and 18 more invalid pictures; --json lists all"


def test_the_shard_of_all_missing_pictures_is_named(tmp_path, capsys):
    folder = write_set(tmp_path, [index for index in range(12) if index % 3 != 1], 12)
    cut(file_of(folder, "mask", 3))
    assert main(["check", str(folder)]) == 1
    said = capsys.readouterr()
    assert "missing pictures (4): 1, 4, 7, 10\n" in said.err
    assert "all missing pictures belong to shard 2/3" in said.err


def test_a_shard_is_named_only_where_gaps_tell():
    assert shard_of_missing([1, 4, 7]) == (2, 3)
    assert shard_of_missing([10, 12, 16]) == (1, 2)
    assert shard_of_missing([1, 2, 3]) is None
    assert shard_of_missing([1, 900]) is None
    assert shard_of_missing([]) is None


def test_runs_of():
    assert runs_of([]) == []
    assert runs_of([3]) == [(3, 3)]
    assert runs_of([0, 1, 2, 5, 7, 8]) == [(0, 2), (5, 5), (7, 8)]


def test_numbers_are_those_of_the_pictures(folder):
    found = inspect(folder)
    assert found.size == SIZE
    for index, facts in enumerate(found.facts):
        truth, picture = read_truth(folder, index), picture_of(scene_of(index))
        assert facts.height == truth["height"]
        assert len(facts.objects) == (truth["ball"] is not None)
        assert facts.projection == type(scene_of(index).lens).__name__.lower()
        counted = picture.classes[::2, ::2]
        for number, name in enumerate(CLASSES):
            assert facts.shares[name] == pytest.approx((counted == number).mean())
        assert sum(facts.shares.values()) == pytest.approx(1.0)
    balls = [ball for each in found.facts for ball in each.objects]
    assert quantities(found.facts)["ball distance [m]"] == [each.distance for each in balls]
    assert sum(categories(found.facts)["ball"].values()) == COUNT
    assert sum(categories(found.facts)["ball design"].values()) == len(balls)


def test_a_set_that_has_just_begun(tmp_path, capsys):
    folder = write_set(tmp_path, [], 9)
    assert main(["check", str(folder), "--plots", str(tmp_path / "plots.png")]) == 1
    said = capsys.readouterr()
    assert said.out == "0 of 9 pictures exist, 0 of them are invalid\n"
    assert "missing pictures (9): 0 to 8\n" in said.err
    assert not (tmp_path / "plots.png").exists()


def test_pictures_beyond_the_count_are_left_out(folder):
    plan = json.loads((folder / "set.json").read_text())
    (folder / "set.json").write_text(json.dumps({**plan, "count": 4}))
    assert inspect(folder).complete
    assert inspect(folder).done == (0, 1, 2, 3)


def test_tables_keep_numbers_with_their_names(folder):
    assert all(len(line) <= 100 for line in tables(inspect(folder)).splitlines())
    assert "\xa0" not in tables(inspect(folder))


@pytest.mark.long
def test_plots_and_json_are_written(folder, tmp_path, capsys):
    pytest.importorskip("matplotlib")
    plots, report = tmp_path / "plots.png", tmp_path / "report.json"
    assert main(["check", str(folder), "--plots", str(plots), "--json", str(report)]) == 0
    assert cv2.imread(str(plots)).shape[1] > 1000
    found = json.loads(report.read_text())
    assert found == json.loads(json.dumps(as_json(inspect(folder))))
    assert len(found["pictures"]) == found["done"] == COUNT
    assert main(["check", str(folder), "--quick", "--plots", str(tmp_path / "quick.svg")]) == 0


@pytest.mark.long
def test_plots_without_any_ball(tmp_path):
    pytest.importorskip("matplotlib")
    without = [index for index in range(40) if scene_of(index).ball is None][:2]
    folder = write_set(tmp_path, without, 1000)
    assert main(["check", str(folder), "--plots", str(tmp_path / "plots.png")]) == 1
    assert (tmp_path / "plots.png").is_file()


def test_plots_without_matplotlib_name_the_extra(folder, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert main(["check", str(folder), "--plots", "plots.png"]) == 1
    said = capsys.readouterr().err
    assert said == "vm-synth: --plots needs matplotlib; run: pip install '.[synth]' in the folder of vm-embedded\n"


@pytest.mark.parametrize(
    ("content", "text"),
    [
        (None, "is not a set of vm-synth"),
        ("{", "set.json is damaged"),
        ("[]", "it must contain a JSON object"),
        ('{"format": 99}', "has format 99; this version of vm-synth reads 1"),
        ('{"format": 1, "count": "many"}', "count must be a whole number of at least 1, not 'many'"),
        ('{"format": 1, "count": 3}', "it lacks the picture size"),
    ],
)
def test_a_folder_that_is_no_set(tmp_path, capsys, content, text):
    if content is not None:
        (tmp_path / "set.json").write_text(content)
    assert main(["check", str(tmp_path)]) == 1
    said = capsys.readouterr()
    assert text in said.err
    assert said.err.count("\n") == 1
    assert said.out == ""


@pytest.mark.parametrize("option", ["--plots", "--json"])
def test_work_is_not_done_in_vain(folder, capsys, option):
    assert main(["check", str(folder), option, "no/such/folder/file.png"]) == 1
    said = capsys.readouterr()
    assert "there is no folder no/such/folder" in said.err
    assert said.out == ""


def test_another_suffix_than_matplotlib_s(folder, capsys):
    pytest.importorskip("matplotlib")
    assert main(["check", str(folder), "--plots", "plots.docx"]) == 1
    assert "its suffix must be one of" in capsys.readouterr().err


def test_as_a_user_runs_it(folder):
    command = [sys.executable, "-m", "vm_synth", "check", str(folder)]
    found = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert (found.returncode, found.stderr) == (0, "")
    for part in PARTS:
        cut(file_of(folder, part, 1))
    found = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert found.returncode == 1
    assert "picture 1: " in found.stderr
    assert "Traceback" not in found.stderr
