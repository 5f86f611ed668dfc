"""Folders of images with boxes, in YOLO, Pascal VOC and COCO format, and what vm-label reads beside them.

An input has one or several files, each after a line with its name. Without an a.jpg among them, there is a good one.
"""

import re
import shutil
from contextlib import suppress

import cv2
import numpy as np

from vm_embedded.cameras.library_messages import silence_opencv
from vm_embedded.errors import VisualMeshError
from vm_label.answers import read_answers
from vm_label.box_folder import read_box_folder
from vm_train.boxes.read import FORMATS, files_in, read_boxes

from .scratch import scratch

NAMES = (
    "a.jpg",
    "a.txt",
    "a.xml",
    "all.json",
    "answers.jsonl",
    "candidates.jsonl",
    "classes.txt",
    "data.yaml",
    "lensa.yaml",
)

_HEAD = re.compile(rf"(?m)^== ({'|'.join(map(re.escape, NAMES))})\n".encode())
_IMAGE = cv2.imencode(".jpg", np.random.default_rng(1).integers(0, 256, (12, 16, 3), dtype=np.uint8))[1].tobytes()

silence_opencv()  # as vm-train does


def joined(files: dict[str, bytes]) -> bytes:
    """An input with these files."""
    return b"".join(b"== %s\n%s" % (name.encode(), content) for name, content in files.items())


def run(data: bytes) -> None:
    folder = scratch("boxes")
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    (folder / "a.jpg").write_bytes(_IMAGE)
    _, *parts = _HEAD.split(data)
    for name, content in zip(parts[::2], parts[1::2], strict=True):
        (folder / name.decode()).write_bytes(content)
    for each in (None, *FORMATS):
        with suppress(VisualMeshError):
            found = read_boxes(folder, each)
            assert all(len(each.text.splitlines()) == 1 for each in found.findings), found.findings
            assert all(name.isprintable() for name in found.names), found.names
    with suppress(VisualMeshError):
        list(files_in(folder))
    with suppress(VisualMeshError):
        read_answers(folder)
    read_box_folder(folder)
