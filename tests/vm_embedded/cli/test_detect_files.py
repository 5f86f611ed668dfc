"""vm-detect on images and videos, and what goes wrong with them."""

import json
import math
import os
import shutil
import subprocess
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.drawn_scenes import FOLDER, IMAGES, MODEL, TRUTH
from tests.folders import contents
from tests.programs import heed_permissions, limit_files
from vm_embedded.errors import InputError
from vm_embedded.output.video_file import VideoFile

from .commands import COMMAND, detect, lines, one_complaint, run

DEMO = Path(__file__).parents[2] / "fixtures" / "demo" / "image0000002.jpg"
STAGES = ["mesh", "project", "sample", "infer", "cluster", "field", "total"]


def film(path, count, rate=10.0):
    """Write a film of the first drawn frame, with noise in a corner, so that no frame equals the one before."""
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), rate, (640, 512))
    image = cv2.imread(str(IMAGES[0]))
    for index in range(count):
        image[:128, :128] = np.random.default_rng(index).integers(0, 256, (128, 128, 3))
        writer.write(image)
    writer.release()
    return path


def test_the_balls_of_the_drawn_frames_are_found():
    truth = json.loads(TRUTH.read_text())
    false = 0
    for line in lines(detect(FOLDER)):
        ball = truth[line["source"]]
        hits = [
            each
            for each in line["detections"]
            if np.hypot(*(np.array(each["center"]) - ball["center"])) < each["radius"]
        ]
        assert len(hits) == 1, line["source"]
        assert hits[0]["distance"] == pytest.approx(ball["distance"], rel=0.05)
        np.testing.assert_allclose(hits[0]["position"], ball["position"], atol=0.05 * ball["distance"] + 0.01)
        false += len(line["detections"]) - 1
    assert false <= 1


def test_a_line_has_what_the_documentation_says():
    (line,) = lines(detect(IMAGES[0]))
    assert list(line) == ["frame", "source", "stamp", "points", "detections", "field", "pose", "timing_ms"]
    assert line["frame"] == 0
    assert line["source"] == IMAGES[0].name
    assert line["stamp"] is None
    assert line["points"] > 100
    assert list(line["timing_ms"]) == STAGES
    ball = line["detections"][0]
    assert list(ball) == [
        *("class", "confidence", "center", "radius", "bearing", "position", "distance"),
        *("angular_radius", "distance_by_angle", "distances_agree", "points"),
    ]
    assert np.linalg.norm(ball["bearing"]) == pytest.approx(1.0, abs=1e-4)


def test_directory_glob_and_image_agree(folder):
    by_directory = lines(detect(folder))
    by_glob = lines(detect(folder / "image*.jpg"))
    assert [line["frame"] for line in by_directory] == [0, 1]
    for a, b in zip(by_directory, by_glob, strict=True):
        assert a["detections"] == b["detections"]
    assert lines(detect(folder / IMAGES[1].name))[0]["detections"] == by_directory[1]["detections"]


