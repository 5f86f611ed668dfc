"""Write the first inputs of the fuzz targets again: python -m tests.fuzz.make_corpus

Inputs whose names begin with `found` were findings once; they stay as they are.
"""

from __future__ import annotations

import gzip
import io
import json
import re
import tarfile
import tempfile
import zipfile
from collections.abc import Mapping
from pathlib import Path

import cv2
import numpy as np
import torch

from tests.looks import upright
from tests.named_models import GOOD
from tests.vm_embedded.live.running import DEMO
from tests.vm_export.checkpoints import checkpoint, peak_checkpoint
from tests.vm_export.looks import look_checkpoint
from tests.vm_train.boxes.written import coco_table, voc_text
from vm_embedded.config.toml_writer import to_commented_toml
from vm_embedded.geometry.lens_files import read_lens_file
from vm_embedded.live.configuration import Configuration
from vm_export.checkpoint import Checkpoint
from vm_export.export import export
from vm_export.look_checkpoint import LookCheckpoint
from vm_export.network_shape import NetworkShape
from vm_train.learning.configuration import TrainConfiguration

from .boxes import joined
from .run import CORPORA

_OPENCV = """%YAML:1.0
---
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 612.25, 0., 318.5, 0., 611.75, 241.25, 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [ 0.1, -0.2, 0., 1e-3, 0. ]
image_width: 640
image_height: 480
"""
_ROS = """image_width: 640
image_height: 480
distortion_model: equidistant
D: [0.01, -0.02, 0.003, 0.0]
K: [500.0, 0.0, 320.0, 0.0, 500.0, 240.0, 0.0, 0.0, 1.0]
"""
_TOML_LENS = (
    '[lens]\nprojection = "rectilinear"\nfocal_length = 448\nfov = 1.75\ncenter = [1, 2.5]\n'
    "distortion = [0.0, 1e-7]\nsize = [320, 240]\n"
)
_VM = (
    'model = "ball"\nfov = "70deg"\n[orientation]\nheight = 0.8\npitch = "20deg"\n[camera]\nsource = "synthetic"\n'
    '[pose]\nsource = "udp:127.0.0.1:5600"\n[status]\npage = "127.0.0.1:8080"\n'
)
_TRAIN = (
    '[classes]\nball = { color = [255, 0, 0], kind = "object" }\n[mesh]\nmodel = "ring6"\n[training]\nepochs = 3\n'
    "[augmentation]\nbrightness = [0.8, 1.2]\n"
)


def main() -> None:
    pose = {"t": 1.0, "height": 0.8, "quaternion": [1, 0, 0, 0]}
    hoc = {"Hoc": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0.8], [0, 0, 0, 1]], "t": 2}
    _write("poses", {"quaternion": _line(pose), "hoc": _line(hoc), "two": _line(pose) + _line(pose | {"t": 1.1})})
    _write("control", {"status": b"status\n", "metrics": b"metrics\n", "record": b"record"})
    _write("web", {f"page{number}": each for number, each in enumerate(_requests())})
    _write("lens", _lenses())
    _write("toml", {"vm": _VM.encode(), "train": _TRAIN.encode(), **_whole_configurations()})
    _write("picture", _pictures())
    _write("mjpeg", _streams())
    _write("checkpoint", _checkpoints())
    _write("model", _models())
    manifest = {"release": "1.0-abc", "machine": "x86_64", "glibc": "2.28", "python": "cp311", "disk_mib": 16}
    sums = "".join(f"{number:064x}  {name}\n" for number, name in enumerate(("README.md", "etc/vm.toml")))
    _write("names", {f"name{number}": each for number, each in enumerate(_names())})
    _write("shards", _shards())
    _write("boxes", {name: joined(files) for name, files in _box_folders().items()})
    _write("bundle", {"manifest": json.dumps(manifest, indent=1).encode() + b"\n", "sums": sums.encode()})


def _write(target: str, inputs: Mapping[str, bytes]) -> None:
    folder = CORPORA / target
    folder.mkdir(parents=True, exist_ok=True)
    for path in folder.iterdir():
        if not path.name.startswith("found"):
            path.unlink()
    for name, content in inputs.items():
        (folder / name).write_bytes(content)


def _line(content: Mapping[str, object]) -> bytes:
    return json.dumps(content).encode() + b"\n"


