"""Folders of training pictures: what is read, and every fault by name."""

import pickle
import struct
import zlib

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.manifests import ball_manifest
from vm_embedded import Orientation
from vm_embedded.errors import InputError
from vm_embedded.geometry.lens_files import format_lens_file
from vm_embedded.geometry.radial_lenses import Equisolid
from vm_train.data.classes import UNLABELED, Classes
from vm_train.data.picture_files import PictureFault
from vm_train.data.pictures import find_pictures, read_picture
from vm_train.graphs.labeled_graph import graph_of

CLASSES = Classes({"ball": ((255, 0, 0),), "field": ((0, 255, 0), (255, 255, 255)), "environment": ((0, 0, 0),)})
MANIFEST = ball_manifest("ball", "field", "environment", max_distance=6.0)
LENS = Equisolid(focal_length=90.0, fov=2.8)
LOOKING_DOWN = Orientation.from_roll_pitch(0.8, 0.1, 0.5)


NUMBERS = ("0000001", "0000002")


def write_pictures(folder, numbers=NUMBERS):
    """Good pictures of 160 x 120: a green field, a red ball, black above, the lower rows unlabeled."""
    for number in numbers:
        mask = np.zeros((120, 160, 4), dtype=np.uint8)
        mask[..., 3] = 255
        mask[40:, :, 1] = 255
        mask[60:80, 70:90] = (0, 0, 255, 255)
        mask[110:] = 0
        cv2.imwrite(str(folder / f"mask{number}.png"), mask)
        cv2.imwrite(str(folder / f"image{number}.jpg"), mask[..., :3])
        (folder / f"lens{number}.yaml").write_text(format_lens_file(LENS, LOOKING_DOWN))


def cut(path, share=0.6):
    """Keep only the first part of a file."""
    path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])


def enlarge(folder):
    """Let the image declare 65500 x 16000 px."""
    path = folder / "image0000001.jpg"
    content = bytearray(path.read_bytes())
    at = content.index(b"\xff\xc0") + 5
    content[at : at + 4] = struct.pack(">HH", 16000, 65500)
    path.write_bytes(content)


def picture_file(folder, name, picture):
    assert cv2.imwrite(str(folder / name), np.asarray(picture))


def lens_file(folder, text):
    (folder / "lens0000001.yaml").write_text(text)


