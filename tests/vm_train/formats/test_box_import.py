"""Masks from boxes, lens and pose agree with the true masks, and a mesh network learns from them."""

import json
import shutil
import subprocess
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.manifests import ball_manifest
from tests.programs import limit_files, run_program
from tests.vm_train.commands import run, run_module
from tests.vm_train.drawn import CLASSES, RADIUS
from tests.vm_train.formats.boxed import draw_frames, yolo_line
from vm_embedded.errors import InputError
from vm_embedded.geometry.lens_files import LensFile
from vm_embedded.geometry.orientation import Orientation
from vm_embedded.geometry.radial_lenses import Equidistant, Equisolid, Rectilinear
from vm_embedded.geometry.shapes import Cylinder, Sphere
from vm_embedded.network.bundled import model_path
from vm_embedded.network.model_file import read_model
from vm_export.checkpoint import Checkpoint
from vm_export.look_weights import look_of
from vm_train.boxes.box import Box, BoxedPicture
from vm_train.boxes.read import read_boxes
from vm_train.cli.import_boxes import import_boxes_parser, run_import_boxes
from vm_train.data.classes import Classes
from vm_train.data.pictures import find_pictures, read_picture
from vm_train.formats.box_import import _number, import_boxes
from vm_train.formats.box_masks import MaskRule, mask_of
from vm_train.truth.objects import read_scene, true_objects
from vm_workstation.outlines import sphere_outline

TWO_CLASSES = """
[classes]
ball = { kind = "object", colors = [[255, 0, 0]] }
other = { kind = "background", colors = [[0, 0, 0], [255, 255, 255], [0, 255, 0]] }
[mesh]
radius = 0.07
"""
RED, BLACK = (255, 0, 0), (0, 0, 0)
RULE = MaskRule(Sphere(RADIUS), {"ball": RED}, BLACK)
SIZE = (320, 240)


@pytest.fixture(scope="module")
def frames(tmp_path_factory):
    return draw_frames(tmp_path_factory.mktemp("frames") / "frames", 40)


@pytest.fixture
def configuration(tmp_path):
    path = tmp_path / "train.toml"
    path.write_text(TWO_CLASSES)
    return path


def import_frames(*arguments):
    return run_import_boxes(import_boxes_parser().parse_args([str(each) for each in arguments]))


def labels(path):
    """Whether each pixel of a mask is labeled, and whether it is red."""
    mask = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    return mask[..., 3] == 255, (mask[..., :3] == (0, 0, 255)).all(axis=2)


def test_masks_from_true_boxes_agree_with_the_true_masks(frames, configuration, tmp_path, capsys):
    folder, drawn = frames
    out = tmp_path / "out"
    assert import_frames(folder, out, "--names", "0=ball", "--config", configuration) == 0
    boxes = sum(bool(each.read_text()) for each in folder.glob("*.txt"))
    said = capsys.readouterr()
    assert f"{out}: 40 pictures, " in said.out
    assert f"{boxes} boxes labeled, 0 left unlabeled; 0 frames without lens or pose left out" in said.out
    assert said.err.startswith("vm-train: no recording is small enough to be held out as a whole")
    listed = (out / "validation.txt").read_text().split()
    assert listed == sorted(image.stem for image in folder.glob("*.jpg"))[-13:]  # the last third of the recording
    assert said.err.count("\n") == 1
    known = wrong = balls = found = 0
    for image in folder.glob("*.jpg"):
        number = image.stem.removeprefix("image")
        labeled, is_ball = labels(out / f"mask{image.stem}.png")
        _, truth = labels(drawn / f"mask{number}.png")
        known, wrong = known + labeled.sum(), wrong + (labeled & (is_ball != truth)).sum()
        balls, found = balls + truth.sum(), found + (is_ball & truth).sum()
        assert (out / f"image{image.stem}.jpg").read_bytes() == image.read_bytes()
        assert (out / f"lens{image.stem}.yaml").read_bytes() == (folder / f"lens{number}.yaml").read_bytes()
    assert wrong <= 1e-5 * known
    assert found > 0.4 * balls
    assert known > 0.97 * 40 * labeled.size
    assert not list(out.glob("scene*.json"))


def test_a_diameter_instead_of_a_radius_is_suspected(frames, configuration, tmp_path, capsys):
    wrong = ("--object-radius", 2 * RADIUS)
    import_frames(frames[0], tmp_path / "out", "--names", "0=ball", "--config", configuration, *wrong)
    assert "check --object-radius (a radius, not a diameter; it is 0.14)" in capsys.readouterr().err


