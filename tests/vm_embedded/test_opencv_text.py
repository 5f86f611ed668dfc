"""What OpenCV gets of names: the file of exactly this name, or an error."""

from pathlib import Path

import pytest

from vm_embedded.errors import InputError
from vm_embedded.files import library_path
from vm_embedded.opencv_text import open_capture


@pytest.mark.parametrize("ending", ["\0x", "\ud800"])
def test_a_name_that_no_file_can_have_is_an_error_and_not_another_file(tmp_path, ending):
    (tmp_path / "a.avi").touch()
    for use in (lambda path: library_path(path).__enter__(), open_capture):
        with pytest.raises(OSError, match=r"zero byte|surrogates"):
            use(Path(f"{tmp_path}/a.avi{ending}"))


@pytest.mark.parametrize("ending", ["\0x", "\ud800"])
def test_an_address_that_is_no_text_is_an_error(ending):
    with pytest.raises(InputError):
        open_capture(f"rtsp://127.0.0.1:1/{ending}")