FAULTS = {
    "no mask": ("missing", "mask0000001.png: is missing", lambda f: (f / "mask0000001.png").unlink()),
    "no lens": ("missing", "lens0000001.yaml: is missing", lambda f: (f / "lens0000001.yaml").unlink()),
    "no JPEG": (
        "damaged",
        "image0000001.jpg: can't be decoded as an image",
        lambda f: (f / "image0000001.jpg").write_bytes(b"no picture"),
    ),
    "empty": ("damaged", "image0000001.jpg: can't be decoded", lambda f: (f / "image0000001.jpg").write_bytes(b"")),
    "cut JPEG": ("damaged", "image0000001.jpg: is cut short", lambda f: cut(f / "image0000001.jpg")),
    "attack 4: cut JPEG with an end": (
        "damaged",
        "image0000001.jpg: is cut short or damaged",
        lambda f: cut(f / "image0000001.jpg") or (f / "image0000001.jpg").open("ab").write(b"\xff\xd9"),
    ),
    "attack 2: huge JPEG": ("damaged", "image0000001.jpg: has 65500 x 16000 px, 1048 Mpx", lambda f: enlarge(f)),
    "cut PNG": ("damaged", "mask0000001.png: is cut short", lambda f: cut(f / "mask0000001.png")),
    "other size": (
        "size",
        "mask0000001.png: 80 x 60 px, but the image is 160 x 120 px",
        lambda f: picture_file(f, "mask0000001.png", np.zeros((60, 80, 4), np.uint8)),
    ),
    "gray mask": (
        "color",
        "a mask must have 3 or 4 channels of 8 bits, not 1 channel of 8 bits",
        lambda f: picture_file(f, "mask0000001.png", np.zeros((120, 160), np.uint8)),
    ),
    "deep mask": (
        "color",
        "not 3 channels of 16 bits",
        lambda f: picture_file(f, "mask0000001.png", np.zeros((120, 160, 3), np.uint16)),
    ),
    "unknown color": (
        "color",
        "19200 pixels of the mask have colors that belong to no class: [250, 7, 7]; the nearest is [255, 0, 0] of ball",
        lambda f: picture_file(f, "mask0000001.png", np.full((120, 160, 3), (7, 7, 250), np.uint8)),
    ),
    "typo in a key": (
        "lens",
        "lens0000001.yaml: unknown lens key 'focal_lenght'; did you mean 'focal_length'?",
        lambda f: lens_file(f, "projection: EQUISOLID\nfocal_lenght: 9\nfov: 1\n"),
    ),
    "typo in a value": (
        "lens",
        "did you mean 'equisolid'",
        lambda f: lens_file(f, "projection: EQUISOLDI\nfocal_length: 9\nfov: 1\n"),
    ),
    "no Hoc": (
        "lens",
        "lens0000001.yaml: lacks Hoc",
        lambda f: lens_file(f, "projection: EQUISOLID\nfocal_length: 9\nfov: 1\n"),
    ),
    "lens of another camera": (
        "lens",
        "lens0000001.yaml: lens is for 640 x 100 px",
        lambda f: lens_file(f, format_lens_file(LENS, LOOKING_DOWN) + "size: [640, 100]\n"),
    ),
    "lens no text": (
        "lens",
        "lens0000001.yaml: is not UTF-8 text",
        lambda f: (f / "lens0000001.yaml").write_bytes(b"\xff\xfe\x00"),
    ),
}
"""Kind, text and making of all that can be wrong with the files of picture 0000001."""


@pytest.fixture
def folder(tmp_path):
    write_pictures(tmp_path)
    return tmp_path


def test_pictures_are_found_by_number_and_read(folder):
    first, second = find_pictures(folder)
    assert (first.number, second.number) == ("0000001", "0000002")
    picture = read_picture(first, CLASSES)
    assert picture.labels[70, 80] == 0
    assert picture.labels[50, 10] == 1
    assert picture.labels[10, 10] == 2
    assert picture.labels[115, 10] == UNLABELED


@pytest.mark.parametrize(("kind", "said", "damage"), FAULTS.values(), ids=FAULTS)
def test_each_fault_is_named(kind, said, damage, folder):
    damage(folder)
    first, second = find_pictures(folder)
    with pytest.raises(PictureFault) as caught:
        read_picture(first, CLASSES)
    assert said in str(caught.value)
    assert str(folder) not in str(caught.value)
    assert caught.value.kind == kind
    read_picture(second, CLASSES)


def test_faults_travel_between_processes():
    error = pickle.loads(pickle.dumps(PictureFault("mask1.png: is missing", "missing")))
    assert (str(error), error.kind) == ("mask1.png: is missing", "missing")


