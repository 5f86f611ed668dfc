"""Boards to print, as drawings in millimeters."""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np

from .boards import Board, CharucoBoard

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
