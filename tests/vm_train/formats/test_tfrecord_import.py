"""TFRecord files become a folder of pictures and lenses; a stopped import continues."""

import numpy as np
import pytest

from tests.folders import contents
from vm_embedded import read_lens_file
from vm_embedded.errors import InputError
from vm_train.data.pictures import find_pictures

from .test_picture_example import IMAGE, LENS, MASK, POSE, encoded, imported, reference_example, written


@pytest.mark.parametrize("compressed", [False, True])
def test_an_import_is_a_folder_of_pictures_with_the_same_bytes_and_lenses(tmp_path, compressed):
    png = encoded(".png", np.zeros((24, 32, 3), dtype=np.uint8))
    path = written(tmp_path / "a", reference_example(), reference_example(image=[png]), compressed=compressed)
    shares = []
    made = imported([path], tmp_path / "out", report=shares.append)
    assert (made.count, made.skipped, made.there, made.remarks) == (2, (), 0, ())
    first, second = find_pictures(tmp_path / "out")
    assert (first.image.name, second.image.name) == ("image0000000.jpg", "image0000001.png")
    assert (first.image.read_bytes(), second.image.read_bytes()) == (IMAGE, png)
    assert first.mask.read_bytes() == second.mask.read_bytes() == MASK
    read = read_lens_file(first.lens)
    assert read.lens == LENS
    assert read.orientation.height == POSE.height
    assert np.array_equal(read.orientation.rotation, POSE.rotation.astype(np.float32))
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


def test_a_damaged_payload_is_skipped_and_a_file_that_breaks_off_stops_the_import(tmp_path):
    path = written(tmp_path / "a", reference_example(), reference_example(), reference_example())
    data = bytearray(path.read_bytes())
    data[40] ^= 1
    path.write_bytes(data)
    made = imported([path], tmp_path / "out")
    assert made.count == 2
    assert "record 0: it is damaged" in made.skipped[0]
    path.write_bytes(data[:-10])
    with pytest.raises(InputError, match="is cut short in record 2"):
        imported([path], tmp_path / "other")
    assert len(find_pictures(tmp_path / "other")) == 1


def test_numbers_go_on_over_all_files(tmp_path):
    files = [written(tmp_path / name, reference_example(), reference_example()) for name in "ab"]
    assert imported(files, tmp_path / "out").count == 4
    numbers = [int(each.number) for each in find_pictures(tmp_path / "out")]
    assert numbers == [0, 1, 2, 3]


class Stop(Exception):
    pass


@pytest.mark.parametrize("after", [1, 2, 3, 4])
def test_an_import_that_was_stopped_goes_on(tmp_path, after):
    broken = reference_example(mask=None)
    files = [written(tmp_path / name, reference_example(), broken, reference_example()) for name in "ab"]
    seen = []

    def stop(share):
        seen.append(share)
        if len(seen) == after:
            raise Stop

    with pytest.raises(Stop):
        imported(files, tmp_path / "out", report=stop)
    before = len(find_pictures(tmp_path / "out"))
    made = imported(files, tmp_path / "out")
    assert (made.count, made.there, len(made.skipped)) == (4 - before, before, 2)
    imported(files, tmp_path / "whole")
    assert contents(tmp_path / "out") == contents(tmp_path / "whole")


def test_a_picture_without_one_of_its_files_is_written_again(tmp_path):
    path = written(tmp_path / "a", reference_example(), reference_example())
    imported([path], tmp_path / "out")
    whole = contents(tmp_path / "out")
    for name in ("image0000000.jpg", "lens0000001.yaml"):
        (tmp_path / "out" / name).unlink()
    assert imported([path], tmp_path / "out").count == 2
    assert contents(tmp_path / "out") == whole


def test_files_may_be_appended_to_an_import_but_other_pictures_never_overwrite_it(tmp_path):
    first = written(tmp_path / "first", reference_example())
    second = written(tmp_path / "second", reference_example(), reference_example())
    out = tmp_path / "out"
    assert imported([first], out).count == 1
    made = imported([first, second], out)
    assert (made.count, made.there) == (2, 1)
    whole = contents(out)
    png = encoded(".png", np.zeros((24, 32, 3), dtype=np.uint8))
    for number, changes in enumerate(({"image": [png]}, {"lens_fov": [1.0]}, {"mask": [MASK + b"\0"]})):
        other = written(tmp_path / f"other{number}", reference_example(**changes))
        with pytest.raises(InputError, match=r"already: two pictures have the number 0000000; import one"):
            imported([other], out)
    assert contents(out) == whole


def test_files_that_are_not_there_and_a_folder_that_is_a_file_are_named(tmp_path):
    path = written(tmp_path / "a", reference_example())
    with pytest.raises(InputError, match=r"can't read .*absent[^:]*: No such file or directory$"):
        imported([path, tmp_path / "absent"], tmp_path / "out")
    with pytest.raises(InputError, match=r"can't use folder .*a: "):
        imported([path], path)
