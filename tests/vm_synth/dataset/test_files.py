"""Which pictures of a set are there: vm-synth renders the others again."""

import pytest

from tests.vm_synth.sets import write_set
from vm_synth.dataset.files import PARTS, file_of, is_done


@pytest.mark.parametrize("part", PARTS)
def test_a_picture_with_a_file_that_is_missing_empty_or_cut_short_is_not_there(tmp_path, part):
    write_set(tmp_path, [0])
    path = file_of(tmp_path, part, 0)
    whole = path.read_bytes()
    assert is_done(tmp_path, 0)
    for length in (0, 1, len(whole) // 2, len(whole) - 1):
        path.write_bytes(whole[:length])
        assert not is_done(tmp_path, 0), length
    path.unlink()
    assert not is_done(tmp_path, 0)
    path.write_bytes(whole)
    assert is_done(tmp_path, 0)