@pytest.mark.parametrize(
    "command",
    ["--camera image*.jpg", "image*.jpg", "--threads 1 image*.jpg", "image*0.jpg --threads 1 image*1.jpg"],
)
def test_unquoted_globs_and_files_without_an_option_agree_with_the_folder(command, folder):
    """As a shell passes them on."""
    shell = f"{COMMAND} --model {MODEL} {command}"
    done = subprocess.run(shell, shell=True, cwd=folder, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    found, expected = lines(done), lines(detect(folder))
    assert [line["frame"] for line in found] == [0, 1]
    assert [line["detections"] for line in found] == [line["detections"] for line in expected]


def test_a_folder_and_a_file_are_processed_one_after_the_other(folder):
    found = lines(run(folder, folder / IMAGES[0].name, "--model", MODEL))
    assert [line["frame"] for line in found] == [0, 1, 2]
    assert found[0]["detections"] == found[2]["detections"]


def test_the_name_of_a_file_may_begin_with_a_dash(folder):
    dashed = (folder / IMAGES[0].name).rename(folder / f"-{IMAGES[0].name}").name
    done = run(*("--fov", "70deg", IMAGES[1].name, "--height", "0.6", "--model", MODEL, "--", dashed), cwd=folder)
    assert {each["source"] for each in lines(done)} == {IMAGES[1].name, dashed}


def test_of_several_sources_none_may_be_live():
    one_complaint(run("synthetic", IMAGES[0], code=1), "only one live camera")


@pytest.mark.long
def test_live_plays_the_images_of_a_pattern_in_their_order(tmp_path):
    for number, image in enumerate((IMAGES[0], IMAGES[1], IMAGES[0])):
        shutil.copy(image, tmp_path / f"image{10**number}.jpg")
        shutil.copy(beside(image), tmp_path / f"lens{10**number}.yaml")
    options = ("--model", MODEL, "--camera-max-age-ms", "10000", "--status-socket", tmp_path / "vm-detect.sock")
    played = lines(run("image1*.jpg", "--live", "--camera-fps", "1", *options, cwd=tmp_path))
    # On a machine that is too slow for a second a frame, the camera may begin again; it ends after all three.
    *_, one, two, three = (each["detections"] for each in played if each["type"] == "frame")
    assert one == three != two


def test_live_takes_one_pattern_in_quotes_and_not_the_files_that_a_shell_makes_of_it(folder):
    (line,) = run(*IMAGES[:3], "--live", code=1).stderr.splitlines()
    assert "3 files" in line
    assert "'frames/*.jpg' --live" in line
    assert "no such camera" in run(folder / "other*.jpg", "--live", code=78).stderr


@pytest.mark.parametrize("source", [".", "'*'", "*"])
def test_the_other_files_of_a_set_of_vm_synth_are_no_frames(source, folder):
    for name in ("mask0000000.png", "coverage0000000.png"):
        cv2.imwrite(str(folder / name), np.zeros((512, 640), np.uint8))
    (folder / "scene0000000.json").write_text("{}")
    shell = f"{COMMAND} --model {MODEL} {source}"
    done = subprocess.run(shell, shell=True, cwd=folder, capture_output=True, text=True, check=False)
    assert [line["source"] for line in lines(done)] == [each.name for each in IMAGES[:2]]
    assert done.stderr == ""


def test_frames_are_in_natural_order(folder, lens):
    for number in (10, 9, 1):
        shutil.copy(IMAGES[0], folder / f"frame{number}.jpg")
    found = lines(detect(folder / "frame*", "--lens", lens, "--height", "0.8"))
    assert [line["source"] for line in found] == ["frame1.jpg", "frame9.jpg", "frame10.jpg"]


def test_a_video_is_read_to_its_end(tmp_path, lens):
    path = film(tmp_path / "clip.avi", 5)
    found = lines(detect(path, "--lens", lens, "--height", 0.8, "--pitch", "30deg", "--save-points", tmp_path))
    assert [line["frame"] for line in found] == list(range(5))
    assert [line["stamp"] for line in found] == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4], abs=0.01)
    assert len(list(tmp_path.glob("clip-*.npz"))) == 5


def beside(image):
    return image.with_name(image.name.replace("image", "lens")).with_suffix(".yaml")


@pytest.mark.long
def test_a_given_lens_file_with_hoc_gives_the_orientation(tmp_path):
    """Of a picture without a lens file beside it, and of the frames of a video."""
    photo, clip = tmp_path / "photo.jpg", film(tmp_path / "clip.avi", 1)
    shutil.copy(IMAGES[0], photo)
    (expected,) = lines(detect(IMAGES[0]))
    (found,) = lines(detect(photo, "--lens", beside(IMAGES[0])))
    assert found["detections"] == expected["detections"]
    (of_video,) = lines(detect(clip, "--lens", beside(IMAGES[0])))
    assert of_video["points"] == expected["points"]
    socket = ("--status-socket", tmp_path / "vm-detect.sock")
    played = lines(detect(clip, "--live", "--lens", beside(IMAGES[0]), *socket))
    assert [each["points"] for each in played if each["type"] == "frame"] == [expected["points"]]


