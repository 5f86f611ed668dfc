"""Lens files, as YAML and as TOML: read, and used on an image."""

import numpy as np

from vm_embedded.errors import VisualMeshError
from vm_embedded.geometry.lens_files import read_lens_file

from .scratch import scratch

SIZE = 320, 240
_PIXELS = np.array([(0.0, 0.0), (160.0, 120.0), (319.0, 239.0)])


def run(data: bytes) -> None:
    refusals = [error for suffix in ("yaml", "toml") if (error := _refusal(data, suffix))]
    if refusals:
        raise refusals[0]


def _refusal(data: bytes, suffix: str) -> VisualMeshError | None:
    path = scratch(f"lens.{suffix}")
    path.write_bytes(data)
    try:
        lens = read_lens_file(path).lens.for_image(SIZE)
        rays = lens.unproject(_PIXELS, SIZE)
        lens.project(rays[np.isfinite(rays).all(axis=1)], SIZE)
    except VisualMeshError as error:
        return error
    return None
