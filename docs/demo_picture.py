"""Joins the pictures of `make demo` to docs/demo.jpg, the picture of the README."""

from pathlib import Path

import cv2
import numpy as np

DOCS = Path(__file__).parent
COLUMNS = 3


def main() -> None:
    pictures = [cv2.imread(str(path)) for path in sorted((DOCS.parent / "demo-out").glob("*.jpg"))]
    rows = [np.hstack(pictures[start : start + COLUMNS]) for start in range(0, len(pictures), COLUMNS)]
    sheet = cv2.resize(np.vstack(rows), None, fx=0.75, fy=0.75, interpolation=cv2.INTER_AREA)
    cv2.imwrite(str(DOCS / "demo.jpg"), sheet, [cv2.IMWRITE_JPEG_QUALITY, 85])


if __name__ == "__main__":
    main()