def test_a_height_takes_precedence_over_hoc_of_the_lens_file(tmp_path):
    photo = tmp_path / "photo.jpg"
    shutil.copy(IMAGES[0], photo)
    (low,) = lines(detect(photo, "--lens", beside(IMAGES[0]), "--height", 0.5, "--pitch", "30deg"))
    (high,) = lines(detect(photo, "--lens", beside(IMAGES[0])))
    assert low["points"] != high["points"]


def test_one_line_says_that_the_lens_files_beside_images_replace_what_was_given():
    for given, replaced in ((("--fov", "60deg"), "lens"), (("--fov", "60deg", "--height", 0.5), "lens and pose")):
        done = detect(FOLDER, *given)
        assert done.stderr.splitlines()[-1] == f"vm-detect: {beside(IMAGES[0])} replaces the given {replaced}"
    assert detect(FOLDER).stderr == ""


def test_options_of_a_live_camera_are_rejected_for_files(tmp_path):
    for option in (
        "--status-page=127.0.0.1:8080",
        "--pose-source=udp:127.0.0.1:5600",
        "--output-udp=127.0.0.1:5000",
        f"--recorder-folder={tmp_path}",
    ):
        one_complaint(detect(IMAGES[0], option, code=1), f"{option.partition('=')[0]} works only with a live camera")


def test_saved_points_are_the_mesh_on_screen(tmp_path):
    (line,) = lines(detect(IMAGES[0], "--save-points", tmp_path / "points"))
    with np.load(tmp_path / "points" / f"{IMAGES[0].stem}.npz") as saved:
        assert sorted(saved) == ["pixels", "probabilities", "rays"]
        assert len(saved["pixels"]) == len(saved["rays"]) == len(saved["probabilities"]) == line["points"]
        np.testing.assert_allclose(np.linalg.norm(saved["rays"], axis=1), 1.0)
        np.testing.assert_allclose(saved["probabilities"].sum(axis=1), 1.0, atol=1e-5)
    assert [path.name for path in (tmp_path / "points").iterdir()] == [f"{IMAGES[0].stem}.npz"]


def test_overlays_are_pictures_of_the_frame_s_size(tmp_path):
    detect(IMAGES[0], "--save-overlay", tmp_path)
    drawn, frame = cv2.imread(str(tmp_path / IMAGES[0].name)), cv2.imread(str(IMAGES[0]))
    assert drawn.shape == frame.shape
    assert (np.abs(drawn.astype(int) - frame).max(axis=2) > 60).sum() > 500


def test_an_overlay_never_replaces_an_image_of_any_source(folder, tmp_path):
    twin = shutil.copytree(folder, tmp_path / "twin")
    for image in IMAGES[:2]:
        shutil.copy(DEMO, twin / image.name)
    before = contents(tmp_path)
    for sources in ((folder,), (twin, folder), (folder, twin)):
        done = run(*sources, "--model", MODEL, "--save-overlay", folder, code=1)
        one_complaint(done, str(folder / IMAGES[0].name), "is an input and would be overwritten; give another output")
        assert done.stdout == ""
    assert contents(tmp_path) == before


def test_an_overlay_does_not_replace_another_image_beside_the_frame(folder, lens):
    cv2.imwrite(str(folder / "photo.png"), cv2.imread(str(IMAGES[0])))
    shutil.copy(IMAGES[1], folder / "photo.jpg")
    before = contents(folder)
    done = detect(folder / "photo.png", "--lens", lens, "--height", 0.8, "--save-overlay", folder, code=1)
    one_complaint(done, "would replace")
    assert contents(folder) == before


def test_overlays_do_not_draw_into_the_images_with_boxes(folder, tmp_path):
    out = tmp_path / "out"
    done = detect(folder, "--save-overlay", out, "--save-boxes", folder / ".." / "out", code=1)
    one_complaint(done, "--save-overlay would draw into the images of --save-boxes", "give another folder")
    assert not out.exists()


