"""Programs as a user types them, on files whose names are not UTF-8, or mean something else to a library."""

import json
import os
import shutil
import subprocess
from functools import partial
from unicodedata import normalize

import cv2
import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from tests.drawn_scenes import FOLDER, IMAGES, MODEL
from tests.programs import BIN, run_program
from tests.vm_train.boxes.written import WRITERS
from vm_embedded.cameras.open_camera import is_live
from vm_embedded.errors import InputError
from vm_embedded.files import read_text
from vm_label.box_folder import read_box_folder
from vm_train.boxes.read import read_boxes

LENS = FOLDER / f"lens{IMAGES[0].stem.removeprefix('image')}.yaml"


def run(program, *arguments, code=0, cwd, **more):
    """Run a program with arguments in bytes, text or paths, and return what it printed as text."""
    command = [os.fsencode(each) for each in (BIN / program, *arguments)]
    done = subprocess.run(command, cwd=os.fsencode(cwd), capture_output=True, timeout=300, check=False, **more)
    assert done.returncode == code, (done.returncode, done.stderr)
    assert b"Traceback" not in done.stderr
    return done.stdout.decode()


def detect(*arguments, **more):
    return run("vm-detect", "--model", MODEL, *arguments, **more)


def lines(text):
    """The lines of JSON; no text in them may be half a character."""
    found = [json.loads(line) for line in text.splitlines()]
    json.dumps(found, ensure_ascii=False).encode()
    return found


def film(path, folder, count=4):
    """Write a film of the first drawn frame, in a folder whose name OpenCV takes, and move it to its path."""
    plain = folder / "plain.avi"
    writer = cv2.VideoWriter(str(plain), cv2.VideoWriter.fourcc(*"MJPG"), 10.0, (640, 512))
    image = cv2.imread(str(IMAGES[0]))
    for index in range(count):
        image[:64, :64] = np.random.default_rng(index).integers(0, 256, (64, 64, 3))
        writer.write(image)
    writer.release()
    plain.rename(path)


def named(folder, name):
    """The path of a name in bytes."""
    return folder / os.fsdecode(name)


@pytest.fixture
def frames(tmp_path):
    """A folder t?r with a drawn frame and its lens, whose names have a byte that is not UTF-8."""
    folder = named(tmp_path, b"t\xfcr")
    folder.mkdir()
    shutil.copy(IMAGES[0], named(folder, b"image_b\xe4ll.jpg"))
    shutil.copy(LENS, named(folder, b"lens_b\xe4ll.yaml"))
    return folder


def test_an_image_of_any_name_gives_a_line_with_its_name_escaped(tmp_path, frames):
    for name, shown in ((b"b\xe4ll.jpg", "b\\udce4ll.jpg"), ("at 9.41\u202fAM.jpg".encode(), "at 9.41\u202fAM.jpg")):
        shutil.copy(IMAGES[0], named(tmp_path, name))
        shutil.copy(LENS, named(tmp_path, b"l\xe4ns.yaml"))
        (line,) = lines(detect(name, "--lens", b"l\xe4ns.yaml", cwd=tmp_path))
        assert line["source"] == shown
        assert line["detections"]


@pytest.mark.long
def test_every_file_that_is_saved_has_the_name_that_was_given(tmp_path, frames):
    saved = {
        "--save-overlay": b"o\xe4",
        "--save-points": b"p\xe4",
        "--save-boxes": b"b\xe4",
        "--save-mcap": b"m\xe4.mcap",
    }
    saved["--save-video"] = b"v\xe4.mp4"
    detect(b"t\xfcr", *(each for pair in saved.items() for each in pair), cwd=tmp_path)
    assert {os.fsencode(each.name) for each in tmp_path.iterdir()} == {b"t\xfcr", *saved.values()}
    for name in (
        b"o\xe4/image_b\xe4ll.jpg",
        b"p\xe4/image_b\xe4ll.npz",
        b"b\xe4/image_b\xe4ll.jpg",
        b"b\xe4/image_b\xe4ll.txt",
    ):
        assert named(tmp_path, name).stat().st_size, name
    (line,) = lines(detect(b"v\xe4.mp4", "--lens", LENS, cwd=tmp_path))
    assert line["source"] == "v\\udce4.mp4"
    with AnyReader([named(tmp_path, b"m\xe4.mcap")]) as reader:
        states = [each for each in reader.messages() if each[0].topic == "/diagnostics"]
        state = reader.deserialize(states[0][2], states[0][0].msgtype).status[0]
    assert state.hardware_id == "image_b\\udce4ll.jpg"


