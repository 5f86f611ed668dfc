"""vm-train and its commands: options, faults in the data, and one-line errors."""

import json
import re
import subprocess
import sys

import pytest

from tests.vm_train.commands import COMMAND, environment, run
from vm_train.cli.train import main
from vm_train.learning.configuration import TrainConfiguration
from vm_train.runs.run import write_run


@pytest.mark.long
def test_faults_are_named_before_the_training_begins_and_skipped_or_refused(data, configuration, tmp_path):
    folder = tmp_path / "data"
    folder.mkdir()
    for path in data.iterdir():
        (folder / path.name).write_bytes(path.read_bytes())
    (folder / "mask0003.png").unlink()
    lens = folder / "lens0005.yaml"
    lens.write_text(lens.read_text().replace("focal_length", "focal_lenght"))
    (folder / "image0007.jpg").write_bytes((folder / "image0007.jpg").read_bytes()[:900])
    strict = run(folder, "-o", tmp_path / "strict", "--config", configuration, "--strict", code=1)
    for name in ("mask0003.png", "lens0005.yaml", "image0007.jpg"):
        assert name in strict.stderr
    assert not (tmp_path / "strict").exists()
    skipped = run(folder, "-o", tmp_path / "run", "--config", configuration, "--set", "training.epochs=1")
    assert "27 pictures" in skipped.stdout
    used = json.loads((tmp_path / "run" / "pictures.json").read_text())
    assert not {"0003", "0005", "0007"} & {number for part in used.values() for number in part}


@pytest.mark.long
def test_an_empty_part_is_named(data, configuration, tmp_path):
    done = run(data, "-o", tmp_path / "run", "--config", configuration, "--set", "data.validation=0", code=1)
    assert "validation" in done.stderr
    assert not (tmp_path / "run").exists()


@pytest.mark.long
@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--set", "training.epoch=3"], "did you mean 'epochs'"),
        (["--config", "none.toml"], "can't read configuration none.toml"),
        (["--training", "none.txt"], "none.txt"),
        pytest.param(["--device", "cuda"], "no GPU", id="no gpu"),
    ],
)
def test_wrong_options_end_in_one_line(arguments, said, data, configuration, tmp_path):
    given = arguments if "--config" in arguments else ["--config", configuration, *arguments]
    done = run(data, "-o", tmp_path / "run", *given, code=1)
    assert said in done.stderr
    assert done.stderr.startswith("vm-train: ")


@pytest.mark.parametrize("arguments", [["data", "-o", "run"], ["rate", "data"], ["resume", "run"]])
def test_without_torch_it_says_what_to_install(arguments, tmp_path):
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "pictures.json").write_text("{}")
    write_run(tmp_path / "run", "mesh", TrainConfiguration(), (), {})
    program = (
        f"import sys; sys.modules['torch'] = None; from vm_train.cli.train import main; sys.exit(main({arguments}))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, cwd=tmp_path, check=False)
    assert done.returncode == 1
    said = "vm-train: torch is not installed; run: pip install '.[train]' in the folder of vm-embedded\n"
    assert done.stderr == said


@pytest.mark.long
def test_a_folder_without_pictures_or_a_training_ends_in_one_line(tmp_path):
    assert "for images with boxes, vm-train has --boxes" in run(tmp_path, "-o", tmp_path / "run", code=1).stderr
    assert "holds no training" in run("resume", tmp_path, code=1).stderr


@pytest.mark.parametrize(
    "text", ["", "[]", '{"kind": []}', '{"kind": "look"}', '{"kind": "tune"}', pytest.param("[" * 200_000, id="deep")]
)
def test_a_damaged_description_of_a_training_ends_in_one_line(text, tmp_path, capsys):
    (tmp_path / "run.json").write_text(text)
    assert main(["resume", str(tmp_path)]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"vm-train: {tmp_path / 'run.json'} is damaged: ")


@pytest.mark.parametrize("kind", [None, "look", "tune"])
def test_a_training_of_another_release_is_refused_in_one_line(kind, tmp_path, capsys):
    (tmp_path / "run.json").write_text(json.dumps({"kind": kind, "format": 0}))
    assert main(["resume", str(tmp_path)]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"vm-train: {tmp_path / 'run.json'} was written by another release: begin the ")


@pytest.mark.long
def test_the_rate_finder_proposes_a_rate(data, configuration, tmp_path):
    done = run("rate", data, "--config", configuration, "--steps", 60, "--plot", tmp_path / "rate.png")
    proposed = float(re.search(r"proposed: training\.rate = (\S+)", done.stdout)[1])
    assert 1e-4 < proposed < 1.0
    assert (tmp_path / "rate.png").read_bytes().startswith(b"\x89PNG")


def test_the_preview_is_a_picture(data, configuration, tmp_path):
    done = run("preview", data, "--config", configuration, "--count", 2, "--output", tmp_path / "sheet.jpg")
    assert "2 pictures" in done.stdout
    assert (tmp_path / "sheet.jpg").stat().st_size > 10000


@pytest.mark.long
def test_a_configuration_can_be_written_and_used(data, tmp_path):
    (tmp_path / "train.toml").write_text(run("config").stdout)
    done = run("check", data, "--config", tmp_path / "train.toml")
    assert "no picture shows class goal" in done.stderr  # of the usual classes, this set has no goals and no robots


@pytest.mark.long
def test_a_loss_that_is_no_number_ends_the_training_at_once(data, configuration, tmp_path):
    wild = ["--set", "training.rate=1000", "--set", "training.clip=0", "--set", "training.optimizer=sgd"]
    done = run(data, "-o", tmp_path / "run", "--config", configuration, *wild, code=1)
    assert "is NaN or infinite: begin again with a lower training.rate" in done.stderr
    assert "resume" not in done.stderr  # it would end in the same way


@pytest.mark.long
def test_a_full_disk_ends_in_one_line(data, configuration, tmp_path):
    """A limit on the size of files stands for the disk."""
    limited = ["bash", "-c", 'trap "" XFSZ; ulimit -f 8; exec "$@"', "bash", *COMMAND, data, "-o", tmp_path / "run"]
    done = subprocess.run(
        [str(each) for each in [*limited, "--config", configuration, "--no-unpacked", "--workers", "0"]],
        capture_output=True,
        text=True,
        timeout=240,
        env=environment(),
    )
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1].startswith("vm-train: can't write")
    assert "Traceback" not in done.stderr
