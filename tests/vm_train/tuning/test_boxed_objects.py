"""Objects in boxed frames, and the split by recording."""

from itertools import chain
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_embedded.errors import InputError
from vm_train.boxes.box import Box, BoxedPicture, BoxedSet
from vm_train.tuning.boxed_objects import (
    boxes_sha256,
    check_boxes,
    divided,
    hold_out,
    objects_of,
    split_by_recording,
)

SIZE = (200, 150)


def picture(*boxes, recording="a", name="x.jpg"):
    return BoxedPicture(Path(name), SIZE, tuple(Box("ball", *each) for each in boxes), recording)


def test_only_boxes_of_the_class_count():
    shown = BoxedPicture(Path("x.jpg"), SIZE, (Box("ball", 10, 20, 30, 42), Box("robot", 0, 0, 9, 9)), "a")
    found = objects_of(shown, "ball", True)
    assert found.centers.tolist() == [[20.0, 31.0]]
    assert found.radii.tolist() == [11.0]
    assert objects_of(shown, "ball", False).radii.tolist() == [10.0]
    assert len(objects_of(shown, "cup", True)) == 0


@given(st.floats(-8.0, 207.0), st.floats(-8.0, 157.0), st.floats(10.0, 30.0))
def test_a_ball_that_the_border_cuts_is_completed(x, y, radius):
    """As long as its full width or height is in the picture, and it touches no two borders that are opposite."""
    left, top, right, bottom = x - radius, y - radius, x + radius, y + radius
    box = max(left, -0.5), max(top, -0.5), min(right, SIZE[0] - 0.5), min(bottom, SIZE[1] - 0.5)
    if max(box[2] - box[0], box[3] - box[1]) < 2.0 * radius - 1e-9:
        return
    found = objects_of(picture(box), "ball", True)
    assert found.radii[0] == pytest.approx(radius)
    np.testing.assert_allclose(found.centers[0], [x, y], atol=2.0 + 1e-6)  # a box at the border may be cut or not


@given(
    st.lists(st.sampled_from("abcdefgh"), min_size=1, max_size=60),
    st.floats(0.0, 0.5),
    st.floats(0.0, 0.5),
    st.integers(0, 100),
)
def test_a_recording_is_in_one_part_or_divided_in_time(recordings, share, test, seed):
    pictures = [picture(recording=each, name=f"{number}.jpg") for number, each in enumerate(recordings)]
    split = split_by_recording(pictures, share, test, seed)
    numbers = [[int(each) for each in part] for part in (split.training, split.validation, split.test)]
    assert sorted(chain(*numbers)) == list(range(len(pictures)))
    assert split == split_by_recording(pictures, share, test, seed)
    training, validation, tested = ({recordings[each] for each in part} for part in numbers)
    assert divided(pictures, numbers[2]) == bool(tested & (training | validation))
    if divided(pictures, numbers[2]):
        assert not validation
        for each in tested & training:
            frames = [at for at, recording in enumerate(recordings) if recording == each]
            assert frames[-round(len(frames) / 3) :] == [at for at in numbers[2] if recordings[at] == each]
    else:
        assert not training & (validation | tested)
        assert not validation & tested
        assert len(split.test) <= 1.5 * test * len(pictures)
    assert len(split.validation) <= 1.5 * share * len(pictures)


def test_many_small_recordings_give_about_the_shares_that_were_asked_for():
    pictures = [picture(recording=str(number // 3)) for number in range(300)]
    split = split_by_recording(pictures, 0.2, 0.1, 0)
    assert len(split.validation) == pytest.approx(60, abs=3)
    assert len(split.test) == pytest.approx(30, abs=3)


@pytest.mark.parametrize("names", ["film-{}.jpg", "{}.png", "day/image{:05d}.jpg"])
def test_of_a_single_recording_the_last_third_in_time_is_held_out(names):
    """Also if the files are listed as text sorts them: frame 10 comes after frame 9."""
    order = sorted(range(40), key=str)
    pictures = [picture(name=names.format(frame)) for frame in order]
    assert {order[at] for at in hold_out(pictures, 0.15, 0)} == set(range(27, 40))
    assert divided(pictures, hold_out(pictures, 0.15, 0))
    assert hold_out(pictures, 0.0, 0) == set()


def test_of_two_equal_recordings_the_last_thirds_are_held_out():
    pictures = [picture(recording=each, name=f"{each}{frame}.jpg") for each in "ab" for frame in range(20)]
    assert hold_out(pictures, 0.15, 0) == {*range(13, 20), *range(33, 40)}


def test_a_class_without_boxes_tells_which_there_are():
    boxes = BoxedSet((BoxedPicture(Path("x.jpg"), SIZE, (Box("0", 1, 2, 3, 4),), "a"),), (), ("0",))
    with pytest.raises(InputError, match=r"DIR has no box of class ball.*it has 0 \(1\).*--names 0=ball"):
        check_boxes(boxes, "ball", "DIR")
    for names, old in ((("2", "0"), "NAME"), (("robot", "Ball"), "Ball")):
        some = tuple(Box(name, 1, 2, 3, 4) for name in names)
        with pytest.raises(InputError, match=f"--names {old}=ball"):
            check_boxes(BoxedSet((BoxedPicture(Path("x.jpg"), SIZE, some, "a"),), (), names), "ball", "DIR")
    with pytest.raises(InputError, match="no picture of DIR can be used"):
        check_boxes(BoxedSet((), (), ()), "ball", "DIR")
    check_boxes(boxes, "0", "DIR")


def test_any_change_of_a_box_changes_the_digest():
    one = boxes_sha256([picture((1, 2, 3, 4))])
    assert one == boxes_sha256([picture((1, 2, 3, 4))])
    assert one != boxes_sha256([picture((1, 2, 3, 4.001))])
    assert one != boxes_sha256([picture((1, 2, 3, 4), name="y.jpg")])