lenses = st.sampled_from(
    [
        Rectilinear(focal_length=200.0, fov=2.2),
        Equidistant(focal_length=150.0, fov=2.6, center=(4.0, -3.0)),
        Equisolid(focal_length=150.0, fov=2.6, distortion=(1e-6, 0.0)),
    ]
)


@given(lenses, st.floats(0.3, 4.0), st.floats(-0.5, 0.5), st.floats(-0.2, 0.2), st.floats(0.2, 0.8))
@settings(max_examples=60, deadline=None)
def test_a_true_box_gives_only_true_labels_with_every_lens(lens, distance, bearing, roll, pitch):
    orientation = Orientation.from_roll_pitch(0.55, roll, pitch)
    center = np.array([distance * np.cos(bearing), distance * np.sin(bearing), RADIUS])
    outline = sphere_outline(lens, orientation, center, RADIUS, SIZE)
    low, high = outline.min(axis=0), outline.max(axis=0)
    if not (np.isfinite(outline).all() and (low >= 2.0).all() and (high <= np.array(SIZE) - 3.0).all()):
        return
    picture = BoxedPicture(Path("x.jpg"), SIZE, (Box("ball", *low, *high),), "a")
    mask, labeled, misfits = mask_of(picture, LensFile(lens, orientation), RULE)
    assert (labeled, misfits) == (1, [])
    x, y = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
    rays = lens.unproject(np.stack([x.ravel(), y.ravel()], axis=1).astype(float), SIZE) @ orientation.rotation.T
    toward = center - (0.0, 0.0, orientation.height)
    offset = RULE.shape.offset(rays, toward[None], orientation.height).reshape(SIZE[1], SIZE[0])
    is_ball, is_other = mask[..., 2] == 255, (mask == (0, 0, 0, 255)).all(axis=2)
    assert (offset[is_ball] < 1.0).all()
    assert (np.nan_to_num(offset[is_other], nan=9.0) > 1.0).all()
    assert is_ball.any() or min(high - low) < 5.0


ORIENTATION = Orientation.from_roll_pitch(0.55, 0.0, 0.3)
LENS = Rectilinear(focal_length=200.0, fov=2.2)


@pytest.mark.parametrize(
    ("box", "reason"),
    [
        ((140.0, 120.0, 200.0, 180.0), "px, but an object on the plane there has"),
        ((150.0, 150.0, 152.0, 152.0), "px, but an object on the plane there has"),
        ((150.0, 10.0, 160.0, 20.0), "is not below the horizon"),
    ],
)
def test_a_box_that_does_not_fit_the_plane_is_left_unlabeled(box, reason):
    picture = BoxedPicture(Path("x.jpg"), SIZE, (Box("ball", *box), Box("robot", 0.0, 0.0, 50.0, 50.0)), "a")
    mask, labeled, (said,) = mask_of(picture, LensFile(LENS, ORIENTATION), RULE)
    assert labeled == 0
    assert said.startswith("the box of ball at (")
    assert reason in said
    assert not (mask[..., 2] == 255).any()
    left, top, right, bottom = (int(each) for each in box)
    assert not mask[top : bottom + 1, left : right + 1, 3].any()
    assert (mask[:, : left - 10, 3] == 255).all()


def test_a_camera_below_the_object_gives_no_label():
    low = LensFile(LENS, Orientation.from_roll_pitch(0.05, 0.0, 0.3))
    picture = BoxedPicture(Path("x.jpg"), SIZE, (Box("ball", 150, 150, 170, 170),), "a")
    assert "too high for a camera at 0.05 m" in mask_of(picture, low, RULE)[2][0]


def test_a_cylinder_gets_labels_and_a_cut_one_none():
    shape = Cylinder(0.04, 0.1)
    rule = MaskRule(shape, {"cup": RED}, None)
    center = shape.center_along(np.array([[0.8, 0.1, -0.5]]), 0.55)[0]
    outline = LENS.project(shape.outline(center, 0.55) @ ORIENTATION.rotation, SIZE)
    whole = Box("cup", *outline.min(axis=0), *outline.max(axis=0))
    mask, labeled, _ = mask_of(BoxedPicture(Path("x.jpg"), SIZE, (whole,), "a"), LensFile(LENS, ORIENTATION), rule)
    assert labeled == 1
    inside = cv2.pointPolygonTest(outline.astype(np.float32), np.argwhere(mask[..., 3])[0][::-1].astype(float), False)
    assert inside > 0
    assert mask[..., 3].any()
    assert not mask[:5, :5, 3].any()  # without a background, nothing else is labeled
    cut = Box("cup", whole.left, whole.top, whole.right, SIZE[1] - 0.5)
    _, _, (said,) = mask_of(BoxedPicture(Path("x.jpg"), SIZE, (cut,), "a"), LensFile(LENS, ORIENTATION), rule)
    assert "is cut by the border of the picture" in said


