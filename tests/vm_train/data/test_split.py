"""Splits: by seed, by lists, written down and read back."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_embedded.errors import InputError
from vm_train.data.split import Split, read_split, split_by_lists, split_by_seed, write_split

NUMBERS = tuple(f"{index:07d}" for index in range(1000))

seeds = st.integers(0, 2**31)
sets = st.lists(st.text("0123456789", min_size=1), unique=True, max_size=300)


@given(seeds, st.integers(50, 900))
def test_more_pictures_move_none_of_the_others(seed, count):
    few, many = (split_by_seed(NUMBERS[:n], 0.2, 0.2, seed) for n in (count, len(NUMBERS)))
    assert set(few.training) <= set(many.training)
    assert set(few.validation) <= set(many.validation)
    assert set(few.test) <= set(many.test)


@given(seeds)
def test_every_picture_is_in_one_part_and_shares_hold_about(seed):
    split = split_by_seed(NUMBERS, 0.1, 0.2, seed)
    assert sorted(split.training + split.validation + split.test) == list(NUMBERS)
    assert abs(len(split.validation) - 100) < 60
    assert abs(len(split.test) - 200) < 80


@given(sets, seeds)
def test_the_order_of_pictures_does_not_matter(numbers, seed):
    def parts(of):
        try:
            split = split_by_seed(of, 0.3, 0.3, seed)
        except InputError as error:
            return str(error)
        return [set(each) for each in (split.training, split.validation, split.test)]

    assert parts(numbers) == parts(numbers[::-1])


def test_pictures_that_were_held_out_stay_held_out():
    earlier = split_by_seed(NUMBERS, 0.1, 0.1, 1)
    split = split_by_seed(NUMBERS, 0.1, 0.0, 0, earlier)
    assert split.test == earlier.test
    assert set(earlier.validation) < set(split.validation)
    assert split_by_seed(NUMBERS, 0.1, 0.0, 1, earlier).validation == earlier.validation


def test_another_seed_gives_another_split():
    assert split_by_seed(NUMBERS, 0.1, 0.0, 0) != split_by_seed(NUMBERS, 0.1, 0.0, 1)


@pytest.mark.parametrize(("validation", "test"), [(-0.1, 0.0), (0.5, 0.5), (1.0, 0.0), (float("nan"), 0.0)])
def test_shares_that_leave_nothing_are_refused(validation, test):
    with pytest.raises(InputError, match="add up to less than 1"):
        split_by_seed(NUMBERS, validation, test, 0)


def test_empty_parts_are_named():
    with pytest.raises(InputError, match=r"validation gets none .*: change data\.validation or data\.split_seed"):
        split_by_seed(NUMBERS, 0.0, 0.1, 0)
    with pytest.raises(InputError, match="training gets none of the 0 pictures"):
        split_by_seed((), 0.1, 0.1, 0)
    with pytest.raises(InputError, match="validation gets none of the 1000 pictures: list its pictures in a file"):
        split_by_lists(NUMBERS, None, None, None)


def listed(path, *lines):
    path.write_text("\n".join(lines) + "\n")
    return path


def test_lists_name_numbers_or_images_and_training_gets_the_rest(tmp_path):
    validation = listed(tmp_path / "v.txt", "# held out", "0000001", "", "image0000002.jpg  # a good one", "0000001")
    test = listed(tmp_path / "t.txt", "some/where/image0000003.PNG")
    split = split_by_lists(NUMBERS, None, validation, test)
    assert split.validation == ("0000001", "0000002")
    assert split.test == ("0000003",)
    assert split.training == (NUMBERS[0], *NUMBERS[4:])


def test_a_training_list_leaves_the_others_out(tmp_path):
    training, validation = listed(tmp_path / "r.txt", "0000005"), listed(tmp_path / "v.txt", "0000006")
    assert split_by_lists(NUMBERS, training, validation, None) == Split(("0000005",), ("0000006",))


def test_faults_of_lists_are_named(tmp_path):
    one, two = listed(tmp_path / "one.txt", "0000001", "0000002"), listed(tmp_path / "two.txt", "0000002")
    with pytest.raises(InputError, match="training and validation share pictures 0000002"):
        split_by_lists(NUMBERS, one, two, None)
    with pytest.raises(InputError, match=r"v.txt, line 2: there is no picture '000012'; did you mean '0000\d*12\d*'"):
        split_by_lists(NUMBERS, None, listed(tmp_path / "v.txt", "0000001", "000012"), None)
    with pytest.raises(InputError, match="can't read list"):
        split_by_lists(NUMBERS, None, tmp_path / "nowhere.txt", None)
    (tmp_path / "binary.txt").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="can't read list"):
        split_by_lists(NUMBERS, None, tmp_path / "binary.txt", None)


def test_a_split_is_written_and_read_back(tmp_path):
    split = split_by_seed(NUMBERS, 0.1, 0.1, 7)
    write_split(tmp_path / "pictures.json", split)
    assert read_split(tmp_path / "pictures.json") == split


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        "[" * 100_000,
        '{"training": ["1"]}',
        json.dumps({"training": "12", "validation": [], "test": []}),
        json.dumps({"training": [1], "validation": [], "test": []}),
        json.dumps({"training": None, "validation": [], "test": []}),
        json.dumps({"training": ["1"], "validation": ["1"], "test": []}),
    ],
)
def test_damaged_files_are_named(text, tmp_path):
    (tmp_path / "pictures.json").write_text(text)
    with pytest.raises(InputError, match=r"pictures\.json"):
        read_split(tmp_path / "pictures.json")
    with pytest.raises(InputError, match="can't read"):
        read_split(tmp_path / "nowhere.json")
