"""Boxes that are there twice: the verdicts are those of comparing each with all, in far less time."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_embedded.output.box_files import overlap
from vm_train.boxes import checked_boxes as checks
from vm_train.boxes.annotation import RawBox
from vm_train.boxes.checked_boxes import checked_boxes
from vm_workstation.box_grid import BoxGrid

SIZE = (640, 480)


@st.composite
def similar_boxes(draw):
    """Boxes of two classes, many of them at almost the same place, of all sizes."""
    bases = draw(
        st.lists(
            st.tuples(st.floats(0.0, 600.0), st.floats(0.0, 440.0), st.floats(1e-9, 300.0), st.floats(1e-9, 300.0)),
            min_size=1,
            max_size=3,
        )
    )
    moved = st.floats(-0.12, 0.12) | st.sampled_from([0.0, 0.1, -0.1, 1.0 / 9.0, 1e-9])
    boxes = []
    for _ in range(draw(st.integers(2, 14))):
        left, top, width, height = draw(st.sampled_from(bases))
        x, y, wider, higher = (draw(moved) for _ in range(4))
        left, top = left + x * width, top + y * height
        edges = (left, top, left + width * (1.0 + wider), top + height * (1.0 + higher))
        boxes.append((draw(st.sampled_from(["ball", "goal"])), edges))
    return boxes


@given(similar_boxes())
def test_a_box_is_left_out_if_one_before_it_that_stays_is_the_same(boxes):
    raw = [RawBox(f"a.txt line {number}", name, edges) for number, (name, edges) in enumerate(boxes, start=1)]
    found = checked_boxes(raw, SIZE, ())
    alone = [checked_boxes([each], SIZE, ()) for each in raw]
    kept, said, unusable = [], [], []
    for each, checked in zip(raw, alone, strict=True):
        single = checked.good
        same = [
            at for at, box in kept for one in single if box.name == one.name and overlap(box.edges, one.edges) >= 0.9
        ]
        if same:
            said.append(f"{each.place}: the same box of {each.name} as {' '.join(same[0].split()[-2:])}; box not used")
        else:
            kept += [(each.place, box) for box in single]
            said += [finding.text for finding in checked.findings]
            unusable += checked.unusable
    assert found.good == [box for _, box in kept]
    assert [finding.text for finding in found.findings] == said
    assert found.unusable == unusable


@given(similar_boxes(), st.sampled_from([0.1, 0.5, 0.9, 0.99]))
def test_no_box_that_is_near_is_missed(boxes, least):
    grid = BoxGrid(least)
    for name, edges in boxes:
        grid.add(name, edges)
    for name, edges in boxes:
        near = {at for at, other in grid.near(name, edges) if overlap(edges, other) >= least}
        everywhere = {at for at, (kind, other) in enumerate(boxes) if kind == name and overlap(edges, other) >= least}
        assert near == everywhere
        assert all(boxes[at] == (name, other) for at, other in grid.near(name, edges))


@pytest.mark.parametrize("spread", [1.0, 0.01])
def test_thousands_of_boxes_are_compared_with_few(spread, monkeypatch):
    """With all, these would be two million comparisons."""
    compared = []
    monkeypatch.setattr(checks, "overlap", lambda one, other: compared.append(0) or overlap(one, other))
    random, count = np.random.default_rng(1), 2000
    corners, sides = random.uniform(0.0, 1.0, (2, count, 2))
    low = 200.0 + spread * corners * (400.0, 200.0)
    high = low + 20.0 * (1.0 + spread * sides)
    edges = [(*one, *other) for one, other in zip(low.tolist(), high.tolist(), strict=True)]
    found = checked_boxes([RawBox(f"a.txt line {at}", "ball", each) for at, each in enumerate(edges)], SIZE, ())
    assert len(found.good) + len(found.findings) == count
    assert len(compared) < 50 * count