def test_a_ball_that_the_border_cuts_is_labeled(frames):
    center = np.array([0.9, 0.0, RADIUS])
    outline = sphere_outline(LENS, ORIENTATION, center, RADIUS, SIZE)
    low, high = outline.min(axis=0), outline.max(axis=0)
    shift = low[0] + 0.4 * (high - low)[0] + 0.5  # so much that the left border cuts the ball
    lens = Rectilinear(focal_length=200.0, fov=2.2, center=(shift, 0.0))
    box = Box("ball", -0.5, low[1], high[0] - shift, high[1])
    mask, labeled, misfits = mask_of(BoxedPicture(Path("x.jpg"), SIZE, (box,), "a"), LensFile(lens, ORIENTATION), RULE)
    assert (labeled, misfits) == (1, [])
    is_ball = mask[..., 2] == 255
    assert is_ball[:, 0].any()
    assert is_ball.sum() > 0.3 * np.pi / 4.0 * np.prod(high - low)


def test_frames_without_lens_or_pose_are_left_out_and_misfits_named(frames, configuration, tmp_path, capsys):
    folder = tmp_path / "some"
    shutil.copytree(frames[0], folder)
    boxed = [each.stem for each in sorted(folder.glob("*.txt")) if each.read_text()]
    (folder / f"lens{boxed[0].removeprefix('image')}.yaml").unlink()
    without_pose = folder / f"lens{boxed[1].removeprefix('image')}.yaml"
    without_pose.write_text(without_pose.read_text().partition("Hoc")[0])
    (folder / f"{boxed[2]}.txt").write_text(yolo_line((60.0, 2.0, 100.0, 42.0)))  # in the air
    (folder / "day.2").mkdir()
    for each in (f"{boxed[3]}.txt", f"{boxed[3]}.jpg", f"lens{boxed[3].removeprefix('image')}.yaml"):
        (folder / each).rename(folder / "day.2" / each)
    image = folder / f"{boxed[4]}.jpg"
    cv2.imwrite(str(image.with_suffix(".bmp")), cv2.imread(str(image)))
    image.unlink()
    out = tmp_path / "out"
    assert import_frames(folder, out, "--names", "0=ball", "--config", configuration, "--object-radius", RADIUS) == 0
    said = capsys.readouterr()
    assert "38 pictures" in said.out
    assert "1 left unlabeled; 2 frames without lens or pose left out" in said.out
    assert said.err.count("\n") == 1
    assert said.err.startswith(f"vm-train: {boxed[2]}.jpg: the box of ball at (")
    assert (out / f"imageday_2_{boxed[3]}.jpg").is_file()
    assert (out / f"image{boxed[4]}.png").is_file()
    listed = (out / "validation.txt").read_text().split()
    assert listed == [f"day_2_{boxed[3]}"]  # the whole recording
    with pytest.raises(InputError, match="is not empty: give a new folder"):
        import_frames(folder, out, "--names", "0=ball", "--config", configuration)


def test_with_more_classes_only_objects_are_labeled(frames, tmp_path):
    configuration = tmp_path / "train.toml"
    configuration.write_text(CLASSES)
    import_frames(frames[0], tmp_path / "out", "--names", "0=ball", "--config", configuration, "--object-radius", 0.07)
    for mask in (tmp_path / "out").glob("mask*.png"):
        labeled, is_ball = labels(mask)
        assert (labeled == is_ball).all()


def test_a_number_has_no_sign_of_a_comment():
    assert _number(Path("clip #1/frame.0.jpg"), []) == "clip _1_frame_0"
    assert _number(Path("clip #1/frame.0.jpg"), ["clip _1_frame_0"]) == "clip _1_frame_0_"


def test_an_import_that_ends_early_leaves_nothing_and_works_again(frames, configuration, tmp_path):
    folder, out = frames[0], tmp_path / "out"
    options = ("--names", "0=ball", "--config", configuration)
    limit = partial(limit_files, max(each.stat().st_size for each in folder.iterdir()) - 1)
    command = ("vm-train", "import-boxes", folder, out, *options)
    done = run_program(*command, code=1, preexec_fn=limit)
    assert "File too large" in done.stderr
    assert [each.name for each in tmp_path.iterdir()] == ["train.toml"]
    import_frames(folder, out, *options)
    assert len(find_pictures(out)) == 40


