"""Chessboards and ChArUco boards: how to find their corners in a picture, and how to draw them for print."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np
import numpy.typing as npt

from vm_embedded.arrays import Floats, Image, Singles
from vm_embedded.errors import InputError, unknown

FEWEST_CORNERS = 8
"""Fewest corners of a ChArUco board that count as found: its pose has six numbers, from two for each corner."""

_FEWEST_MARKERS, _MOST_COLUMNS = 6, 40
"""Markers from which the size of a board can be told, and the most columns to try."""

_WELL = 0.3
"""Largest median error of the corners of markers on a board that fits, as a share of a marker's side."""

_FIND = cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_ACCURACY


@dataclass(frozen=True, eq=False)
class Corners:
    """Corners of a board in a picture: places on the board (n, 2) [m] and pixels (n, 2)."""

    places: Floats
    pixels: Floats


@dataclass(frozen=True)
class Chessboard:
    """A chessboard. columns, rows: number of inner corners, at least 3 each. square: length of a square's side [m]."""

    columns: int
    rows: int
    square: float

    def find(self, gray: Image) -> Corners | None:
        """The corners in a gray picture, or None if not all are visible."""
        found, pixels = cv2.findChessboardCornersSB(gray, (self.columns, self.rows), flags=_FIND)
        if not found:
            return None
        places = np.array([(x, y) for y in range(self.rows) for x in range(self.columns)]) * self.square
        return Corners(places, _refined(gray, pixels.reshape(-1, 2).astype(np.float64), 0.3))

    def other_size(self, gray: Image) -> str | None:
        """The number of inner corners of a board of another size in a picture, as in 9x6, or None.

        A board with less than half of the corners is not another board, but the visible part of the right one.
        """
        found, _, marks = cv2.findChessboardCornersSBWithMeta(gray, (3, 3), _FIND | cv2.CALIB_CB_LARGER)
        rows, columns = marks.shape[:2] if found and marks is not None else (0, 0)
        same = {columns, rows} == {self.columns, self.rows}
        if same or 2 * columns * rows < self.columns * self.rows:
            return None
        return f"{max(columns, rows)}x{min(columns, rows)}"


