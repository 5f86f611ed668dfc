"""Files of editors that begin a text with a byte order mark: vm-detect reads them like any other."""

import pytest

from tests.drawn_scenes import IMAGES

from .commands import detect, lines, one_complaint, run

MARK = "\ufeff"


@pytest.fixture
def plain(tmp_path):
    """A picture without a lens file beside it."""
    path = tmp_path / "plain.jpg"
    path.write_bytes(IMAGES[0].read_bytes())
    return path


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("lens.yaml", "projection: EQUISOLID\nfocal_length: 280.0\nfov: 2.4\n"),
        ("lens.toml", 'projection = "equisolid"\nfocal_length = 280.0\nfov = 2.4\n'),
    ],
)
def test_a_lens_file(plain, name, text, tmp_path):
    lens = tmp_path / name
    answers = []
    for mark in ("", MARK):
        lens.write_text(mark + text, encoding="utf-8")
        answers.append(lines(detect(plain, "--lens", lens, "--height", 0.8))[0]["detections"])
    assert answers[0] == answers[1]


def test_a_configuration(plain, tmp_path):
    config = tmp_path / "vm.toml"
    config.write_text(f"{MARK}[orientation]\nheight = 0.8\n", encoding="utf-8")
    assert lines(detect(plain, "--config", config, "--fov", "70deg"))
    config.write_text(f"{MARK}[orientatoin]\nheight = 0.8\n", encoding="utf-8")
    one_complaint(run(plain, "--config", config, code=1), "vm.toml, line 1", "did you mean 'orientation'?")
