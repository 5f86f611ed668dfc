"""Finds a board in the frames of a video or folder, and chooses frames that are sharp and cover the picture."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np

from vm_embedded.arrays import Floats, Image
from vm_embedded.cameras.image_files import open_source
from vm_embedded.cli.program import complain
from vm_embedded.cli.progress import ProgressBar
from vm_embedded.errors import InputError
from vm_embedded.geometry.lens import Size

from .boards import Board, CharucoBoard, Corners

SEARCHED = 200
"""Most frames of a source in which the board is looked for; it takes up to a second in a large frame."""

_BLUR = 1.5
"""Frames whose edges are wider than this multiple of the median are left out."""


@dataclass(frozen=True, eq=False)
class BoardSighting:
    """A board in a frame. name: of the frame. corners: of the board. blur: width of the edges on the board [px]."""

    name: str
    corners: Corners
    blur: float


@dataclass
class Search:
    """What a search for a board found. size: of the frames [px]. left_out: reasons, and the number of their frames."""

    size: Size
    sightings: list[BoardSighting]
    left_out: Counter[str] = field(default_factory=Counter)


def find_boards(source: str, board: Board) -> Search:
    """Look for a board in a video, folder, glob or picture.

    Raises InputError if the source can't be read, its frames differ in size, or no frame shows the board; the message
    tells what may be wrong.
    """
    left_out = Counter[str]()
    search: Search | None = None
    best: tuple[float, Image] | None = None
    for name, image in _sharp_frames(source, left_out):
        gray = _gray(image)
        size = (gray.shape[1], gray.shape[0])
        if search is None:
            search = Search(size, [], left_out)
        elif search.size != size:
            raise InputError(
                f"{name} has {size[0]} x {size[1]} px, but frames before it have {search.size[0]} x {search.size[1]} "
                "px; all must come from one camera, uncropped"
            )
        corners = board.find(gray)
        if corners is not None:
            search.sightings.append(BoardSighting(name, corners, _edge_width(gray, corners.pixels)))
            continue
        left_out["without the board"] += 1
        sharpness = _sharpness(gray)
        if best is None or sharpness > best[0]:
            best = (sharpness, gray)
    if search is None:
        raise InputError(f"{source} has no frame that can be read")
    if not search.sightings and best is not None:
        raise InputError(_nothing_found(source, board, left_out["without the board"], best[1]))
    return search


def choose(search: Search, most: int) -> list[BoardSighting]:
    """At most `most` sharp sightings, whose boards differ in place, size and tilt; counts the others as left out."""
    limit = _BLUR * float(np.median([each.blur for each in search.sightings]))
    sharp = [each for each in search.sightings if each.blur <= limit]
    search.left_out["blurred"] += len(search.sightings) - len(sharp)
    places = np.array([_appearance(each.corners.pixels, search.size) for each in sharp])
    chosen = [int(np.argmin([each.blur for each in sharp]))]
    distance = np.full(len(sharp), np.inf)
    while len(chosen) < min(most, len(sharp)):
        distance = np.minimum(distance, np.linalg.norm(places - places[chosen[-1]], axis=1))
        chosen.append(int(np.argmax(distance)))
    search.left_out["similar to others"] += len(sharp) - len(chosen)
    return [sharp[index] for index in sorted(chosen)]


def _sharp_frames(source: str, left_out: Counter[str]) -> Iterator[tuple[str, Image]]:
    """Names and images of a source; of a long one the sharpest frame out of each of SEARCHED parts.

    Counts frames that can't be read in `left_out`.
    """
    opened = open_source(source)
    count = opened.count
    if count is None and not opened.files:
        raise InputError(f"{source} has no end; give a video file or a folder of pictures")
    if count is None:  # some videos do not tell their length
        count = sum(1 for _ in open_source(source).frames)
    length = -(-count // SEARCHED)
    progress = ProgressBar(count, "vm-calibrate", unit="frames")
    best: tuple[float, str, Image] | None = None
    try:
        for frame in opened.frames:
            name = frame.source if frame.path is not None else f"frame {frame.index}"
            try:
                image = frame.read()
                sharpness = _sharpness(_gray(image)) if length > 1 else 0.0
                if best is None or sharpness > best[0]:
                    best = (sharpness, name, image)
            except InputError:
                left_out["unreadable"] += 1
            if best is not None and (frame.index + 1) % length == 0:
                yield best[1:]
                best = None
            progress.advance()
        if best is not None:
            yield best[1:]
    finally:
        progress.clear()
    for remark in filter(None, opened.remarks()):
        complain("vm-calibrate", remark)


def _gray(image: Image) -> Image:
    return image if image.ndim == 2 else np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), dtype=np.uint8)


def _sharpness(gray: Image) -> float:
    """Variance of the Laplacian: larger for sharper frames of the same scene."""
    return float(cv2.Laplacian(gray, cv2.CV_32F).var())


def _edge_width(gray: Image, pixels: Floats) -> float:
    """Width [px] of the edges around corners (n, 2), in the direction with the wider ones.

    Contrast divided by the steepest slope, so that neither the distance nor the light of the board matters.
    """
    low, high = np.floor(pixels.min(axis=0)).astype(int), np.ceil(pixels.max(axis=0)).astype(int)
    part = gray[max(low[1], 0) : high[1] + 1, max(low[0], 0) : high[0] + 1].astype(np.float32)
    dark, bright = np.percentile(part, (5, 95))
    slopes = [np.percentile(np.abs(cv2.Sobel(part, cv2.CV_32F, *axis) / 8.0), 99) for axis in ((1, 0), (0, 1))]
    return float((bright - dark) / max(min(slopes), 1e-3))


def _appearance(pixels: Floats, size: Size) -> Floats:
    """Place, extent and tilt of corners (n, 2) in a picture, as shares of its width (7,)."""
    middle = pixels.mean(axis=0)
    away = pixels - middle
    (xx, xy), (_, yy) = np.cov(away.T)
    skew = np.cbrt((away**3).mean(axis=0))  # perspective: corners lie closer together on the far side
    return np.array([*middle, np.sqrt(xx), np.sqrt(yy), np.sign(xy) * np.sqrt(abs(xy)), *skew]) / size[0]


def _nothing_found(source: str, board: Board, count: int, sharpest: Image) -> str:
    """The message that no frame shows the board."""
    where = f"none of {count} frames of {Path(source).name}" if count > 1 else f"no frame of {Path(source).name}"
    other = board.other_size(sharpest)
    if isinstance(board, CharucoBoard):
        count = board.marker_count(sharpest)
        if count:
            advice = f"try --board {other}" if other is not None else "check --board, and try --legacy"
            return (
                f"{where} shows a ChArUco board of {board.columns}x{board.rows} squares, but {count} markers of "
                f"{board.dictionary} are visible; --board counts squares: {advice}"
            )
        return (
            f"{where} shows a marker of {board.dictionary}; check --charuco, light, and that markers are large enough"
        )
    if other is not None:
        return (
            f"{where} shows a chessboard with {board.columns}x{board.rows} inner corners, but one with {other} is "
            f"visible; --board counts the corners where four squares meet: try --board {other}"
        )
    return (
        f"{where} shows a chessboard with {board.columns}x{board.rows} inner corners; the whole board with a white "
        "margin must be visible, sharp and evenly lit, and --board counts the corners where four squares meet"
    )
