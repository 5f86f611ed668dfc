"""Test sets of maps that no training saw: `make test-data HDRI=folder-of-maps`.

OUT/maps: balls at all distances alike, 1280 x 1024 px. OUT/grid: three lenses at two sizes and three heights, the same
scenes at both sizes. OUT/demo: what lies in tests/fixtures/demo, images, lenses and scenes.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from itertools import product
from pathlib import Path

SCENES = Path(__file__).parents[1] / "export" / "vm_synth" / "soccer.toml"
PICTURES, GRID_PICTURES = 800, 50
LENSES = ("rectilinear", "equisolid", "equidistant")
SIZES = ((640, 512), (1280, 1024))
HEIGHTS = (0.4, 0.8, 1.2)


def render(hdri: Path, out: Path, count: int, seed: int, *entries: str) -> None:
    """A set of the maps that are held out."""
    command = [sys.executable, "-m", "vm_synth", str(out), "--held-out", "--hdri", str(hdri)]
    command += ["--count", str(count), "--seed", str(seed), "--config", str(SCENES)]
    for entry in entries:
        command += ["--set", entry]
    subprocess.run(command, check=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("hdri", type=Path, help="folder of maps")
    parser.add_argument("out", type=Path, help="folder for the sets")
    options = parser.parse_args()
    large = ("camera.picture_width=1280", "camera.picture_height=1024")
    render(options.hdri, options.out / "maps", PICTURES, 9, *large, "ball.even=1.0")
    near = ("ball.radius=[0.095,0.095]", "ball.missing=0", "ball.hidden=0", "ball.distance=[0.4,5]")
    render(options.hdri, options.out / "demo", 12, 22, *near)
    for lens, (width, height), above in product(LENSES, SIZES, HEIGHTS):
        entries = (
            f"camera.picture_width={width}",
            f"camera.picture_height={height}",
            f'camera.projections=["{lens}"]',
            f"camera.height=[{above}, {above}]",
            "ball.even=1.0",
            "ball.distance=[0.3, 8]",
        )
        render(options.hdri, options.out / "grid" / f"{lens}-{width}x{height}-{above}", GRID_PICTURES, 10, *entries)


if __name__ == "__main__":
    main()