def _requests() -> list[bytes]:
    host, token = b" HTTP/1.1\r\nHost: 127.0.0.1\r\n", b"X-Token: TOKEN\r\n"
    gets = [b"/", b"/state", b"/map", b"/preview?value=0.3", b"/metrics", b"/stream", b"/other"]
    posts = [b"/threshold?value=0.5", b"/record"]
    return [b"GET " + each + host + b"\r\n" for each in gets] + [
        b"POST " + each + host + more + b"\r\n" for each in posts for more in (token, b"")
    ]


def _names() -> list[bytes]:
    escaped = (
        "\\ud800",
        "\\ud83c\\udfc0",
        "ball\\ncar",
        "a\\u2028b",
        "\\u001b[2J",
        "\\u0000",
        "\\u0085",
        " a",
        "\ufeffa",
    )
    return [each.encode() for each in (*GOOD, *escaped, "", "x" * 101, "a\nb", "$x$")] + [b"\xff", b"\x9b2J"]


def _lenses() -> dict[str, bytes]:
    files = {"reference": (DEMO / "lens0000000.yaml").read_bytes()}
    assert read_lens_file(DEMO / "lens0000000.yaml").orientation is not None
    return files | {"opencv": _OPENCV.encode(), "ros": _ROS.encode(), "toml": _TOML_LENS.encode()}


def _whole_configurations() -> dict[str, bytes]:
    """All entries of both configurations, without their comments."""
    texts = {"all_vm": to_commented_toml(Configuration()), "all_train": to_commented_toml(TrainConfiguration())}
    return {name: re.sub(r"(?m)^#.*\n", "", text).encode() for name, text in texts.items()}


def _shards() -> dict[str, bytes]:
    """Archives of one picture, with each kind of header that names or sizes may have."""
    random = np.random.default_rng(1)
    image, mask = (random.integers(0, 256, (6, 8, channels), dtype=np.uint8) for channels in (3, 4))
    lens = (DEMO / "lens0000000.yaml").read_bytes()
    parts = {".jpg": image, ".mask.png": mask}
    files = {suffix: cv2.imencode(suffix[-4:], each)[1].tobytes() for suffix, each in parts.items()} | {
        ".lens.yaml": lens
    }
    sparse = {"GNU.sparse.major": "1", "GNU.sparse.minor": "0", "GNU.sparse.realsize": "200000000000"}
    made = {
        "ustar": _tar(files, tarfile.USTAR_FORMAT, "0"),
        "pax": _tar(files, tarfile.PAX_FORMAT, "p" * 120, {"mtime": "1.5"}),
        "gnu": _tar(files, tarfile.GNU_FORMAT, "g" * 120),
        "sparse": _tar({".jpg": b"1\n0\n512\n".ljust(512, b"\0") + bytes(512)}, tarfile.PAX_FORMAT, "0", sparse),
        "sparse_map": _tar(
            {".jpg": bytes(8)}, tarfile.PAX_FORMAT, "0", {"GNU.sparse.map": "0,8", "GNU.sparse.size": "8"}
        ),
    }
    return made | {"zipped": gzip.compress(made["ustar"], mtime=0)}


def _tar(files: Mapping[str, bytes], kind: int, number: str, headers: Mapping[str, str] | None = None) -> bytes:
    """An archive of files by suffix, with the end that it must have and no more."""
    packed = io.BytesIO()
    with tarfile.open(fileobj=packed, mode="w", format=kind) as tar:
        for suffix, content in files.items():
            entry = tarfile.TarInfo(f"a/{number}{suffix}")
            entry.size, entry.pax_headers = len(content), dict(headers or {})
            tar.addfile(entry, io.BytesIO(content))
        end = tar.offset
    return packed.getvalue()[: end + 1024]