def test_masks_may_be_opaque_or_have_a_palette(folder):
    files, _ = find_pictures(folder)
    colors = np.uint8([(255, 0, 0), (0, 255, 0), (0, 0, 0)])
    positions = np.repeat(np.arange(120)[:, None] // 40, 160, axis=1)
    picture_file(folder, "mask0000001.png", colors[positions][..., ::-1])
    plain = read_picture(files, CLASSES).labels
    assert (plain == positions).all()
    files.mask.write_bytes(palette_png(positions.astype(np.uint8), colors))
    assert (read_picture(files, CLASSES).labels == positions).all()


def palette_png(positions, colors):
    """A PNG file that has positions (h, w) in a palette."""

    def chunk(name, data):
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    height, width = positions.shape
    header = struct.pack(">IIBBBBB", width, height, 8, 3, 0, 0, 0)
    rows = b"".join(b"\0" + row.tobytes() for row in positions)
    chunks = ((b"IHDR", header), (b"PLTE", colors.tobytes()), (b"IDAT", zlib.compress(rows)), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunk(*each) for each in chunks)


@given(st.integers(1, 200), st.integers(1, 9), st.integers(0, 2**32 - 1))
def test_labels_are_those_of_each_pixel_by_itself(height, width, seed):
    random = np.random.default_rng(seed)
    known = [(color, number) for number, colors in enumerate(CLASSES.colors.values()) for color in colors]
    chosen, alpha = random.integers(len(known), size=(height, width)), random.choice([0, 1, 255], size=(height, width))
    mask = np.dstack([np.array([color[::-1] for color, _ in known])[chosen], alpha]).astype(np.uint8)
    wanted = np.where(alpha > 0, np.array([number for _, number in known])[chosen], UNLABELED)
    assert (CLASSES.labels(mask) == wanted).all()


def test_the_turn_that_a_camera_notes_is_made_and_the_mask_belongs_to_the_turned_picture(folder):
    turned = b"Exif\0\0II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0\0\0\0\0"
    path = folder / "image0000001.jpg"
    data = path.read_bytes()
    path.write_bytes(data[:2] + b"\xff\xe1" + struct.pack(">H", len(turned) + 2) + turned + data[2:])
    with pytest.raises(PictureFault, match="160 x 120 px, but the image is 120 x 160 px"):
        read_picture(find_pictures(folder)[0], CLASSES)
    mask = folder / "mask0000001.png"
    stored = cv2.imread(str(mask), cv2.IMREAD_UNCHANGED)
    cv2.imwrite(str(mask), cv2.rotate(stored, cv2.ROTATE_90_CLOCKWISE))
    picture = read_picture(find_pictures(folder)[0], CLASSES)
    np.testing.assert_array_equal(picture.image, cv2.imread(str(path)))
    assert picture.labels.shape == (160, 120)


def test_suffixes_may_be_in_capitals(folder):
    for name in ("image0000001.jpg", "mask0000001.png", "lens0000001.yaml"):
        (folder / name).rename(folder / f"{name.partition('.')[0]}.{name.partition('.')[2].upper()}")
    first, _ = find_pictures(folder)
    assert first.image.name == "image0000001.JPG"
    read_picture(first, CLASSES)


def test_two_images_of_one_number_are_refused(folder):
    (folder / "image0000001.png").write_bytes(b"")
    with pytest.raises(InputError, match=r"has image0000001\.jpg and image0000001\.png"):
        find_pictures(folder)


def test_folders_without_pictures_are_refused(tmp_path):
    with pytest.raises(InputError, match="no pictures"):
        find_pictures(tmp_path)
    (tmp_path / "image1.bmp").touch()
    with pytest.raises(InputError, match="files in it have another suffix"):
        find_pictures(tmp_path)
    with pytest.raises(InputError, match="no folder"):
        find_pictures(tmp_path / "nowhere")


def test_classes_that_share_a_color_or_stand_alone_are_refused():
    with pytest.raises(InputError, match="share the color"):
        Classes({"a": ((1, 2, 3),), "b": ((1, 2, 3),)})
    with pytest.raises(InputError, match="two classes"):
        Classes({"a": ((1, 2, 3),)})


def test_a_graph_shows_the_picture_at_the_meshs_pixels(folder):
    picture = read_picture(find_pictures(folder)[0], CLASSES)
    graph = graph_of(picture, MANIFEST)
    n = len(graph)
    assert graph.points.shape == (n + 1, 3)
    assert graph.neighbors.shape == (n + 1, 6)
    assert (graph.points[-1] == -1.0).all()
    assert (graph.neighbors[-1] == n).all()
    assert set(np.unique(graph.labels)) == {UNLABELED, 0, 1, 2}
    red = graph.points[:-1][graph.labels == 0].mean(axis=0)
    assert red[0] > 0.8 > 0.3 > max(red[1:])
    assert (graph.distances < 6.5).all()