def test_a_video_never_replaces_a_source(tmp_path, lens):
    film(tmp_path / "clip.avi", 2)
    (tmp_path / "link.avi").symlink_to("clip.avi")
    before = contents(tmp_path)
    for source in ("clip.avi", "link.avi"):
        done = detect(source, "--lens", lens, "--height", 0.8, "--save-video", "clip.avi", cwd=tmp_path, code=1)
        one_complaint(done, "vm-detect: clip.avi is an input and would be overwritten")
    assert contents(tmp_path) == before


@pytest.mark.parametrize("name", ["found.avi", "f" * 251 + ".avi"])
def test_other_things_beside_a_video_stay_and_do_not_matter(name, folder, tmp_path):
    path, link, source = tmp_path / name, tmp_path / "link.avi", tmp_path / "found.part.avi"
    film(source, 2)
    (tmp_path / "found.avi.part").mkdir()
    path.touch(mode=0o640)
    link.symlink_to(path)
    before = source.read_bytes()
    detect(folder, "--save-video", link)
    assert cv2.VideoCapture(str(path)).get(cv2.CAP_PROP_FRAME_COUNT) == 2
    assert link.is_symlink()
    assert path.stat().st_mode & 0o777 == 0o640
    assert source.read_bytes() == before
    known = {path, link, source, folder, tmp_path / "found.avi.part"}
    assert known == set(tmp_path.iterdir())


def test_two_videos_of_one_name_at_once_are_each_whole(tmp_path):
    path, picture = tmp_path / "both.avi", np.zeros((64, 64, 3), np.uint8)
    with VideoFile(path, 10.0) as first:
        for _ in range(3):
            first.write(picture)
        with VideoFile(path, 10.0) as second:
            second.write(picture)
        assert cv2.VideoCapture(str(path)).get(cv2.CAP_PROP_FRAME_COUNT) == 1
    assert cv2.VideoCapture(str(path)).get(cv2.CAP_PROP_FRAME_COUNT) == 3
    assert list(tmp_path.iterdir()) == [path]


def test_a_video_that_can_not_get_its_name_stays_under_another(tmp_path):
    path = tmp_path / "film.avi"

    def write_video():
        with VideoFile(path, 10.0) as video:
            video.write(np.zeros((64, 64, 3), np.uint8))
            path.mkdir()

    with pytest.raises(InputError, match=r"this is a folder; it is in .*\.part\.avi"):
        write_video()
    (left,) = set(tmp_path.iterdir()) - {path}
    assert cv2.VideoCapture(str(left)).get(cv2.CAP_PROP_FRAME_COUNT) == 1


def test_overlays_and_points_of_images_with_one_name_stay_apart(folder, lens, tmp_path):
    twin = shutil.copytree(folder, tmp_path / "twin")
    out = ("--save-overlay", tmp_path / "out", "--save-points", tmp_path / "out")
    run(folder, twin, "--model", MODEL, "--lens", lens, *out)
    names = [path.stem for path in sorted(folder.glob("image*.jpg"))]
    for suffix in ("jpg", "npz"):
        expected = sorted(f"{name}{number}.{suffix}" for name in names for number in ("", "-2"))
        assert sorted(path.name for path in (tmp_path / "out").glob(f"*.{suffix}")) == expected


@pytest.mark.parametrize("suffix", [".mp4", ".avi", ".webm"])
def test_a_video_has_every_frame_with_what_was_found(suffix, folder, tmp_path):
    path = tmp_path / f"found{suffix}"
    path.write_text("an older file")
    assert detect(folder, "--save-video", path, "--save-overlay", tmp_path).stderr == ""
    capture = cv2.VideoCapture(str(path))
    assert capture.get(cv2.CAP_PROP_FPS) == pytest.approx(10.0)
    for each in IMAGES[:2]:
        seen, drawn = capture.read()[1], cv2.imread(str(tmp_path / each.name))
        plain = cv2.imread(str(each))
        difference = np.abs(seen.astype(int) - drawn).mean()
        assert difference < min(12.0, np.abs(plain.astype(int) - drawn).mean() + 8.0)
        assert seen.shape == plain.shape
    assert not capture.read()[0]
    assert sorted(each.name for each in tmp_path.iterdir() if each.suffix == suffix) == [path.name]


