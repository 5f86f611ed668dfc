"""Shards to stream: names with ranges, and options that contradict each other."""

import pytest

from vm_train.cli.stream_options import shard_names
from vm_train.cli.train import main


def test_ranges_stand_for_all_their_numbers(tmp_path, monkeypatch):
    assert shard_names(["http://a/{08..10}-{1..2}.tar", "pipe:awk '{print}' b"]) == (
        *(f"http://a/{first}-{second}.tar" for first in ("08", "09", "10") for second in (1, 2)),
        "pipe:awk '{print}' b",
    )
    (tmp_path / "1.tar").touch()
    monkeypatch.chdir(tmp_path)
    assert shard_names(["{1..1}.tar"]) == (str(tmp_path / "1.tar"),)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--stream", "http://a/{00000000..99999999}.tar", "--epoch-pictures", "9"], "more than 1000000 shards"),
        (["--stream", "http://a/{3..1}.tar", "--epoch-pictures", "9"], "the range {3..1} ends before it begins"),
        (["--stream", "nowhere.tar", "--epoch-pictures", "9"], "shard 'nowhere.tar' does not exist"),
        (["--stream", "", "--epoch-pictures", "9"], "shard '' does not exist"),
        (["--stream", "/usr/", "--epoch-pictures", "9"], "as in /usr/pictures-{000000..000009}.tar"),
        (["--stream", "-", "--epoch-pictures", "9"], "standard input can't be read again"),
        (["--stream", "http://a/1.tar", "http://a/1.tar", "--epoch-pictures", "9"], "named twice"),
        (["--stream", "http://a/1.tar"], "--stream needs --epoch-pictures"),
        (["--stream", "http://a/1.tar", "--epoch-pictures", "0"], "at least 1, not 0"),
        (["--epoch-pictures", "9"], "--epoch-pictures needs --stream"),
        (
            ["--stream", "http://a/1.tar", "--epoch-pictures", "9", "--test", "a.txt"],
            "--stream can't be combined with lists",
        ),
        (["--stream", "http://a/1.tar", "--epoch-pictures", "9", "--set", "mesh.radius_of=scene"], "sceneX.json"),
        (["--stream", "http://127.0.0.1:9/1.tar", "--epoch-pictures", "9"], "http://127.0.0.1:9/1.tar: can't be read"),
    ],
)
def test_wrong_options_end_in_one_line(arguments, said, data, configuration, tmp_path, capsys):
    command = [str(data), "-o", str(tmp_path / "run"), "--config", str(configuration), *arguments]
    assert main([*command, "--workers", "0"]) == 1
    error = capsys.readouterr().err
    assert said in error.splitlines()[-1]
    assert not (tmp_path / "run" / "run.json").exists()