def test_a_film_is_read_as_a_whole_from_a_folder_of_any_name(tmp_path, frames):
    film(named(frames, b"-f\xef%d:lm.avi"), tmp_path)
    command = ("--lens", LENS, "--save-video=-o.webm", "--", b"-f\xef%d:lm.avi")
    assert len(lines(detect(*command, cwd=frames))) == 4
    assert (frames / "-o.webm").stat().st_size


@pytest.mark.long
def test_a_file_is_never_taken_for_a_sequence_of_images(tmp_path):
    for name in ("s%d.jp2", "s1.jp2", "s2.jp2", "s3.jp2"):
        cv2.imwrite(str(tmp_path / name), cv2.imread(str(IMAGES[0])))
    assert len(lines(detect("s%d.jp2", "--lens", LENS, cwd=tmp_path))) == 1


@pytest.mark.long
def test_a_terminal_of_ascii_gets_escapes(tmp_path):
    shutil.copy(IMAGES[0], tmp_path / "Bälle.jpg")
    for more in ({"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}, {"PYTHONIOENCODING": "ascii"}):
        for name in ("Bälle.jpg".encode(), b"none\xe4.jpg"):
            found = name.startswith(b"B")
            printed = detect(name, "--lens", LENS, cwd=tmp_path, code=0 if found else 1, env=os.environ | more)
            assert len(lines(printed)) == found


@pytest.mark.parametrize(
    "address",
    [b"rtsp://127.0.0.1:1/b\xe4ll", b"http://127.0.0.1:1/b\xe4ll", b"http://u\xe4@127.0.0.1:1/", b"gstreamer:b\xe4ll"],
)
def test_an_address_that_is_not_utf_8_is_an_error_of_the_configuration(tmp_path, address):
    detect("--camera", address, "--lens", LENS, cwd=tmp_path, code=78)


@pytest.mark.long
def test_a_daemon_plays_files_of_any_name_and_writes_to_files_of_any_name(tmp_path):
    film(named(tmp_path, b"f\xeflm.avi"), tmp_path, 8)
    options = (
        "--no-output-stdout",
        "--output-file",
        b"l\xefnes",
        "--output-unix",
        b"s\xf6cket",
        "--recorder-folder",
        b"r\xebc",
    )
    detect("--live", b"f\xeflm.avi", "--lens", LENS, "--height", "0.8", *options, cwd=tmp_path)
    assert any(each.get("type") == "frame" for each in lines(named(tmp_path, b"l\xefnes").read_text()))


def test_a_configuration_is_not_printed_with_another_name(tmp_path):
    shutil.copy(LENS, named(tmp_path, b"l\xe4ns.yaml"))
    assert detect("--print-config", "--lens", b"l\xe4ns.yaml", cwd=tmp_path, code=1) == ""


@pytest.mark.long
def test_vm_doctor_shows_a_name_escaped(tmp_path, frames):
    found = lines(run("vm-doctor", "--model", MODEL, "--camera", b"t\xfcr", "--json", cwd=tmp_path))
    assert any("t\\udcfcr" in each["seen"] for each in found)


@pytest.mark.long
def test_vm_calibrate_reads_a_film_of_any_name(tmp_path):
    film(named(tmp_path, b"f\xeflm.avi"), tmp_path)
    printed = run("vm-calibrate", "lens", b"f\xeflm.avi", "--board", "9x6", "-o", b"l\xe4ns.yaml", cwd=tmp_path, code=1)
    assert printed == ""  # the film shows no board


@pytest.fixture
def boxes(tmp_path):
    """A folder with a folder b? of boxes of the drawn frames, whose names are not UTF-8."""
    folder = tmp_path / "frames"
    folder.mkdir()
    for index, image in enumerate(IMAGES):
        lens = image.with_name(f"lens{image.stem.removeprefix('image')}.yaml")
        shutil.copy(image, named(folder, b"image_b\xe4%d.jpg" % index))
        shutil.copy(lens, named(folder, b"lens_b\xe4%d.yaml" % index))
    detect(folder, "--save-boxes", b"b\xe4", cwd=tmp_path)
    return tmp_path


@pytest.mark.long
def test_boxes_of_any_name_become_pictures_and_a_report(boxes):
    checked = ("--json", b"j\xe4.json", "--sheet", b"s\xe4.png")
    run("vm-train", "check", b"b\xe4", "--boxes", "--no-look", *checked, cwd=boxes)
    (summary,) = lines(named(boxes, b"j\xe4.json").read_text().replace("\n", ""))
    assert any("b\\udce4" in each for each in summary["recordings"])
    run("vm-train", "import-boxes", b"b\xe4", b"d\xe4", cwd=boxes)
    subprocess.run(["tar", "-cf", b"t\xe4.tar", b"d\xe4"], cwd=boxes, check=True)
    run("vm-train", "import", b"t\xe4.tar", b"i\xe4", cwd=boxes)
    run("vm-train", "check", b"i\xe4", cwd=boxes)
    run("vm-evaluate", MODEL, b"d\xe4", "-o", b"e\xe4", cwd=boxes)
    (scores,) = lines(named(boxes, b"e\xe4/scores.json").read_text().replace("\n", ""))
    assert scores["objects"]


@pytest.mark.long
def test_a_training_in_a_folder_of_any_name_ends_and_its_network_is_exported(boxes):
    run("vm-train", "import-boxes", b"b\xe4", b"d\xe4", cwd=boxes)
    split = ("--set", "data.validation=0.7", "--set", "data.test=0.0")
    run("vm-train", b"d\xe4", "-o", b"r\xfcn", "--set", "training.epochs=1", *split, "--threads", "1", cwd=boxes)
    assert list(named(boxes, b"r\xfcn/tensorboard/round1").iterdir())
    run("vm-train", "resume", b"r\xfcn", cwd=boxes)
    run("vm-export", b"r\xfcn/model.pt", "-o", b"m\xfc.onnx", cwd=boxes)
    lines(run("vm-detect", "--model", b"m\xfc.onnx", IMAGES[0], "--lens", LENS, cwd=boxes))


def test_files_whose_names_have_colons_are_files(tmp_path):
    prefixes = ("synthetic", "gstreamer", "ros", "http", "12:30", "udp")
    names = [f"{prefix}:05.avi" for prefix in prefixes]
    for name in names:
        film(tmp_path / name, tmp_path, 1)
    found = lines(run_program("vm-detect", *names, "--model", MODEL, "--lens", LENS, cwd=tmp_path).stdout)
    assert [each["source"] for each in found] == names
    for name in names[:2]:
        assert is_live(name)
        assert not is_live(str(tmp_path / name))


@pytest.mark.long
def test_a_path_that_looks_like_an_address_is_a_path(tmp_path):
    (tmp_path / "http:/b").mkdir(parents=True)
    film(tmp_path / "http:/b/film.avi", tmp_path)
    (tmp_path / "synthetic:fast").mkdir()
    shutil.copy(IMAGES[0], tmp_path / "synthetic:fast")
    shutil.copy(LENS, tmp_path / "tcp:lens.yaml")
    given = ("--model", MODEL, "--lens", "tcp:lens.yaml")
    run = partial(run_program, "vm-detect", cwd=tmp_path)
    assert len(lines(run("--camera", "synthetic:fast", *given).stdout)) == 1
    live = lines(run("--live", "http://b/film.avi", *given).stdout)
    assert any(each.get("type") == "frame" for each in live)
    saved = ("--save-boxes", "udp:boxes", "--save-video", "rtsp:o.mp4", "--save-overlay", "a://drawn")
    assert len(lines(run("http://b/film.avi", *given, *saved).stdout)) == 4
    assert all((tmp_path / each).stat().st_size for each in ("udp:boxes/classes.txt", "rtsp:o.mp4", "a:/drawn"))


FORMS = [("NFC", "NFD"), ("NFD", "NFC")]
CAFE = "Café Ångström 한글"


@pytest.mark.long
@pytest.mark.parametrize(("written", "typed"), FORMS)
def test_a_name_in_another_unicode_form_is_the_same_name(written, typed, tmp_path):
    there, here = (normalize(each, CAFE) for each in (written, typed))
    assert there != here
    folder = tmp_path / there
    folder.mkdir()
    shutil.copy(IMAGES[0], folder / f"image{there}.jpg")
    shutil.copy(LENS, folder / f"lens{here}.yaml")
    shutil.copy(MODEL, folder / f"{there}.onnx")
    film(folder / f"{there}.avi", tmp_path)
    (folder / f"{there}.toml").write_text("[detector]\nthreads = 1\n")
    given = ("--lens", f"{here}/lens{there}.yaml", "--config", f"{here}/{here}.toml", "--model", f"{here}/{here}.onnx")
    run = partial(run_program, cwd=tmp_path)
    assert len(lines(run("vm-detect", f"{here}/image{here}.jpg", f"{here}/{here}.avi", *given).stdout)) == 5
    assert lines(run("vm-detect", "--live", f"{here}/{here}.avi", *given).stdout)
    # Without --lens, the lens file beside the image counts.
    assert len(lines(run("vm-detect", here, "--model", MODEL, "--save-boxes", f"{here}/boxes").stdout)) == 1
    assert [each.name for each in tmp_path.iterdir() if each.is_dir()] == [there]
    run("vm-calibrate", "lens", f"{here}/{here}.avi", "--board", "9x6", "-o", "lens.yaml", code=1)


@pytest.mark.parametrize(("written", "typed"), FORMS)
def test_annotations_whose_names_are_in_another_unicode_form_belong_to_their_images(written, typed, tmp_path):
    there, here = (normalize(each, CAFE) for each in (written, typed))
    for format, write in WRITERS.items():
        folder = tmp_path / format
        write(folder, {"a": [("ball", 20.0, 30.0, 40.0, 50.0)]}, beside=False)
        for path in [each for each in folder.rglob("*") if each.stem == "a"]:
            path.rename(path.with_name(f"{there if path.suffix == '.jpg' else here}{path.suffix}"))
        for path in folder.rglob("*.json"):
            path.write_text(path.read_text().replace("a.jpg", f"{here}.jpg"))
        found = read_boxes(tmp_path / format)
        assert found.faults == ()
        assert len(found.pictures[0].boxes) == 1
        path = next(each for each in folder.rglob("*.jpg"))
        (path.parent / f"{here}.yaml").write_text("projection: RECTILINEAR\nfocal_length: 120.0\nfov: 1.5\n")
        assert read_boxes(folder).pictures[0].lens is not None
    assert read_box_folder(tmp_path / "yolo").crops


def test_of_two_names_in_different_unicode_forms_each_is_itself(tmp_path):
    paths = [tmp_path / normalize(form, CAFE) for form in ("NFC", "NFD")]
    for path in paths:
        path.write_text(repr(path))
    assert [read_text(path) for path in paths] == list(map(repr, paths))
    paths[0].unlink()
    assert read_text(paths[0]) == repr(paths[1])
    paths[1].unlink()
    with pytest.raises(InputError, match="No such file"):
        read_text(paths[0])
    paths[0].write_text("new")  # the folder was changed since it was listed
    assert read_text(paths[1]) == "new"
