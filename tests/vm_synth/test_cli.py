"""vm-synth's options and what it says when something is missing."""

import subprocess
import sys

import cv2
import numpy as np
import pytest

from vm_embedded.errors import InputError
from vm_synth.cli import main
from vm_synth.render.mitsuba import load_mitsuba

from .dataset.test_workers import environment_of


def fails(capsys, *arguments):
    assert main(list(map(str, arguments))) == 1
    [line] = capsys.readouterr().err.splitlines()
    return line


def test_config_prints_a_configuration_that_vm_synth_reads(tmp_path, capsys):
    assert main(["config"]) == 0
    text = capsys.readouterr().out
    assert "[ball_design]" in text
    (tmp_path / "scene.toml").write_text(text)
    line = fails(capsys, tmp_path / "out", "--count", 1, "--hdri", tmp_path, "--config", tmp_path / "scene.toml")
    assert "no maps" in line


@pytest.mark.parametrize("name", ["polyhaven.toml", "soccer", "varied"])
def test_configurations_of_the_package_have_names_in_any_folder(name, tmp_path, monkeypatch, capsys):
    (tmp_path / "maps").mkdir()
    monkeypatch.chdir(tmp_path)
    assert "no maps" in fails(capsys, "out", "--count", 1, "--hdri", "maps", "--config", name)
    (tmp_path / name).write_text("[cmaera]")  # the user's own file comes first
    assert "cmaera" in fails(capsys, "out", "--count", 1, "--hdri", "maps", "--config", name)


def test_an_unknown_configuration_is_named_with_the_nearest(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    line = fails(capsys, "out", "--count", 1, "--config", "polyhavn.toml")
    assert "polyhavn.toml" in line
    assert "did you mean 'polyhaven'" in line


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--shard", "0/2"], "not a shard"),
        (["--shard", "3/2"], "not a shard"),
        (["--shard", "half"], "not a shard"),
        (["--count", "-1"], "not a whole number"),
        (["--count", "many"], "not a whole number"),
    ],
)
def test_options_that_can_not_be_parsed_exit_with_2(arguments, said, maps, tmp_path, capsys):
    with pytest.raises(SystemExit) as end:
        main([str(tmp_path), "--count", "1", "--hdri", str(maps), *arguments])
    assert end.value.code == 2
    assert said in capsys.readouterr().err


def test_no_pictures_or_no_workers_are_refused(maps, tmp_path, capsys):
    assert "at least 1" in fails(capsys, tmp_path, "--count", 0, "--hdri", maps)
    assert "at least 1" in fails(capsys, tmp_path, "--count", 1, "--hdri", maps, "--workers", 0)


def test_a_folder_without_maps_is_named(tmp_path, capsys):
    assert "nowhere" in fails(capsys, tmp_path, "--count", 1, "--hdri", tmp_path / "nowhere")


def test_without_llvm_it_says_what_to_install_in_one_line(maps, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("vm_synth.render.mitsuba._PLACES", (str(tmp_path / "*.so"),))
    monkeypatch.delenv("DRJIT_LIBLLVM_PATH", raising=False)
    assert "apt install libllvm19" in fails(capsys, tmp_path / "out", "--count", 1, "--hdri", maps)
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", str(tmp_path / "libLLVM.so"))
    assert str(tmp_path / "libLLVM.so") in fails(capsys, tmp_path / "out", "--count", 1, "--hdri", maps)
    assert not (tmp_path / "out").exists()


def test_without_mitsuba_it_says_what_to_install_in_one_line(maps, tmp_path):
    (tmp_path / "mitsuba.py").write_text("raise ImportError('not here')\n")
    (tmp_path / "drjit.py").touch()
    environment = environment_of(DRJIT_LIBLLVM_PATH=sys.executable)  # a file; nobody comes to open it
    environment["PYTHONPATH"] = f"{tmp_path}:{environment['PYTHONPATH']}"
    arguments = [sys.executable, "-m", "vm_synth", str(tmp_path / "out"), "--count", "1", "--hdri", str(maps)]
    done = subprocess.run(arguments, capture_output=True, text=True, env=environment, check=False)
    assert done.returncode == 1
    assert done.stderr == (
        "vm-synth: rendering needs Mitsuba 3; run: pip install '.[synth]' in the folder of vm-embedded\n"
    )


@pytest.mark.long
def test_a_damaged_map_is_named_and_left_out(maps, tmp_path, capsys):
    try:
        load_mitsuba()
    except InputError as error:
        pytest.skip(str(error))
    good = min(maps.iterdir())
    folder = tmp_path / "maps"
    folder.mkdir()
    (folder / "good.hdr").write_bytes(good.read_bytes())
    (folder / "cut.hdr").write_bytes(good.read_bytes()[:200])
    cv2.imwrite(str(folder / "square.hdr"), np.ones((64, 64, 3), np.float32))
    (tmp_path / "scene.toml").write_text("[camera]\npicture_width = 64\npicture_height = 64\n")
    arguments = ["--count", "1", "--workers", "1", "--config", str(tmp_path / "scene.toml")]
    assert main([str(tmp_path / "out"), "--hdri", str(folder), *arguments]) == 0
    said = capsys.readouterr().err
    assert "skipped map cut.hdr" in said
    assert "skipped map square.hdr: its size is 64 x 64 px; it must be twice as wide as high" in said
    (folder / "good.hdr").unlink()
    assert main([str(tmp_path / "other"), "--hdri", str(folder), *arguments]) == 1
    assert "none of the maps can be read" in capsys.readouterr().err
