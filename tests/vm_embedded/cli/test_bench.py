"""vm-bench as a user types it."""

import json
import math
from functools import partial

import pytest

from tests.drawn_scenes import FOLDER, IMAGES, MODEL
from tests.programs import run_program
from vm_embedded import read_lens_file
from vm_embedded.cli.bench import describe_machine
from vm_embedded.live.configuration import read_configuration
from vm_embedded.network.model_file import read_model

STAGES = ("mesh", "project", "sample", "infer", "cluster")
run = partial(run_program, "vm-bench")


def test_command_prints_a_table_and_keeps_all_figures_as_json(tmp_path):
    out = run("--model", MODEL, "--frames", 12, "--json", tmp_path / "all.json", "--up-to", 2).stdout
    assert all(stage in out for stage in ("mesh", "project", "sample", "infer", "cluster"))
    assert "p99.9" in out
    assert "first frame of a new orientation bucket" in out
    assert "roll 0 deg" in out
    found = json.loads((tmp_path / "all.json").read_text())
    assert found["walk"]["frames"] == 12
    assert found["rss_mib"] > 10
    assert found["sgemm_gflops"] > 0.1
    assert [each["threads"] for each in found["runs"]] == list(range(1, len(found["runs"]) + 1))
    for each in found["runs"]:
        total = each["total_ms"]
        assert 0 < total["p50"] <= total["p90"] <= total["p99"] <= total["p99.9"]
        assert sum(stage["share"] for stage in each["stages_ms"].values()) == pytest.approx(1.0, abs=0.15)
        assert each["points"] > 100
        assert each["points_per_s"] > 0
        assert each["infer_over_floor"] > 1.0  # nothing is faster than its multiplications
        assert 0.0 <= each["hit_rate"] <= 1.0
    assert found["cold"]["bucket_ms"]["p50"] > 0
    assert found["model"]["sha256"] == read_model(MODEL).sha256


def test_command_takes_the_user_s_frame_lens_and_orientation():
    lens = FOLDER / "lens0000000.yaml"
    options = ("--image", IMAGES[0], "--lens", lens, "--height", 0.6, "--pitch", "25deg")
    found = json.loads(run("--model", MODEL, *options, "--frames", 5, "--up-to", 1, "--json", "-").stdout)
    assert found["walk"]["height_m"] == 0.6
    assert found["walk"]["swing_rad"] == pytest.approx(math.radians(10.0))
    assert len(found["runs"]) == 1


def test_the_vector_instructions_of_arm_are_known(tmp_path):
    cpuinfo = tmp_path / "cpuinfo"
    cpuinfo.write_text("processor : 0\nFeatures : fp asimd evtstrm\n")
    described = describe_machine(cpuinfo)
    assert (described["processor"], described["vectors"]) == ("ARM", "asimd")


@pytest.mark.long
def test_tuned_settings_are_printed_as_vm_detect_reads_them(tmp_path):
    out = run("--model", MODEL, "--frames", 300, "--up-to", 1, "--size", "320x240", "--tune").stdout
    path = tmp_path / "vm.toml"
    path.write_text(out[out.index("[detector]") :])
    settings = read_configuration(path).detector
    assert (settings.threads, settings.spinning) == (1, False)
    assert settings.pitch_step == settings.roll_step


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (("--model", "baller"), "did you mean 'ball'"),
        (("--model", "nowhere.onnx"), "nowhere.onnx"),
        (("--model", MODEL, "--size", "640"), "640x512"),
        (("--model", MODEL, "--size", "\u00b2x\u00b2"), "640x512"),
        (("--model", MODEL, "--size", "640x480", "--image", IMAGES[0]), "--size"),
        (("--model", MODEL, "--frames", "5", "--tune"), "at least 300"),
        (("--model", MODEL, "--height-tolerance", "0", "--tune"), "--height-tolerance"),
        (("--model", MODEL, "--frames", "0"), "at least 1"),
        (("--model", MODEL, "--image", "nowhere.png"), "nowhere.png"),
        (("--model", MODEL, "--pitch", "0.3"), "--height"),
        (("--model", MODEL, "--height", "0.05"), "height"),
        (("--model", MODEL, "--format", "rgba", "--image", IMAGES[0]), "rgba"),
        (("--model", MODEL, "--frames", "3", "--json", "/nowhere/all.json"), "/nowhere"),
    ],
    ids=str,
)
def test_what_is_wrong_is_said_in_one_line(options, says):
    error = run(*options, code=1).stderr
    assert len(error.strip().splitlines()) == 1
    assert says in error


def test_command_takes_the_orientation_of_a_reference_lens_file():
    lens = FOLDER / "lens0000000.yaml"
    options = ("--model", MODEL, "--lens", lens, "--frames", 2, "--up-to", 1, "--json", "-")
    walked = json.loads(run(*options).stdout)["walk"]
    orientation = read_lens_file(lens).orientation
    assert walked["height_m"] == orientation.height
    assert walked["pitch_rad"] == orientation.pitch
    assert walked["roll_rad"] == orientation.roll


def test_command_measures_the_threads_that_are_asked_for():
    options = ("--model", MODEL, "--threads", 2, "--frames", 2, "--json", "-")
    (only,) = json.loads(run(*options).stdout)["runs"]
    assert only["threads"] in (1, 2)  # never more than there are
    assert only["hit_rate"] < 1.0