def test_a_video_of_a_video_has_its_rate(tmp_path, lens):
    path = film(tmp_path / "clip.avi", 3, rate=25.0)
    detect(path, "--lens", lens, "--height", 0.8, "--pitch", "30deg", "--save-video", tmp_path / "found.mp4")
    assert cv2.VideoCapture(str(tmp_path / "found.mp4")).get(cv2.CAP_PROP_FPS) == pytest.approx(25.0)


@pytest.mark.long
@pytest.mark.parametrize("suffix", [".mp4", ".avi", ".webm"])
def test_a_video_that_a_full_disk_cuts_short_is_an_error_and_the_old_one_stays(suffix, tmp_path, lens):
    """A limit on the size of files lets writes fail as a full disk does."""
    source, path = film(tmp_path / "clip.avi", 8), tmp_path / f"found{suffix}"
    options = ("--lens", lens, "--height", 0.8, "--pitch", "30deg", "--save-video", path)
    detect(source, *options)
    before = contents(tmp_path)
    done = detect(source, *options, code=1, preexec_fn=partial(limit_files, int(0.6 * path.stat().st_size)))
    one_complaint(done, f"can't write the video {path}: only ", " of 8 frames were written; is the disk full?")
    assert len(lines(done)) == 8
    assert contents(tmp_path) == before


def test_a_video_of_a_very_fast_one_has_every_frame(tmp_path):
    with VideoFile(tmp_path / "fast.avi", 5000.0) as video:
        for _ in range(9):
            video.write(cv2.imread(str(IMAGES[0])))
    assert cv2.VideoCapture(str(tmp_path / "fast.avi")).get(cv2.CAP_PROP_FRAME_COUNT) == 9


def test_a_video_that_can_not_be_written_is_named(folder, tmp_path):
    one_complaint(detect(folder, "--save-video", tmp_path / "a.mp", code=1), "a.mp", "did you mean '.mp4'")
    one_complaint(detect(folder, "--save-video", tmp_path / "nowhere" / "a.mp4", code=1), "no folder")
    small = cv2.resize(cv2.imread(str(IMAGES[1])), (320, 256))
    cv2.imwrite(str(folder / IMAGES[1].name), small)
    done = detect(folder, "--save-video", tmp_path / "a.mp4")
    one_complaint(done, IMAGES[1].name, "320 x 256 px", "640 x 512 px")
    assert len(lines(done)) == 1


def test_the_place_of_a_missing_lens_file_is_named(tmp_path):
    for name, place in (("image7.jpg", "lens7.yaml beside it"), ("photo.jpg", "lensNAME.yaml beside imageNAME")):
        shutil.copy(IMAGES[0], tmp_path / name)
        one_complaint(
            detect(tmp_path / name, "--height", 0.8, code=1), f"no lens: give --lens or --fov, or put {place}"
        )


def test_what_is_wrong_with_many_frames_is_said_once_and_counted_at_the_end(tmp_path):
    done = detect(film(tmp_path / "clip.avi", 7), code=1)
    reason = "no lens: give --lens or --fov"
    assert done.stderr.splitlines() == [
        f"vm-detect: clip.avi: {reason}",
        f"vm-detect: 7 frames could not be processed: {reason}",
    ]
    for number in range(3):
        shutil.copy(IMAGES[0], tmp_path / f"photo{number}.jpg")
    (tmp_path / "photo3.jpg").write_bytes(b"no picture")
    reason += ", or put lensNAME.yaml beside imageNAME"
    first, second, last = detect(tmp_path / "photo*.jpg", code=1).stderr.splitlines()
    assert first == f"vm-detect: photo0.jpg: {reason}"
    assert "photo3.jpg" in second
    assert last == f"vm-detect: 3 frames could not be processed: {reason}"


