"""vm-mesh as a user types it."""

import json
import re
import subprocess
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.programs import BIN, run_main
from vm_embedded.geometry.shapes import Sphere
from vm_embedded.mesh.models import MESH_MODELS, build_mesh
from vm_embedded.network.bundled import DEFAULT, model_path
from vm_embedded.network.model_file import read_model
from vm_mesh.cli import main

DEMO = Path(__file__).parents[1] / "fixtures/demo"
LENS, IMAGE = DEMO / "lens0000000.yaml", DEMO / "image0000000.jpg"
SMALL = ("--max-distance", "3", "--intersections", "3")
run = partial(run_main, main)


@pytest.mark.long
def test_help_and_unknown_commands_as_a_process():
    def call(*arguments):
        return subprocess.run([BIN / "vm-mesh", *arguments], capture_output=True, text=True)

    listed = call("--help")
    assert listed.returncode == 0
    assert all(name in listed.stdout for name in ("show", "quality", "range", "compare"))
    assert call().returncode == 2
    wrong = call("qualty")
    assert wrong.returncode == 2
    assert "'quality'" in wrong.stderr


@pytest.mark.long
@pytest.mark.parametrize("model", sorted(set(MESH_MODELS) - {"wall6"}))
def test_show_draws_every_model(model, tmp_path, capsys):
    file = tmp_path / "mesh.png"
    run(capsys, "show", "--model", model, *SMALL, "--object", 0, "--object", 1, "-o", file)
    picture = cv2.imread(str(file))
    assert (picture < 128).any(axis=2).sum() > 500  # points and links
    orange = (picture[:, :, 2].astype(int) - picture[:, :, 0] > 40).sum()
    assert orange > 100  # objects


@pytest.mark.long
def test_show_draws_the_mesh_of_vm_detect(tmp_path, capsys):
    """Without options, it is that of the network that vm-detect uses without --model."""
    said = [
        run(capsys, "show", *words, "-o", tmp_path / "mesh.png")
        for words in ((), ("--network", "ball"), ("--radius", 0.05))
    ]
    assert said[0] == said[1] != said[2]
    manifest = read_model(model_path(DEFAULT)).manifest
    mesh = build_mesh(Sphere(manifest.radius), 1.0, manifest.intersections, manifest.max_distance, manifest.mesh)
    assert said[0].endswith(f"{manifest.mesh}, {len(mesh)} points\n")


@pytest.mark.long
def test_show_draws_walls_by_direction_and_not_on_the_ground(tmp_path, capsys):
    post = ("--model", "wall6", "--shape", "cylinder", "--radius", 0.05, "--object-height", 1.8, *SMALL)
    run(capsys, "show", *post, "-o", tmp_path / "walls.svg")
    assert "<svg" in (tmp_path / "walls.svg").read_text()
    assert "directions" in run(capsys, "show", *post, "--view", "ground", "-o", tmp_path / "x.png", code=1)


