"""Folders of boxes for tests, and vm-label as a process."""

import json
import re
import subprocess
from contextlib import contextmanager

import cv2
import numpy as np

from tests.preloaded import run_preloaded
from tests.programs import BIN

COMMAND = [str(BIN / "vm-label")]
SIZE = 160, 120


def make_folder(folder, count, near=True, classes=("ball",)):
    """Write `count` drawn images, each with a found box of confidence 0.5 to 0.99 and, with `near`, a near miss."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "classes.txt").write_text("".join(f"{each}\n" for each in classes))
    lines = []
    for index in range(count):
        name = f"image{index:04d}"
        image = np.full((SIZE[1], SIZE[0], 3), 90, dtype=np.uint8)
        cv2.circle(image, (40 + index % 80, 60), 10, (40, 200, 240), cv2.FILLED)
        cv2.imwrite(str(folder / f"{name}.jpg"), image)
        (folder / f"lens{index:04d}.yaml").write_text("projection: EQUISOLID\n")
        x = round((40.5 + index % 80) / SIZE[0], 6)
        (folder / f"{name}.txt").write_text(f"0 {x:.6f} 0.500000 0.131250 0.175000\n")
        found = {"image": f"{name}.jpg", "class": classes[0], "box": [x, 0.5, 0.13125, 0.175]}
        lines.append(found | {"confidence": round(0.5 + 0.49 * index / count, 3), "found": True})
        if near:
            lines.append(found | {"box": [0.5, 0.1, 0.1, 0.1], "confidence": 0.2, "found": False})
    (folder / "candidates.jsonl").write_text("".join(json.dumps(each) + "\n" for each in lines))
    return folder


def run(*arguments, code=0, **more):
    done = run_preloaded([*COMMAND, *arguments], **more)
    assert done.returncode == code, (done.returncode, done.stderr)
    assert "Traceback" not in done.stderr
    return done


@contextmanager
def serving(folder, *options, port=0):
    """vm-label on a folder: the process and its address."""
    command = [*COMMAND, str(folder), "--no-browser", "--port", str(port), *map(str, options)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        line = process.stdout.readline()
        address = re.search(r"http://\S+", line)
        assert address, (line, process.stderr.read())
        yield process, address[0]
    finally:
        process.kill()
        process.communicate()


def answer_lines(folder):
    return [json.loads(line) for line in (folder / "answers.jsonl").read_text().splitlines()]
