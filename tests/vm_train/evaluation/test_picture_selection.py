"""Lists and the parts of a training choose the pictures of an evaluation."""

import json

import pytest

from vm_embedded.errors import InputError
from vm_train.evaluation.picture_selection import select_pictures


def test_lists_choose_pictures(drawn, tmp_path):
    chosen = tmp_path / "list.txt"
    chosen.write_text("# some\n0003\nimage0001.jpg  # by its name\n\n")
    assert [each.number for each in select_pictures([drawn], chosen, None)] == ["0001", "0003"]
    run = tmp_path / "pictures.json"
    run.write_text(json.dumps({"training": ["0000"], "validation": ["0002"], "test": ["0005", "0006"]}))
    assert [each.number for each in select_pictures([drawn], run, None)] == ["0005", "0006"]
    assert [each.number for each in select_pictures([drawn], run, "validation")] == ["0002"]
    assert len(select_pictures([drawn, drawn], None, None)) == 20
    for without in (chosen, None):
        with pytest.raises(InputError, match="give it with --list"):
            select_pictures([drawn], without, "test")


@pytest.mark.parametrize(("text", "part"), [("0099\n", "did you mean '0009'"), ("# none\n", "names no picture")])
def test_lists_of_what_is_not_there_are_refused(drawn, tmp_path, text, part):
    chosen = tmp_path / "list.txt"
    chosen.write_text(text)
    with pytest.raises(InputError, match=part):
        select_pictures([drawn], chosen, None)
    with pytest.raises(InputError, match=r"missing\.txt"):
        select_pictures([drawn], tmp_path / "missing.txt", None)
