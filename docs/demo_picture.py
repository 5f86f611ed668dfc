"""Joins the pictures of `make demo` to docs/demo.jpg, the picture of the README; draws docs/map.png of one of them."""

from pathlib import Path

import cv2
import numpy as np

from vm_embedded import Detector, read_lens_file

DOCS = Path(__file__).parent
COLUMNS = 3


def main() -> None:
    pictures = [cv2.imread(str(path)) for path in sorted((DOCS.parent / "demo-out").glob("*.jpg"))]
    rows = [np.hstack(pictures[start : start + COLUMNS]) for start in range(0, len(pictures), COLUMNS)]
    sheet = cv2.resize(np.vstack(rows), None, fx=0.75, fy=0.75, interpolation=cv2.INTER_AREA)
    cv2.imwrite(str(DOCS / "demo.jpg"), sheet, [cv2.IMWRITE_JPEG_QUALITY, 85])
    demo = DOCS.parent / "tests" / "fixtures" / "demo"
    file = read_lens_file(demo / "lens0000002.yaml")
    detector = Detector.from_file("soccer")
    drawn = detector.detect(cv2.imread(str(demo / "image0000002.jpg")), file.orientation, file.lens).draw_map()
    cv2.imwrite(str(DOCS / "map.png"), cv2.resize(drawn, None, fx=0.6, fy=0.6, interpolation=cv2.INTER_AREA))


if __name__ == "__main__":
    main()