def test_a_photo_needs_no_lens_file(tmp_path):
    """The same as with the lens file of such a lens."""
    shutil.copy(DEMO, tmp_path / "photo.jpg")
    pose = ("--height", 0.6, "--pitch", "20deg")
    found = lines(run(tmp_path / "photo.jpg", "--fov", "70deg", *pose))
    height, width = cv2.imread(str(DEMO)).shape[:2]
    focal_length = 0.5 * width / math.tan(math.radians(35.0))
    fov = 2.0 * math.atan(0.5 * math.hypot(width, height) / focal_length)
    lens = tmp_path / "lens.toml"
    lens.write_text(f'projection = "rectilinear"\nfocal_length = {focal_length!r}\nfov = {fov!r}\n')
    again = lines(run(tmp_path / "photo.jpg", "--lens", lens, *pose))
    configured = tmp_path / "vm.toml"
    configured.write_text('fov = "70deg"\n[orientation]\nheight = 0.6\npitch = "20deg"\n')
    third = lines(run(tmp_path / "photo.jpg", "--config", configured))
    assert found[0]["points"] > 100
    assert [found[0][name] for name in ("points", "detections")] == [
        again[0][name] for name in ("points", "detections")
    ]
    assert [found[0][name] for name in ("points", "detections")] == [
        third[0][name] for name in ("points", "detections")
    ]


@pytest.mark.parametrize(
    ("fov", "said"), [("70", "70deg"), ("170deg", "150deg"), ("0", "1deg"), ("wide", "angle"), ("nan", "angle")]
)
def test_impossible_angles_of_view_are_refused(fov, said, tmp_path):
    one_complaint(run(IMAGES[0], "--fov", fov, "--height", 0.6, code=1), said)


def test_a_lens_and_an_angle_of_view_are_one_too_many(lens):
    one_complaint(run(IMAGES[0], "--fov", "70deg", "--lens", lens, code=1), "not both")


def test_class_points_come_on_request():
    (line,) = lines(detect(IMAGES[0], "--emit-points", "field,line"))
    assert list(line["class_points"]) == ["field", "line"]
    field = line["class_points"]["field"]
    assert len(field["bearings"]) == len(field["probabilities"]) > 100
    assert np.array(field["bearings"])[:, 2].max() < 0.0
    assert "did you mean 'line'" in detect(IMAGES[0], "--emit-points", "lines", code=1).stderr


def test_rejected_clusters_come_on_request():
    with_reasons = lines(detect(FOLDER, "--explain", "--threshold", 0.2))
    assert all("rejected" in line for line in with_reasons)
    assert all(each["reason"] for line in with_reasons for each in line["rejected"])


def test_configuration_and_options_agree(tmp_path, lens):
    (tmp_path / "vm.toml").write_text(
        f'model = "{MODEL}"\nlens = "{lens}"\n'
        '[orientation]\nheight = 0.8\npitch = "30deg"\n[detector]\nthreads = 1\nthreshold = 0.6\n'
    )
    shutil.copy(IMAGES[0], tmp_path / "frame.jpg")
    configured = lines(run("--camera", tmp_path / "frame.jpg", "--config", tmp_path / "vm.toml"))
    pose = ("--lens", lens, "--height", 0.8, "--pitch", 0.5235987755982988)
    given = lines(detect(tmp_path / "frame.jpg", *pose, "--threshold", 0.6))
    assert configured[0]["points"] == given[0]["points"] > 0
    assert configured[0]["detections"] == given[0]["detections"]
    other = lines(run("--camera", tmp_path / "frame.jpg", "--config", tmp_path / "vm.toml", "--height", 1.1))
    assert other[0]["points"] != given[0]["points"]


