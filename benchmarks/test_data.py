"""Renders test sets under maps that no training uses: `make test-data HDRI=folder-of-maps`.

OUT/field: a ball among robots, goals, lines and people, with uniform distances, 1280 x 1024 px. OUT/clutter: also the
other things of the training pictures: furniture, bags and boxes, domes, discs, balloons, balls of other sizes, flat
balls, and balls that are half hidden or in the air. OUT/grid: scenes like those of field with three lenses, two sizes
and three heights; both sizes show the same scenes. OUT/demo: the images, lenses and scenes of tests/fixtures/demo.
OUT/bright: overexposed pictures of balls without a pattern. OUT/on-lines: black and white balls on lines near the
camera. Earlier networks missed many balls of these two kinds.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from itertools import product
from pathlib import Path

SCENES = Path(__file__).parents[1] / "export" / "vm_synth"
FIELD_PICTURES, CLUTTER_PICTURES, GRID_PICTURES, MISSED_PICTURES = 400, 400, 40, 200
LENSES = ("rectilinear", "equisolid", "equidistant")
SIZES = ((640, 512), (1280, 1024))
HEIGHTS = (0.4, 0.8, 1.2)
UNCLUTTERED = (
    "things.round_things=[0, 0]",
    "things.clutter=[0, 0]",
    "things.furniture=[0, 0]",
    "ball.hidden=0",
    "ball.off_plane=0",
    "ball.wrong_size=0",
)


LARGE = ("camera.picture_width=1280", "camera.picture_height=1024", "ball.even=1.0")
"""Entries of pictures like those of robots, with balls that are spread evenly over the distances."""


def render(
    hdri: Path, out: Path, count: int, seed: int, *entries: str, scenes: str = "soccer", held_out: bool = True
) -> None:
    """A set under the held-out maps, or under those of the training. scenes: name of a configuration in vm_synth."""
    command = [sys.executable, "-m", "vm_synth", str(out), "--hdri", str(hdri)]
    command += ["--held-out"] * held_out
    command += ["--count", str(count), "--seed", str(seed), "--config", str(SCENES / f"{scenes}.toml")]
    for entry in entries:
        command += ["--set", entry]
    subprocess.run(command, check=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("hdri", type=Path, help="folder of maps")
    parser.add_argument("out", type=Path, help="folder for the sets")
    options = parser.parse_args()
    render(options.hdri, options.out / "field", FIELD_PICTURES, 11, *LARGE, *UNCLUTTERED)
    render(options.hdri, options.out / "clutter", CLUTTER_PICTURES, 9, *LARGE)
    near = ("ball.radius=[0.095,0.095]", "ball.missing=0", "ball.hidden=0", "ball.distance=[0.4,5]")
    render(options.hdri, options.out / "demo", 12, 22, *near)
    seen = ("ball.missing=0", "ball.hidden=0", "ball.touched=0")
    bright = (*seen, "ball.distance=[0.4, 6]", "ball_design.bright=1", "sensor.bright_share=1")
    render(options.hdri, options.out / "bright", MISSED_PICTURES, 31, *LARGE, *bright, scenes="varied")
    on_lines = (*seen, "ball.distance=[0.8, 1.5]", "ball.on_line=1", "ball_design.bright=0", "ball_design.white=1")
    render(options.hdri, options.out / "on-lines", MISSED_PICTURES, 32, *LARGE, *on_lines, scenes="varied")
    for lens, (width, height), above in product(LENSES, SIZES, HEIGHTS):
        entries = (
            f"camera.picture_width={width}",
            f"camera.picture_height={height}",
            f'camera.projections=["{lens}"]',
            f"camera.height=[{above}, {above}]",
            "ball.even=1.0",
            "ball.distance=[0.3, 8]",
        )
        name = f"{lens}-{width}x{height}-{above}"
        render(options.hdri, options.out / "grid" / name, GRID_PICTURES, 10, *entries, *UNCLUTTERED)


if __name__ == "__main__":
    main()
