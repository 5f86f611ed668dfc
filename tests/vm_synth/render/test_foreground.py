"""The search for objects in tiles of the picture."""

import numpy as np
import pytest

from vm_synth.render import foreground
from vm_synth.render.rays import pixel_grid, rays_through
from vm_synth.scene.draw_scene import draw_scene


@pytest.mark.parametrize("seed", range(8))
def test_the_tiles_that_are_left_out_show_no_object(seed, tracer, environment, defaults, monkeypatch):
    scene = draw_scene(np.random.default_rng(seed), defaults, environment)
    tracer.load_scene(scene, environment)
    rays = rays_through(scene, pixel_grid(scene.size))
    near = foreground._near_objects(scene, rays)
    found = foreground._find_objects(scene, tracer, rays)
    monkeypatch.setattr(foreground, "_near_objects", lambda scene, rays: np.ones(rays.shape[:2], dtype=bool))
    everywhere = foreground._find_objects(scene, tracer, rays)
    for ours, all_of_them in zip(found, everywhere, strict=True):
        np.testing.assert_array_equal(ours, all_of_them)
    assert not near.all()