def _box_folders() -> dict[str, dict[str, bytes]]:
    size = (16, 12)
    boxes = [("ball", 2.0, 3.0, 6.0, 7.0), ("goal", 1.0, 1.0, 4.0, 9.0)]
    labels = b"0 0.25 0.4 0.25 0.3\n1 0.2 0.4 0.2 0.6 0.9\n"
    candidate = {"image": "a.jpg", "class": "ball", "box": [0.7, 0.7, 0.2, 0.2], "confidence": 0.2, "found": False}
    answer = {"crop": "a.jpg ball", "answer": "yes", "image": "a.jpg", "class": "ball", "box": [0.7, 0.7, 0.2, 0.2]}
    coco = coco_table({"a": boxes}, size)
    turned = cv2.imencode(".jpg", np.zeros((12, 16, 3), np.uint8))[1].tobytes()
    exif = b"Exif\0\0II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0\0\0\0\0"
    turned = turned[:2] + b"\xff\xe1" + (len(exif) + 2).to_bytes(2, "big") + exif + turned[2:]
    return {
        "yolo": {"classes.txt": b"ball\ngoal\n", "a.txt": labels},
        "yolo_yaml": {"data.yaml": b"nc: 2\nnames: [ball, goal]\n", "a.txt": labels},
        "voc": {"a.xml": voc_text("a.jpg", boxes, size).encode()},
        "coco": {"all.json": json.dumps(coco).encode()},
        "turned": {"a.jpg": turned, "a.xml": voc_text("a.jpg", boxes, size).encode()},
        "label": {
            "a.txt": labels,
            "candidates.jsonl": json.dumps(candidate).encode() + b"\n",
            "answers.jsonl": json.dumps(answer).encode() + b"\n",
            "lensa.yaml": _TOML_LENS.encode(),
        },
    }


def _pictures() -> dict[str, bytes]:
    picture = np.random.default_rng(1).integers(0, 256, (6, 8, 3), dtype=np.uint8)
    files = {
        kind: cv2.imencode(f".{kind}", picture)[1].tobytes() for kind in ("jpg", "png", "bmp", "ppm", "webp", "tif")
    }
    files["progressive"] = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_PROGRESSIVE, 1])[1].tobytes()
    files["deep"] = cv2.imencode(".png", picture.astype(np.uint16) << 8)[1].tobytes()
    return files


def _streams() -> dict[str, bytes]:
    picture = np.random.default_rng(1).integers(0, 256, (6, 8, 3), dtype=np.uint8)
    jpeg, gray = (cv2.imencode(".jpg", each)[1].tobytes() for each in (picture, picture[..., 0]))
    progressive = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_PROGRESSIVE, 1])[1].tobytes()
    head = b"HTTP/1.1 200 OK\r\nContent-Type: multipart/x-mixed-replace; boundary=frame\r\n"
    sized = b"".join(
        b"--frame\r\nContent-Type: image/jpeg\r\nX-Timestamp: %d.5\r\nContent-Length: %d\r\n\r\n%s\r\n"
        % (at, len(each), each)
        for at, each in enumerate((jpeg, gray))
    )
    ended = b"".join(b"--frame\r\n\r\n" + each + b"\r\n" for each in (jpeg, progressive)) + b"--frame--\r\n"
    chunked = b"".join(b"%x\r\n%s\r\n" % (len(each), each) for each in (sized[:100], sized[100:])) + b"0\r\n\r\n"
    return {
        "sized": head + b"\r\n" + sized,
        "ended": head + b"\r\n" + ended,
        "chunked": head + b"Transfer-Encoding: chunked\r\n\r\n" + chunked,
        "png": head + b"\r\n--frame\r\n\r\n" + cv2.imencode(".png", picture)[1].tobytes() + b"\r\n--frame\r\n",
        "page": b"HTTP/1.1 401 Unauthorized\r\nContent-Length: 2\r\n\r\nno",
    }


def _small() -> Checkpoint:
    return checkpoint(shape=NetworkShape.uniform(2, 2, 2, neighbors=6))


def _look() -> LookCheckpoint:
    return look_checkpoint(classes=("ball", upright("goal")))


def _saved(kind: str) -> bytes:
    """A checkpoint's file. torch aligns each tensor to 64 bytes, so that even small networks take kilobytes."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.pt"
        (_small() if kind == "mesh" else _look()).save(path)
        return path.read_bytes()


def _checkpoints() -> dict[str, bytes]:
    files = {}
    for kind in ("mesh", "look"):
        whole = _saved(kind)
        with zipfile.ZipFile(io.BytesIO(whole)) as packed:
            (name,) = [each for each in packed.namelist() if each.endswith("data.pkl")]
            files[f"{kind}_pickle"] = packed.read(name)
        if kind == "mesh":
            files[kind] = whole
    return files


def _models() -> dict[str, bytes]:
    made = {}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.onnx"
        export(_small(), path)
        made["graph"] = path.read_bytes()
        export(peak_checkpoint(classes=("ball", "goal:upright")), path, _look())
        made["look"] = path.read_bytes()
    return made


if __name__ == "__main__":
    torch.manual_seed(0)
    main()