def test_of_two_imports_into_one_folder_at_once_one_is_whole_and_the_other_an_error(frames, tmp_path):
    """The second one runs while the first one reads its first frame."""
    out, pictures = tmp_path / "out", read_boxes(frames[0], names={"0": "ball"}).pictures

    class Meanwhile(tuple):
        def __iter__(self):
            import_boxes(pictures[:3], frames[0], out, RULE, write_radius=False)
            return super().__iter__()

    with pytest.raises(InputError):
        import_boxes(Meanwhile(pictures[3:6]), frames[0], out, RULE, write_radius=False)
    assert len(find_pictures(out)) == 3
    assert [each.name for each in tmp_path.iterdir()] == ["out"]


def test_what_is_missing_is_named(frames, configuration, tmp_path):
    folder, out = frames[0], tmp_path / "out"
    with pytest.raises(InputError, match=r"no box of class ball; it has 0 .* --names 0=ball"):
        import_frames(folder, out, "--config", configuration)
    bare = tmp_path / "bare"
    shutil.copytree(folder, bare, ignore=shutil.ignore_patterns("*.yaml"))
    with pytest.raises(InputError, match=r"no frame of .* has a box of ball and a lens file beside it"):
        import_frames(bare, out, "--names", "0=ball", "--config", configuration)
    configuration.write_text(TWO_CLASSES.replace('"object"', '"upright"'))
    with pytest.raises(InputError, match="no class of the network has kind object; it has ball, other"):
        import_frames(folder, out, "--names", "0=ball", "--config", configuration)
    assert not out.exists()


@pytest.mark.long
def test_a_network_of_the_package_is_fine_tuned_as_a_user_types_it(frames, tmp_path):
    """Import for a network of any radius, mix with rendered pictures, train it on, and export it with a close look."""
    out, mixed, folder, days = (tmp_path / name for name in ("own", "mixed", "run", "days"))
    shutil.copytree(frames[0], days / "monday")
    (days / "sunday").mkdir()
    for path in sorted((days / "monday").glob("*00[0-3].*")):
        path.rename(days / "sunday" / path.name)
    done = run("import-boxes", days, out, "--names", "0=ball", "--from", "ball", "--object-radius", RADIUS)
    assert "40 pictures, 4 of them in validation.txt" in done.stdout
    scene = read_scene(next(out.glob("scene*.json")))
    assert (scene.radius, scene.in_mask) == (RADIUS, True)

    mixed.mkdir()
    subprocess.run(["cp", "-rs", f"{frames[1]}/.", f"{out}/.", mixed], check=True)
    few = ("--set", "training.epochs=1", "--workers", 0, "--threads", 1, "--no-unpacked")
    trained = run(mixed, "-o", folder, "--from", "ball", "--validation", out / "validation.txt", *few)
    assert "80 pictures: 76 for training, 4 for validation" in trained.stdout
    assert trained.stdout.endswith(f"\nnext: vm-export {folder / 'model.pt'} --look {folder / 'start.onnx'}\n")
    made = Checkpoint.load(folder / "model.pt").manifest
    assert (made.any_radius, made.sampling, made.colors) == (True, "footprint", "relative")
    assert "start.onnx" in json.loads((folder / "run.json").read_text())["made_from"]
    split = json.loads((folder / "pictures.json").read_text())
    assert split["validation"] == [f"sunday_image000{number}" for number in range(4)]

    look_of(read_model(model_path("ball"))).save(tmp_path / "look.pt")
    model = tmp_path / "own.onnx"
    run_module("vm_export.cli", folder / "model.pt", "--look", tmp_path / "look.pt", "-o", model)
    exported = read_model(model)
    assert exported.manifest.provenance["start_sha256"] == read_model(model_path("ball")).sha256
    assert exported.look is not None


def test_the_mask_has_the_truth_if_the_scene_only_gives_the_radius(frames, tmp_path):
    import_frames(frames[0], tmp_path / "out", "--names", "0=ball", "--from", "ball", "--object-radius", RADIUS)
    classes = Classes({"ball": (RED,), "other": (BLACK,)})
    counts = [len(each.boxes) for each in read_boxes(frames[0], None, {"0": "ball"}).pictures]
    manifest = ball_manifest("ball", "environment", object_radius=RADIUS)
    for files, count in zip(find_pictures(tmp_path / "out"), counts, strict=True):
        scene = read_scene(files.image.with_name(f"scene{files.number}.json"))
        assert len(true_objects(read_picture(files, classes), scene, manifest)["ball"]) == count
