"""Clear sightings where no box is."""

from pathlib import Path

from vm_train.boxes.box import Box, BoxedPicture
from vm_train.boxes.unlabeled import FoundBox, describe, without_box

FOLDER = Path("/frames")


def picture(name, *boxes):
    return BoxedPicture(FOLDER / name, (160, 120), boxes, "frames")


def seen(name, probability, left=20.0, kind="ball"):
    return FoundBox(FOLDER / name, Box(kind, left, 30.0, left + 20.0, 50.0), probability)


def test_sightings_without_a_box_of_their_class_are_told_once():
    ball, robot = Box("ball", 25.0, 30.0, 45.0, 50.0), Box("robot", 0.0, 0.0, 150.0, 100.0)
    pictures = [picture("a.jpg", ball), picture("sub/b.jpg", robot), picture("c.jpg")]
    sightings = [
        seen("a.jpg", 0.99),
        seen("a.jpg", 0.91, left=100.0),
        seen("sub/b.jpg", 0.95),
        seen("sub/b.jpg", 0.97, left=22.0),
        seen("c.jpg", 0.9),
        seen("elsewhere.jpg", 0.9),
    ]
    found = without_box(pictures, sightings)
    assert found == [sightings[3], sightings[1], sightings[4]]
    assert without_box(pictures, reversed(sightings)) == found
    assert describe(found[0], FOLDER).text == (
        "sub/b.jpg: without a box, but looks like a ball: x 32, y 40, 20 x 20 px (probability 0.970)"
    )
