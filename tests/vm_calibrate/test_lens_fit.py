"""Laws of the fit of a lens, on corners that are computed and not drawn."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings

from tests.vm_embedded.strategies import seeds
from vm_calibrate.board_poses import first_pose
from vm_calibrate.boards import Corners
from vm_calibrate.frames import BoardSighting, Search, choose
from vm_calibrate.lens_fit import fit_lens
from vm_embedded.errors import InputError

from .films import COLUMNS, KINDS, LENSES, ROWS, SIZE, SQUARE, film

PLACES = np.array([(x, y) for y in range(ROWS) for x in range(COLUMNS)]) * SQUARE


def seen(lens, turn, place, random, noise):
    """Pixels of a board's corners with noise [px]."""
    corners = PLACES @ turn[:, :2].T + place
    rays = corners / np.linalg.norm(corners, axis=1, keepdims=True)
    return lens.project(rays, SIZE) + random.normal(0.0, noise, (len(rays), 2))


def sightings(kind, count, noise, seed):
    """Sightings of a board all over the picture, for a kind of lens."""
    random = np.random.default_rng(seed)
    camera = film(kind)
    camera.random = random
    made = []
    while len(made) < count:
        ray = camera.lens.unproject(random.uniform((90, 90), (550, 390), (1, 2)), SIZE)[0]
        pixels = seen(camera.lens, *camera.facing(ray), random, noise)
        if (pixels > 0).all() and (pixels < SIZE).all():
            made.append(BoardSighting(f"frame {len(made)}", Corners(PLACES, pixels), 2.5))
    return made


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=3)
@given(seed=seeds)
def test_the_true_lens_is_within_the_stated_uncertainty(kind, seed):
    true = LENSES[kind]
    fit = fit_lens(kind, sightings(kind, 12, 0.2, seed), SIZE)
    focal = getattr(true, "focal_lengths", [true.scale])
    center = getattr(true, "optical_center", None) or np.array(SIZE) / 2.0 - true.center
    assert (np.abs(fit.focal_lengths[0] - focal) < 4.5 * fit.focal_lengths[1]).all()
    assert (np.abs(fit.center[0] - center) < 4.5 * fit.center[1]).all()
    assert (fit.focal_lengths[1] < 0.005 * true.scale).all()
    assert fit.error == pytest.approx(0.2 * np.sqrt(2.0), rel=0.15)


@settings(max_examples=5)
@given(seed=seeds)
def test_frames_that_disagree_are_left_out(seed):
    frames = sightings("rectilinear", 12, 0.1, seed)
    wrong = frames[3].corners.pixels + np.random.default_rng(seed).normal(0.0, 3.0, (len(PLACES), 2))
    frames[3] = BoardSighting("moved", Corners(PLACES, wrong), 2.5)
    fit = fit_lens("rectilinear", frames, SIZE)
    assert [sighting.name for sighting, _ in fit.outliers] == ["moved"]
    assert fit.lens.scale == pytest.approx(LENSES["rectilinear"].scale, rel=0.005)


@pytest.mark.long
@settings(max_examples=5)
@given(seed=seeds)
def test_it_agrees_with_opencv(seed):
    frames = sightings("pinhole", 12, 0.2, seed)
    boards = [np.column_stack([PLACES, np.zeros(len(PLACES))]).astype(np.float32)] * len(frames)
    pixels = [each.corners.pixels.astype(np.float32).reshape(-1, 1, 2) for each in frames]
    _, matrix, _, _, _ = cv2.calibrateCamera(boards, pixels, SIZE, None, None)
    fit = fit_lens("pinhole", frames, SIZE)
    assert fit.focal_lengths[0] == pytest.approx([matrix[0, 0], matrix[1, 1]], rel=5e-4)
    assert fit.center[0] == pytest.approx(matrix[:2, 2], abs=0.3)


def test_it_agrees_with_opencv_on_a_fisheye():
    frames = sightings("fisheye", 12, 0.2, 5)
    boards = [np.column_stack([PLACES, np.zeros(len(PLACES))])[None]] * len(frames)
    pixels = [each.corners.pixels[None] for each in frames]
    names = cv2.fisheye if hasattr(cv2.fisheye, "CALIB_FIX_SKEW") else cv2  # OpenCV 4, or OpenCV 5
    flags = names.CALIB_RECOMPUTE_EXTRINSIC | names.CALIB_FIX_SKEW
    _, matrix, _, _, _ = cv2.fisheye.calibrate(boards, pixels, SIZE, np.eye(3), np.zeros(4), flags=flags)
    fit = fit_lens("fisheye", frames, SIZE)
    assert fit.focal_lengths[0] == pytest.approx([matrix[0, 0], matrix[1, 1]], rel=5e-4)


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=10)
@given(seed=seeds)
def test_the_first_pose_is_exact_without_noise(kind, seed):
    random = np.random.default_rng(seed)
    camera = film(kind)
    camera.random = random
    turn, place = camera.facing(camera.lens.unproject(random.uniform((90, 90), (550, 390), (1, 2)), SIZE)[0])
    corners = PLACES @ turn[:, :2].T + place
    rotation, shift = first_pose(PLACES, corners / np.linalg.norm(corners, axis=1, keepdims=True))
    assert rotation == pytest.approx(turn, abs=1e-6)
    assert shift == pytest.approx(place, abs=1e-6)


def test_too_few_frames_are_an_error():
    with pytest.raises(InputError, match="at least 5 usable frames"):
        fit_lens("fisheye", sightings("fisheye", 4, 0.1, 1), SIZE)


def test_chosen_frames_are_sharp_and_different():
    frames = sightings("rectilinear", 10, 0.1, 2)
    again = [BoardSighting(f"again {each.name}", each.corners, 2.6) for each in frames]
    blurred = [BoardSighting(f"blurred {each.name}", each.corners, 9.0) for each in frames[:4]]
    search = Search(SIZE, [*frames, *again, *blurred])
    chosen = choose(search, 10)
    assert len({id(each.corners) for each in chosen}) == 10
    assert not any(each.name.startswith("blurred") for each in chosen)
    assert search.left_out == {"blurred": 4, "similar to others": 10}