def test_show_draws_on_a_picture(tmp_path, capsys):
    file = tmp_path / "mesh.png"
    run(capsys, "show", "--network", "ball-small", "--image", IMAGE, "--lens", LENS, "-o", file)
    drawn, picture = cv2.imread(str(file)), cv2.imread(str(IMAGE))
    again = cv2.resize(picture, drawn.shape[1::-1], interpolation=cv2.INTER_LINEAR)
    changed = np.abs(drawn.astype(int) - again).max(axis=2) > 25
    horizon = drawn.shape[0] // 5
    assert changed[-horizon:].mean() > 0.01  # the mesh is on the ground
    assert changed[: horizon // 2].mean() < 0.01  # and not in the sky


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("show", "-o", "mesh.bmp"), r"\.png or \.svg"),
        (("show", "-o", "nowhere/mesh.png"), "nowhere"),
        (("show", "--image", IMAGE, "-o", "mesh.png"), "--lens"),
        (("show", "--model", "ring6", "--model", "cap6", "-o", "mesh.png"), "one"),
        (("quality", "--radius", "-1"), "radius"),
        (("quality", "--height", "0.1"), "height"),
        (("quality", "--distance", "1", "--distance", "-1"), "--distance must be .* not -1"),
        (("quality", "--shape", "cylinder"), "--object-height"),
        (("quality", "--shape", "cylinder", "--object-height", "0"), "height must be a number above 0"),
        (("quality", "--object-height", "2"), "sphere"),
        (("range",), "--lens"),
        (("range", "--lens", "nowhere.yaml"), "nowhere"),
        (("range", "--lens", LENS, "--size", "640*512"), "640x512"),
        (("compare", "--lens", LENS), "--size"),
        (("compare", "--network", "ball-6x4"), "ball"),
        (("show", "--intersections", "1e300", "-o", "mesh.png"), "at most 8,000,000 are allowed"),
        (("show", "--reach", "nan", "-o", "mesh.png"), "--reach"),
        (("show", "--object", "-1", "-o", "mesh.png"), "--object must be .* not -1"),
        (("show", "--pitch", "20deg", "-o", "mesh.png"), "--pitch is for a drawing on a picture; give --image"),
        (("show", "--image", IMAGE, "--lens", LENS, "--object", "1", "-o", "mesh.png"), "--object is for .* without"),
        (("show", "--image", IMAGE, "--lens", LENS, "--reach", "1", "-o", "mesh.png"), "--reach is for .* without"),
        (("compare", "--size", "640x512"), "--size needs --lens"),
        (("compare", "--roll", "0.1"), "--roll needs --lens"),
        (("range", "--lens", LENS, "--intersections", "nan"), "--intersections"),
        (("range", "--lens", LENS, "--height", "0.1"), "height"),
        (("compare", "--lens", LENS, "--size", "²x²"), "640x512"),
        (("quality", "--json", "nowhere/q.json"), "nowhere"),
    ],
)
def test_mistakes_are_named(arguments, message, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert re.search(message, run(capsys, *arguments, code=1))
    assert not list(tmp_path.iterdir())


def test_quality_writes_what_it_prints(tmp_path, capsys):
    shown = run(
        capsys, "quality", "--model", "ring6", "--model", "cap6", *SMALL, "--distance", 1, "--distance", 0.5,
        "-o", tmp_path / "q.png", "--json", tmp_path / "q.json",
    )  # fmt: skip
    found = json.loads((tmp_path / "q.json").read_text())
    assert set(found) == {"ring6", "cap6"}
    assert found["ring6"]["on_object"]["distances"] == [0.5, 1.0]
    for model in found:
        assert f"0.50 m {found[model]['on_object']['mean'][0]:.2f}" in shown
    assert (tmp_path / "q.png").stat().st_size > 10_000


@pytest.mark.long
def test_compare_leaves_out_models_that_do_not_fit(capsys):
    shown = run(capsys, "compare", "--shape", "cylinder", "--radius", 0.05, "--object-height", 1.8, *SMALL)
    assert "wall6" in shown
    assert "ring6" not in shown
    shown = run(capsys, "compare", "--lens", LENS, "--size", "640x512", *SMALL)
    assert "wall6" not in shown
    assert all(model in shown for model in set(MESH_MODELS) - {"wall6"})


def test_range_says_where_a_step_is_a_pixel(capsys):
    shown = run(capsys, "range", "--lens", LENS, "--intersections", 8)
    limit = float(re.search(r"beyond ([\d.]+) m", shown).group(1))
    rows = [line.split() for line in shown.splitlines() if re.match(r" +\d", line)]
    assert all((float(row[2]) < 1.0) == (float(row[0]) > limit) for row in rows)


@pytest.mark.long
def test_a_picture_needs_a_pose(tmp_path, capsys):
    lens = tmp_path / "lens.toml"
    lens.write_text('projection = "rectilinear"\nfocal_length = 400.0\nfov = 2.0\n')
    shown = ("show", "--image", IMAGE, "--lens", lens, "-o", tmp_path / "x.png")
    assert "--height and --pitch" in run(capsys, *shown, code=1)
    run(capsys, *shown, "--height", 0.7, "--pitch", "20deg")
    compared = ("compare", "--lens", lens, "--size", "640x512")
    assert "--height and --pitch" in run(capsys, *compared, code=1)


def test_range_takes_no_pitch_because_it_measures_on_the_axis_of_the_lens(capsys):
    with pytest.raises(SystemExit, match="2"):
        main(["range", "--lens", str(LENS), "--pitch", "20deg"])
    assert "unknown option --pitch" in capsys.readouterr().err


def test_figures_are_json_whatever_they_are(tmp_path, capsys):
    run(capsys, "compare", "--max-distance", 0.01, "--json", tmp_path / "small.json")
    json.loads((tmp_path / "small.json").read_text(), parse_constant=pytest.fail)


def test_a_range_from_the_nadir_on_is_plotted(tmp_path, capsys):
    run(capsys, "range", "--lens", LENS, "--distance", 0, "--distance", 5, "-o", tmp_path / "r.png")
    assert (tmp_path / "r.png").exists()


def test_quality_of_walls_begins_where_they_do(tmp_path, capsys):
    post = ("quality", "--shape", "cylinder", "--radius", 0.05, "--object-height", 1.8, *SMALL)
    shown = run(capsys, *post, "--distance", 0, "--distance", 0.5, "--distance", 2, "--json", tmp_path / "q.json")
    assert json.loads((tmp_path / "q.json").read_text())["wall6"]["on_object"]["distances"] == [0.5, 2.0]
    assert "0.50 m" in shown
    assert "0.00 m" not in shown
    assert "0.3 m" in run(capsys, *post, "--distance", 0.1, code=1)