def test_looking_at_the_sky_gives_an_empty_result(tmp_path, lens):
    shutil.copy(IMAGES[0], tmp_path / "frame.jpg")
    for pitch in (("--pitch=-90deg",), ("--pitch", "-90deg")):
        done = detect(tmp_path / "frame.jpg", "--lens", lens, "--height", 0.8, *pitch)
        (line,) = lines(done)
        assert line["points"] == 0
        assert line["detections"] == []
        one_complaint(done, "no frame shows a near part of the plane: check --height")


def test_raw_frames_are_read_in_their_format(tmp_path, lens):
    picture = cv2.imread(str(IMAGES[0]))
    mosaic = picture[:, :, 1].copy()
    mosaic[0::2, 0::2], mosaic[1::2, 1::2] = picture[0::2, 0::2, 2], picture[1::2, 1::2, 0]
    cv2.imwrite(str(tmp_path / "raw.png"), mosaic)
    pose = ("--lens", lens, "--height", 0.8, "--pitch", "30deg")
    (line,) = lines(detect(tmp_path / "raw.png", *pose, "--format", "bayer_rggb", "--save-overlay", tmp_path))
    assert line["points"] > 0
    one_complaint(detect(tmp_path / "raw.png", *pose, "--format", "rgba", code=1), "rgba", "bayer_rggb")
    one_complaint(detect(IMAGES[0], "--format", "gray", code=1), "gray image must have the shape")


def test_one_bad_frame_is_named_and_the_others_are_processed(folder):
    content = IMAGES[0].read_bytes()
    (folder / "image0000005.jpg").write_bytes(content[: len(content) // 2])
    shutil.copy(folder / "lens0000000.yaml", folder / "lens0000005.yaml")
    done = one_complaint(detect(folder), "image0000005.jpg", "cut short")
    assert [line["frame"] for line in lines(done)] == [0, 1]


@pytest.mark.parametrize("content", [b"", b"no picture", b"\xff\xd8\xff\xe0 broken \xff\xd9", b"\x89PNG\r\n\x1a\n"])
def test_a_broken_image_is_named(tmp_path, content, lens):
    (tmp_path / "broken.jpg").write_bytes(content)
    done = detect(tmp_path / "broken.jpg", "--lens", lens, "--height", 0.8, code=1)
    one_complaint(done, f"vm-detect: {tmp_path / 'broken.jpg'} ")
    assert done.stderr.count("broken.jpg") == 1
    assert done.stdout == ""


@pytest.mark.parametrize("name", ["missing.jpg", "missing/", "none*.jpg", "²"])
def test_a_missing_source_is_named(name, tmp_path):
    one_complaint(detect(name, code=1, cwd=tmp_path), name)


@pytest.mark.parametrize("name", ["", "image0000000.jpg", "*.jpg", "clip.avi", "bag.mcap"])
@pytest.mark.parametrize("locked", ["folder", "files"])
def test_a_source_without_permission_is_named_as_unreadable(name, locked, folder):
    film(folder / "clip.avi", 1)
    (folder / "bag.mcap").write_bytes(b"")
    for each in [folder] if locked == "folder" else folder.iterdir():
        each.chmod(0)
    done = detect(folder / name, code=1, preexec_fn=heed_permissions)
    folder.chmod(0o755)
    assert "can't read" in done.stderr
    assert str(folder) in done.stderr
    assert "Permission denied" in done.stderr
    assert "write" not in done.stderr


@pytest.mark.parametrize("option", ["--save-overlay", "--save-points", "--save-boxes", "--save-video"])
def test_an_output_without_permission_is_named(option, tmp_path):
    out = tmp_path / "out"
    out.mkdir(mode=0)
    path = out / "a.mp4" if option == "--save-video" else out
    done = detect(IMAGES[0], option, path, code=1, preexec_fn=heed_permissions)
    out.chmod(0o755)
    one_complaint(done, str(out), "Permission denied", "can't read" if option == "--save-boxes" else "can't write")


def test_a_directory_without_images_is_named(tmp_path):
    one_complaint(detect(tmp_path, code=1), "no images in directory", str(tmp_path))
    shutil.copytree(IMAGES[0].parent, tmp_path / "day1")
    one_complaint(detect(tmp_path, code=1), f"give the folders in it one by one, such as {tmp_path / 'day1'}")


@pytest.mark.parametrize("content", [b"", b"no video at all", os.urandom(20000)])
def test_an_unreadable_video_is_named(tmp_path, content):
    (tmp_path / "clip.mp4").write_bytes(content)
    one_complaint(detect(tmp_path / "clip.mp4", code=1), "clip.mp4 is neither an image (.jpg, ", "nor a video that")


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("", ("expected a table of keys and values",)),
        ("projection: FISH\nfocal_length: 300\nfov: 2\n", ("FISH", "equidistant")),
        ("projection: EQUISOLID\nfocal_lenght: 300\nfov: 2\n", ("focal_lenght", "focal_length")),
        ("projection: EQUISOLID\nfocal_length: -3\nfov: 2\n", ("focal length", "-3")),
        ("projection: EQUISOLID\nfov: 2\n", ("focal_length",)),
        ("projection: [EQUISOLID\n", ("line 1",)),
        ("projection: EQUISOLID\nfocal_length: 280\nfov: 2\nsize: [300, 300]\n", ("300 x 300", "640 x 512")),
        ("projection: EQUISOLID\nfocal_length: 280\nfov: 2\nHoc: [[1, 2], [3, 4]]\n", ("Hoc", "4 x 4")),
    ],
)
def test_a_wrong_lens_file_is_named(tmp_path, text, parts):
    shutil.copy(IMAGES[0], tmp_path / "imageX.jpg")
    (tmp_path / "lensX.yaml").write_text(text)
    one_complaint(detect(tmp_path, "--height", 0.8, code=1), *parts)


