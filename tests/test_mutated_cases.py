"""Inputs that people met elsewhere, damaged: each program says in a line what is wrong with them, or reads them.

MUTATIONS=300 sets the number of damaged inputs for each program.
"""

import os
import random
import shutil

import pytest

from .preloaded import LEARNING, RUNTIME, run_preloaded
from .programs import BIN

COUNT = int(os.environ.get("MUTATIONS", "20"))
CAMERA = ("--height", "0.77", "--pitch", "4.5deg", "--object-radius", "0.11")
OUT = ("-o", "calibrated.yaml")
NAMES = (b"\xe9", b"a:b", "n\u0303".encode(), b" ", b"-", b"%d", b"x" * 200, b"a\nb", b"image0000001", b"{}")
NUMBERS = (b"nan", b"-1", b"1e300", b"1e-300", b"''", b"[]", b"!!python/name:os.system", b"99999999999999999999")


def detect(folder):
    yield "exif-turned", "phone.jpg", lambda path: [path, "--lens", folder / "exif-turned" / "lens.toml", *CAMERA]
    yield "exif-turned", "lens.toml", lambda path: [folder / "exif-turned" / "upright.jpg", "--lens", path, *CAMERA]
    for name in ("imageplain.jpg", "imagerst4.jpg", "imagetail.jpg"):
        yield "jpeg", name, lambda path: [path, "--fov", "90deg", *CAMERA]
    for name in ("a_ref.yaml", "b_camera_model.yaml"):
        yield "lens", name, lambda path: [folder / "lens" / "photo.jpg", "--lens", path, *CAMERA]
    for name in ("film.mp4", "damaged-5-percent.mp4", "board.webm"):
        yield "video", name, lambda path: [path, "--fov", "90deg", *CAMERA]


def train(folder):
    for case, name in BOXES:
        yield case, name, lambda path, case=case: ["check", folder / case, "--boxes", "--no-look"]


def label(folder):
    for case, name in BOXES:
        yield case, name, lambda path, case=case: [folder / case, "--write", folder / "out"]


def calibrate(folder):
    for name in ("board.webm", "damaged-5-percent.mp4"):
        yield "video", name, lambda path: ["lens", path, "--board", "9x6", *OUT]
    case = folder / "exif-turned"
    for name in ("lens.toml", "boxes-of-a-tool/a.txt", "boxes-of-a-tool/a.jpg"):
        given = ["pose", "--balls", case / "boxes-of-a-tool", "--radius", "0.11", *OUT, "--lens"]
        lens = name == "lens.toml"
        yield "exif-turned", name, lambda path, given=given, lens=lens: [*given, path if lens else case / "lens.toml"]


BOXES = (
    ("boxes/mixed", "0.txt"),
    ("boxes/mixed", "1.txt"),
    ("boxes/mixed", "classes.txt"),
    ("boxes/mixed", "5.jpg"),
    ("boxes/roboflow-coco", "train/_annotations.coco.json"),
    ("boxes/roboflow-coco", "train/20230709_r5_cam0_20230709_104538_jpg.rf.0a1b2c3d.jpg"),
    ("exif-turned/boxes-of-a-tool", "a.txt"),
    ("exif-turned/boxes-of-a-tool", "a.jpg"),
)
PROGRAMS = {
    "vm-detect": (detect, RUNTIME),
    "vm-train": (train, LEARNING),
    "vm-label": (label, RUNTIME),
    "vm-calibrate": (calibrate, RUNTIME),
}


def damaged(path, draw):
    """Damage a file: cut it, change some of its bytes or its numbers, or give it another name. Returns its path."""
    content, kind = path.read_bytes(), draw.choice(("cut", "bytes", "number", "name", "ending", "empty", "zeros"))
    if kind == "cut":
        path.write_bytes(content[: draw.randrange(len(content))])
    elif kind == "bytes":
        changed = bytearray(content)
        for _ in range(draw.choice((1, 4, 64))):
            changed[draw.randrange(len(changed))] = draw.randrange(256)
        path.write_bytes(bytes(changed))
    elif kind == "number":
        places = [at for at, each in enumerate(content) if each in b"0123456789"] or [0]
        at = draw.choice(places)
        path.write_bytes(content[:at] + draw.choice(NUMBERS) + content[at + 1 :])
    elif kind == "empty":
        path.write_bytes(b"")
    elif kind == "zeros":
        at = draw.randrange(len(content))
        path.write_bytes(content[:at] + bytes(draw.choice((1, 512, 8192))) + content[at:])
    else:
        name = draw.choice(NAMES) if kind == "name" else os.fsencode(path.stem)
        ending = os.fsencode(path.suffix) if kind == "name" else draw.choice((b"", b".txt", b".JPG", b".mcap", b".xml"))
        other = path.with_name(os.fsdecode(name + ending))
        path.replace(other)
        return other
    return path


@pytest.mark.long
@pytest.mark.parametrize("program", PROGRAMS)
def test_no_damaged_input_shows_a_traceback(shared, program, tmp_path):
    commands, imports = PROGRAMS[program]
    for number in range(COUNT):
        draw, folder = random.Random(f"{program} {number}"), tmp_path / str(number)
        shutil.copytree(shared / "cases", folder, copy_function=shutil.copyfile)
        for each in (folder, *folder.rglob("*/")):
            each.chmod(0o755)
        case, name, arguments = draw.choice(list(commands(folder)))
        given = arguments(damaged(folder / case / name, draw))
        command = [BIN / program, *given]
        done = run_preloaded(command, imports, cwd=folder)
        about = f"mutation {number}: {[os.fspath(each) for each in command]}\n{done.stdout[-2000:]}\n{done.stderr}"
        assert done.returncode in (0, 1, 2), about
        assert "Traceback" not in done.stdout + done.stderr, about
        assert done.returncode == 0 or 0 < len(done.stderr.splitlines()) <= 20, about
        shutil.rmtree(folder)
