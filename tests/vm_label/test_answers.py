"""The file of answers: the last one counts, whatever happens to the file."""

import os
import resource
import signal
import tempfile
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_embedded.errors import InputError
from vm_label.answers import ANSWERS, AnswerFile, read_answers
from vm_label.crops import Crop

CROPS = [Crop(f"image{index}.jpg", "ball", (0.5, 0.5, 0.1, 0.1), None) for index in range(4)]
GIVEN = st.lists(st.tuples(st.sampled_from(CROPS), st.sampled_from([*ANSWERS, None])))


def write(folder, given):
    with AnswerFile(folder) as file:
        for crop, answer in given:
            file.append(crop, answer)


def last(given):
    return {crop.id: answer for crop, answer in dict(given).items() if answer is not None}


@given(GIVEN, GIVEN, st.integers(0, 60))
def test_the_last_answer_counts_and_a_torn_line_costs_only_itself(before, after, torn):
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write(folder, before)
        assert read_answers(folder) == (last(before), [], [])
        with (folder / "answers.jsonl").open("ab") as file:
            file.write(b'{"crop": "0123456789abcdef", "answer": "yes", "image": "image0.jpg"'[:torn])
        write(folder, after)
        answers, _, faults = read_answers(folder)
        assert answers == last([*before, *after])
        assert len(faults) == (torn > 0)


@pytest.mark.long
@given(GIVEN)
def test_answers_are_in_the_order_of_the_newest(given):
    with tempfile.TemporaryDirectory() as name:
        write(Path(name), given)
        newest = [crop.id for crop, _ in reversed(given)]
        order = list(read_answers(Path(name))[0])
        assert order == [crop for crop in reversed(list(dict.fromkeys(newest))) if crop in order]


@pytest.mark.parametrize(
    "line", ["[]", "null", "{}", '{"crop": 1, "answer": "yes"}', '{"crop": "a", "answer": "maybe"}']
)
def test_a_line_that_is_not_an_answer_is_named(tmp_path, line):
    write(tmp_path, [(CROPS[0], "yes")])
    with (tmp_path / "answers.jsonl").open("a") as file:
        file.write(line + "\n\n")
    answers, _, (fault,) = read_answers(tmp_path)
    assert answers == {CROPS[0].id: "yes"}
    assert "answers.jsonl: line 2 is not an answer" in fault


def test_a_full_disk_leaves_the_file_as_it_was(tmp_path):
    with AnswerFile(tmp_path) as file:
        file.append(CROPS[0], "yes")
        size = file.path.stat().st_size
        before = resource.getrlimit(resource.RLIMIT_FSIZE)
        handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (size + 20, before[1]))
        try:
            with pytest.raises(InputError, match=r"can't write .*answers.jsonl"):
                file.append(CROPS[1], "no")
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, before)
            signal.signal(signal.SIGXFSZ, handler)
        assert file.path.stat().st_size == size
        file.append(CROPS[1], "skip")
    assert read_answers(tmp_path) == ({CROPS[0].id: "yes", CROPS[1].id: "skip"}, [], [])


def test_only_one_process_has_the_file_open(tmp_path):
    with AnswerFile(tmp_path), pytest.raises(InputError, match="another vm-label"):
        AnswerFile(tmp_path)
    AnswerFile(tmp_path).__exit__(None, None, None)


def test_a_folder_that_can_t_be_written_is_named(tmp_path):
    with pytest.raises(InputError, match="can't write"):
        AnswerFile(tmp_path / "missing")
    (tmp_path / "answers.jsonl").mkdir()
    with pytest.raises(InputError, match=os.strerror(21)):
        AnswerFile(tmp_path)
    with pytest.raises(InputError, match="can't read"):
        read_answers(tmp_path)