@dataclass(frozen=True)
class CharucoBoard:
    """A chessboard with markers in its white squares.

    columns, rows: number of squares, at least 3 each. square, marker: lengths of their sides [m]. dictionary: name of
    the markers, as in 4X4_50. legacy: printed by an OpenCV before 4.6, which began even numbers of rows differently.
    """

    columns: int
    rows: int
    square: float
    marker: float
    dictionary: str
    legacy: bool = False

    @cached_property
    def markers(self) -> cv2.aruco.Dictionary:
        """The dictionary of the markers."""
        return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, f"DICT_{self.dictionary}"))

    def marker_corners(self) -> list[Floats]:
        """Corners (4, 2) of each marker [m], right and down from the board's upper left corner."""
        return [np.asarray(each, dtype=np.float64)[:, :2] for each in self._board.getObjPoints()]

    @cached_property
    def _board(self) -> cv2.aruco.CharucoBoard:
        board = cv2.aruco.CharucoBoard((self.columns, self.rows), self.square, self.marker, self.markers)
        board.setLegacyPattern(self.legacy)
        return board

    @cached_property
    def _detector(self) -> cv2.aruco.CharucoDetector:
        return cv2.aruco.CharucoDetector(self._board)

    def find(self, gray: Image) -> Corners | None:
        """The visible corners in a gray picture, or None if they are too few."""
        pixels, numbers, _, _ = self._detector.detectBoard(gray)
        if numbers is None or len(numbers) < FEWEST_CORNERS:
            return None
        places = np.asarray(self._board.getChessboardCorners(), dtype=np.float64)[numbers.ravel(), :2]
        if np.linalg.matrix_rank(places - places.mean(axis=0), tol=0.1 * self.square) < 2:
            return None  # corners in one line do not determine a pose
        margin = (1.0 - self.marker / self.square) / 2.0  # beyond it there are edges of the markers
        return Corners(places, _refined(gray, pixels.reshape(-1, 2).astype(np.float64), margin))

    def marker_count(self, gray: Image) -> int:
        """The number of markers of the dictionary in a picture."""
        return len(self._markers_in(gray)[1])

    def other_size(self, gray: Image) -> str | None:
        """The size of another board that fits the markers of a picture, as "9x6" or "9x6 --legacy", or None."""
        corners, numbers = self._markers_in(gray)
        if len(numbers) < _FEWEST_MARKERS:
            return None
        pixels, count = np.concatenate(corners).reshape(-1, 2).astype(np.float64), int(numbers.max()) + 1
        fits = []
        for columns in range(3, _MOST_COLUMNS + 1):
            rows = max(-(-2 * count // columns), 3)
            if columns * rows // 2 < count or columns * rows // 2 > len(self.markers.bytesList):
                continue
            for legacy, doubt in ((self.legacy, 1.0), (not self.legacy, 2.0)):  # both may fit, if markers are hidden
                board = replace(self, columns=columns, rows=rows, legacy=legacy)
                places = np.concatenate([board.marker_corners()[each] for each in numbers])
                fits.append((doubt * _misfit(places, pixels), board))
        error, best = min(fits, key=lambda each: each[0], default=(math.inf, self))
        if best == self or error > _WELL * self.marker:
            return None
        change = "" if best.legacy == self.legacy else " --legacy" if best.legacy else " without --legacy"
        return f"{best.columns}x{best.rows}{change}"

    def _markers_in(self, gray: Image) -> tuple[Sequence[Singles], npt.NDArray[np.int32]]:
        """Corners of the visible markers (1, 4, 2) [px], and their numbers (n,)."""
        _, _, corners, numbers = self._detector.detectBoard(gray)
        if numbers is None:
            return [], np.zeros(0, dtype=np.int32)
        return [np.asarray(each, dtype=np.float32) for each in corners], np.asarray(numbers, dtype=np.int32).ravel()


Board = Chessboard | CharucoBoard


def board_from(
    size: str, square: float, dictionary: str | None = None, marker: float | None = None, legacy: bool = False
) -> Board:
    """The board of the options --board, --square, --charuco, --marker and --legacy. Raises InputError."""
    sides = re.fullmatch(r"(\d{1,3})x(\d{1,3})", size)
    if sides is None or min(columns := int(sides[1]), rows := int(sides[2])) < 3:
        raise InputError(f"--board must be COLUMNSxROWS from 3 to 999 each, as in 9x6, not {size!r}")
    _check_length("--square", square)
    if dictionary is None:
        if marker is not None or legacy:
            raise InputError("--marker and --legacy belong to a ChArUco board; give --charuco too")
        return Chessboard(columns, rows, square)
    name = dictionary.upper().removeprefix("DICT_")
    if name not in DICTIONARIES:
        raise InputError(unknown("--charuco dictionary", dictionary, DICTIONARIES))
    if marker is None:
        raise InputError("a ChArUco board needs --marker, the length of a marker's side [m]")
    if marker >= square:
        raise InputError(f"--marker {marker:g} must be below --square {square:g}: markers lie inside of squares")
    _check_length("--marker", marker)
    board = CharucoBoard(columns, rows, square, marker, name, legacy)
    needed, held = columns * rows // 2, len(board.markers.bytesList)
    if needed > held:
        raise InputError(f"a board of {size} squares needs {needed} markers, but {name} has {held}")
    return board


DICTIONARIES = tuple(
    sorted(name.removeprefix("DICT_") for name in dir(cv2.aruco) if name.startswith("DICT_") and name == name.upper())
)
"""Names of the marker dictionaries of OpenCV."""


def _misfit(places: Floats, pixels: Floats) -> float:
    """Median error [m] of places (n, 2) on a board that a plane's picture has at pixels (n, 2)."""
    plane, _ = cv2.findHomography(pixels, places)
    if plane is None:
        return math.inf
    there = cv2.perspectiveTransform(pixels[:, None], plane)[:, 0]
    return float(np.median(np.linalg.norm(there - places, axis=1)))


def _refined(gray: Image, pixels: Floats, reach: float) -> Floats:
    """Pixels (n, 2) of corners, moved to where the edges around them cross.

    reach: distance up to which only these edges are visible, as a share of the distance between corners.
    The detectors fit straight edges over whole squares, which is wrong by up to a pixel for wide lenses.
    """
    apart = np.linalg.norm(pixels[:, None] - pixels, axis=2)
    spacing = float(apart[apart > 0.0].min())
    window = int(np.clip(reach * spacing, 2, 6))
    stop = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 40, 1e-3)
    start = pixels.astype(np.float32).reshape(-1, 1, 2)
    found = cv2.cornerSubPix(gray, start, (window, window), (-1, -1), stop).reshape(-1, 2)
    near = np.linalg.norm(found - pixels, axis=1) < 0.2 * spacing
    return np.where(near[:, None], found, pixels).astype(np.float64)


def _check_length(name: str, value: float) -> None:
    if value > 1.0:
        raise InputError(
            f"{name} must be a length in meters, at most 1, not {value:g}; {value:g} mm are {value / 1000:g}"
        )
    if not value > 0.0:
        raise InputError(f"{name} must be a length above 0 m, as in 0.03, not {value:g}")


Rectangle = tuple[float, float, float, float]
"""Left and upper edge, width and height [mm]."""


def board_svg(board: Board) -> str:
    """An SVG drawing of a board in its true size, with a white margin as wide as a square."""
    inner = 0 if isinstance(board, CharucoBoard) else 1
    side = 1000.0 * board.square
    width, height = ((count + inner + 2) * side for count in (board.columns, board.rows))
    black = _charuco(board) if isinstance(board, CharucoBoard) else _chessboard(board.columns + 1, board.rows + 1, side)
    shapes = "".join(
        f'<rect x="{x + side:.4f}" y="{y + side:.4f}" width="{w:.4f}" height="{h:.4f}"/>\n' for x, y, w, h in black
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:g}mm" height="{height:g}mm" '
        f'viewBox="0 0 {width:g} {height:g}" shape-rendering="crispEdges">\n'
        f'<path fill="white" d="M0 0H{width:g}V{height:g}H0z"/>\n{shapes}</svg>\n'
    )


def _chessboard(columns: int, rows: int, side: float) -> Iterator[Rectangle]:
    """The black squares."""
    for row in range(rows):
        for column in range(row % 2, columns, 2):
            yield column * side, row * side, side, side


def _charuco(board: CharucoBoard) -> Iterator[Rectangle]:
    """The black squares, and the black modules of the markers in the white ones."""
    side = 1000.0 * board.square
    white = set()
    for number, corners in enumerate(board.marker_corners()):
        x, y = 1000.0 * corners.min(axis=0)
        white.add((int(x // side), int(y // side)))
        modules = cv2.aruco.generateImageMarker(board.markers, number, board.markers.markerSize + 2)
        step = 1000.0 * board.marker / len(modules)
        for row, column in np.argwhere(modules == 0):
            yield x + column * step, y + row * step, step, step
    for row in range(board.rows):
        for column in range(board.columns):
            if (column, row) not in white:
                yield column * side, row * side, side, side