def test_a_frame_without_lens_or_orientation_says_what_to_give(tmp_path, lens):
    shutil.copy(IMAGES[0], tmp_path / "frame.jpg")
    one_complaint(detect(tmp_path / "frame.jpg", code=1), "--lens")
    one_complaint(detect(tmp_path / "frame.jpg", "--lens", lens, code=1), "--height")
    one_complaint(detect(tmp_path / "frame.jpg", "--lens", lens, "--pitch", 1, code=1), "--height")


@pytest.mark.parametrize(
    ("pose", "part", "code"),
    [
        (("--height", "nan"), "--height: height must be a number of meters, as in 0.8, not nan", 2),
        (("--height", "high"), "--height: height must be a number of meters, as in 0.8, not 'high'", 2),
        (("--height", "-1"), "-1", 1),
        (("--height", "0.15"), "0.19", 1),
        (("--height", "0.8", "--pitch", "nan"), "nan", 2),
        (("--height", "0.8", "--roll", "inf"), "inf", 2),
        (("--height", "0.8", "--pitch", "20"), "did you mean 20deg?", 2),
        (("--height", "0.8", "--pitch", "5"), "from -1.5708 to 1.5708 rad, not 5; did you mean 5deg?", 2),
        (("--height", "0.8", "--pitch", "100deg"), "rad, not '100deg'", 2),
        (("--height", "0.8", "--object-radius", "0.5"), "diameter", 1),
    ],
)
def test_impossible_geometry_is_named(tmp_path, lens, pose, part, code):
    shutil.copy(IMAGES[0], tmp_path / "frame.jpg")
    one_complaint(detect(tmp_path / "frame.jpg", "--lens", lens, *pose, code=code), part)


def test_a_nan_in_hoc_is_named(folder):
    path = folder / "lens0000000.yaml"
    rows = path.read_text().splitlines()
    rows[-4] = "  - [.nan, 0, 0, 0]"
    path.write_text("\n".join(rows))
    done = one_complaint(detect(folder), "image0000000.jpg", "finite")
    assert len(lines(done)) == 1


def test_a_folder_that_can_t_be_made_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    one_complaint(detect(IMAGES[0], "--save-overlay", tmp_path / "file", code=1), "file")
