import shutil

import pytest

from tests.drawn_scenes import IMAGES


@pytest.fixture
def folder(tmp_path):
    """A directory with two of the drawn frames and their lens files."""
    target = tmp_path / "frames"
    target.mkdir()
    for image in IMAGES[:2]:
        shutil.copy(image, target)
        shutil.copy(image.with_name(image.name.replace("image", "lens")).with_suffix(".yaml"), target)
    return target


@pytest.fixture(scope="module")
def lens(tmp_path_factory):
    """A lens file without an orientation."""
    path = tmp_path_factory.mktemp("lens") / "lens.toml"
    path.write_text('projection = "equisolid"\nfocal_length = 280.0\nfov = 2.4\nsize = [640, 512]\n')
    return path
