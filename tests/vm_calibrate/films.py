"""Pictures of boards, drawn by following each pixel's ray through a lens to the board."""

import math
from functools import cache, cached_property, partial

import cv2
import numpy as np
import pytest

from tests.programs import run_main
from tests.vm_embedded.strategies import rotation
from vm_calibrate.boards import board_from
from vm_calibrate.cli import main
from vm_embedded.geometry.calibrated_lenses import BrownLens, FisheyeLens
from vm_embedded.geometry.orientation import OPTICAL_TO_CAMERA
from vm_embedded.geometry.radial_lenses import Equidistant, Equisolid, Rectilinear

SIZE = (640, 480)

run = partial(run_main, main)

LENSES = {
    "pinhole": BrownLens(
        fov=math.radians(160.0),
        focal_lengths=(400.0, 404.0),
        optical_center=(325.0, 236.0),
        coefficients=(-0.25, 0.06, 0.001, -0.0008, 0.0),
        size=SIZE,
    ),
    "fisheye": FisheyeLens(
        fov=2.0 * math.pi,
        focal_lengths=(230.0, 229.0),
        optical_center=(316.0, 245.0),
        coefficients=(-0.02, 0.004, -0.002, 0.0003),
        size=SIZE,
    ),
    "rectilinear": Rectilinear(focal_length=420.0, fov=2.0, center=(6.0, -9.0), distortion=(2e-7, 0.0), size=SIZE),
    "equisolid": Equisolid(focal_length=240.0, fov=3.6, center=(-5.0, 4.0), distortion=(3e-7, 1e-12), size=SIZE),
    "equidistant": Equidistant(focal_length=200.0, fov=3.8, center=(5.0, 3.0), distortion=(4.4e-7, 0.0), size=SIZE),
}

KINDS = [pytest.param(kind, marks=() if kind == "fisheye" else pytest.mark.long) for kind in LENSES]
"""One kind of lens for `make test`, all of them for CI."""
"""A lens of each kind."""

SQUARE = 0.08
COLUMNS, ROWS = 8, 5
PER_SQUARE = 40
"""Texture pixels for each square."""


def chessboard_texture():
    """A chessboard with white margins of one square; (rows + 3, columns + 3) squares in texture pixels."""
    squares = np.add.outer(np.arange(ROWS + 1), np.arange(COLUMNS + 1)) % 2 * 255
    return _with_margin(np.kron(squares, np.ones((PER_SQUARE, PER_SQUARE))))


def charuco(legacy=False):
    return board_from("9x6", SQUARE, "4X4_50", 0.75 * SQUARE, legacy)


def charuco_texture(legacy=False):
    """A ChArUco board of 9x6 squares with the same outline and corners as the chessboard."""
    return _with_margin(charuco(legacy)._board.generateImage((9 * PER_SQUARE, 6 * PER_SQUARE)).astype(np.float64))


def _with_margin(texture):
    return np.pad(texture, PER_SQUARE, constant_values=255).astype(np.float32)


class Film:
    """A camera with a lens. Each pixel is the mean of two by two rays."""

    def __init__(self, lens):
        self.lens = lens
        self.random = np.random.default_rng(0)

    @cached_property
    def rays(self):
        """A ray (3,) for each quarter of a pixel, 0 where the lens sees nothing; takes up to six seconds."""
        x, y = ((np.arange(2 * n) - 0.5) / 2.0 for n in SIZE)
        pixels = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        rays = self.lens.unproject(pixels, SIZE)
        rays[~(np.isfinite(rays).all(axis=1) & self.lens.sees(rays))] = 0.0
        return rays.astype(np.float32)

    def picture(self, turn, place, texture, blur=0.6, noise=2.0):
        """A gray picture of a board whose frame has rotation `turn` (3, 3) and origin `place` (3,) for the camera.

        The board's frame begins at its first inner corner, as that of the detectors.
        """
        turn, place = np.float32(turn), np.float32(place)
        across = self.rays @ turn  # components along the board's axes
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = (turn[:, 2] @ place) / across[:, 2]
            hits = (across[:, :2] * distance[:, None] - turn[:, :2].T @ place) / SQUARE
        hits[~(distance > 0)] = -100.0
        u, v = ((np.nan_to_num(hits, nan=-100.0) + 2.0) * PER_SQUARE - 0.5).T
        shape = (2 * SIZE[1], 2 * SIZE[0])
        seen = cv2.remap(
            texture,
            np.clip(u, -9, 3e4).reshape(shape).astype(np.float32),
            np.clip(v, -9, 3e4).reshape(shape).astype(np.float32),
            cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_CONSTANT,
            borderValue=110,
        )
        image = cv2.resize(cv2.GaussianBlur(seen, None, 2.0 * blur), SIZE, interpolation=cv2.INTER_AREA)
        image = 20.0 + 0.8 * image + self.random.normal(0.0, noise, image.shape)
        return np.clip(image, 0, 255).astype(np.uint8)

    def pictures(self, count, texture):
        """Pictures of a board held towards the camera, all over the picture, at several distances and tilts."""
        self.random = np.random.default_rng(0)  # the same pictures, whichever were drawn before
        width, height = SIZE
        cells = [(x, y) for y in (0.25, 0.5, 0.75) for x in (0.2, 0.35, 0.5, 0.65, 0.8)]
        made = []
        for index in range(count):
            pixel = np.array(cells[index % len(cells)]) * (width, height) + self.random.uniform(-20, 20, 2)
            ray = self.lens.unproject(pixel[None], SIZE)[0]
            made.append(self.picture(*self.facing(ray), texture))
        return made

    def facing(self, ray):
        """A pose of a board in the direction of a ray, turned towards the camera and then tilted at random."""
        axis = np.cross([1.0, 0.0, 0.0], ray)
        sine = np.linalg.norm(axis)
        toward = rotation(axis / max(sine, 1e-9) * np.arctan2(sine, ray[0])) @ OPTICAL_TO_CAMERA
        tilt = rotation(self.random.uniform(-1.0, 1.0, 3) * (0.7, 0.7, 0.5))
        turn = toward @ tilt
        middle = turn @ np.array([(COLUMNS - 1) / 2.0, (ROWS - 1) / 2.0, 0.0]) * SQUARE
        share = self.random.uniform(0.22, 0.4)  # of the picture's width
        distance = COLUMNS * SQUARE * self.lens.scale / (share * SIZE[0])
        return turn, distance * ray - middle

    def on_floor(self, camera, x, y, yaw, texture, thickness=0.0):
        """A picture of a board on the floor at x, y [m] from below the camera, for the camera's orientation."""
        cosine, sine = np.cos(yaw), np.sin(yaw)
        turn = np.array([[cosine, sine, 0.0], [sine, -cosine, 0.0], [0.0, 0.0, -1.0]])
        place = np.array([x, y, thickness - camera.height])
        return self.picture(camera.rotation.T @ turn, camera.rotation.T @ place, texture)


@cache
def film(kind):
    """The film of a kind of lens, one for all tests of a process."""
    return Film(LENSES[kind])


def write(folder, pictures):
    """Write pictures into a new folder."""
    folder.mkdir()
    for index, picture in enumerate(pictures):
        cv2.imwrite(str(folder / f"{index:03d}.png"), picture)
    return folder
