"""Renders the pictures on which the networks of the package are calibrated, which no training uses.

OUT/field and OUT/clutter: like the test sets of these names, but under the maps of the training pictures, with other
seeds.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from .test_data import LARGE, UNCLUTTERED, render

FIELD_PICTURES, CLUTTER_PICTURES = 400, 300


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("hdri", type=Path, help="folder of maps")
    parser.add_argument("out", type=Path, help="folder for the sets")
    options = parser.parse_args()
    render(options.hdri, options.out / "field", FIELD_PICTURES, 78, *LARGE, *UNCLUTTERED, held_out=False)
    render(options.hdri, options.out / "clutter", CLUTTER_PICTURES, 77, *LARGE, held_out=False)


if __name__ == "__main__":
    main()
