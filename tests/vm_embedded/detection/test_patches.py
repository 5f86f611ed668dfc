"""Patches show an object at the same place and size, sharp, through every lens, and also at the border."""

import cv2
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from vm_embedded.detection.patches import Tangents, cut_patches, patch_nodes, samples
from vm_embedded.detection.pixel_formats import FORMATS, checked_image
from vm_embedded.detection.projection import to_camera
from vm_embedded.detection.pyramid import Pyramid
from vm_embedded.geometry.radial_lenses import Equidistant, Equisolid, Rectilinear
from vm_embedded.geometry.shapes import Cylinder

from .views import SIZE, center_at, picture_of, view_at

EXTENT, SAMPLES = 1.75, 32
LENSES = [
    Rectilinear(focal_length=420.0, fov=1.8),
    Equisolid(focal_length=300.0, fov=3.0),
    Equidistant(focal_length=300.0, fov=2.6, distortion=(1e-6, 0.0)),
]

lenses = st.sampled_from(LENSES)
pixels = st.tuples(st.floats(0.0, SIZE[0] - 1.0), st.floats(0.0, SIZE[1] - 1.0))


def patch_of(view, image, center, extent=EXTENT, size=SAMPLES):
    return cut_patches(Pyramid(image, "bgr"), patch_nodes(view, Tangents.at(view, center[None]), extent), size)[0]


@given(lenses, pixels, st.floats(0.4, 1.5), st.floats(-0.2, 1.4))
def test_samples_are_at_the_pixels_of_their_rays(lens, pixel, height, pitch):
    view = view_at(height, pitch, lens)
    center = center_at(view, pixel)
    assume(np.isfinite(center).all())
    found = samples(patch_nodes(view, Tangents.at(view, center[None]), EXTENT), SAMPLES)[:, 0].transpose(1, 2, 0)
    steps = ((np.arange(SAMPLES) + 0.5) / SAMPLES * 2.0 - 1.0) * EXTENT
    down, right = np.meshgrid(steps, steps, indexing="ij")
    rays = Tangents.at(view, center[None]).rays(right.reshape(-1, 1), down.reshape(-1, 1)).reshape(-1, 3)
    camera = to_camera(rays, view.rotation)
    # The corners are nodes. Those out of view are moved, and all samples with them, so they must be in view, too.
    ends = EXTENT * np.array([[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0]])
    corners = Tangents.at(view, center[None]).rays(ends[:, :1], ends[:, 1:]).reshape(-1, 3)
    assume(lens.sees(np.concatenate([camera, to_camera(corners, view.rotation)])).all())
    exact = lens.project(camera, SIZE).reshape(SAMPLES, SAMPLES, 2)
    side = np.linalg.norm(exact[0, 0] - exact[-1, -1]) / np.sqrt(2.0) / SAMPLES
    assert np.abs(found - exact).max() < 0.25 * side + 1e-3


@pytest.mark.long
@given(lenses, pixels, st.floats(0.5, 1.5), st.floats(0.0, 1.2))
def test_a_ball_fills_the_same_disk_at_every_distance(lens, pixel, height, pitch):
    view = view_at(height, pitch, lens)
    center = center_at(view, pixel)
    assume(np.isfinite(center).all())
    outline = view.outline(center)
    assume(len(outline) == 48)
    # A patch repeats the border of the picture that it is read from, whose pixels may be several of the frame wide.
    pixel_size = max(EXTENT * np.ptp(outline, axis=0).max() / SAMPLES, 1.0)
    assume((outline > pixel_size).all() and (outline < np.array(SIZE) - 1.0 - pixel_size).all())
    assume(np.ptp(outline, axis=0).min() > 8.0)
    patch = patch_of(view, picture_of(view, center), center)[:, :, 0] / 255.0
    assert patch.mean() == pytest.approx(np.pi / (2.0 * EXTENT) ** 2, rel=0.06)
    rows, columns = np.indices(patch.shape)
    middle = (SAMPLES - 1) / 2.0
    for places in (rows, columns):
        assert (places * patch).sum() / patch.sum() == pytest.approx(middle, abs=0.5)


def test_up_is_up_and_left_is_left():
    view = view_at(roll=0.0, pitch=0.6)
    center = center_at(view, (320.0, 300.0))
    image = picture_of(view, center)
    image[:300, :, 0] = 200
    image[:, :320, 1] = 200
    patch = patch_of(view, image, center)
    blue, green = patch[:, :, 2].astype(float), patch[:, :, 1].astype(float)
    assert blue[:8].mean() > 190.0 > 10.0 > blue[-8:].mean()
    assert green[:, :4].mean() > 190.0 > 10.0 > green[:, -4:].mean()


@given(lenses, st.sampled_from([(0.0, 300.0), (639.0, 400.0), (320.0, 511.0), (0.0, 511.0)]))
def test_outside_of_the_picture_a_patch_repeats_its_border(lens, pixel):
    view = view_at(0.6, 0.7, lens)
    center = center_at(view, pixel)
    assume(np.isfinite(center).all())
    image = np.random.default_rng(1).integers(0, 256, (SIZE[1], SIZE[0], 3), dtype=np.uint8)
    nodes = patch_nodes(view, Tangents.at(view, center[None]), EXTENT)
    margin = 600
    around = cv2.copyMakeBorder(image, margin, margin, margin, margin, cv2.BORDER_REPLICATE)
    small = nodes * 0.05 + nodes[:, :, 3:4, 3:4] * 0.95  # so that both are read from the frame itself
    patch = cut_patches(Pyramid(image, "bgr"), small, SAMPLES).astype(int)
    np.testing.assert_allclose(patch, cut_patches(Pyramid(around, "bgr"), small + margin, SAMPLES), atol=8)
    assert patch.std() > 0.0


def test_rays_outside_of_the_lens_s_view_are_moved_to_its_edge():
    lens = Equisolid(focal_length=180.0, fov=2.4)
    view = view_at(0.5, 0.9, lens)
    reach = lens.scale * 2.0 * np.sin(lens.limit / 2.0)
    center = center_at(view, (319.5, 255.5 + reach - 5.0))
    table = samples(patch_nodes(view, Tangents.at(view, center[None]), EXTENT), SAMPLES)[:, 0].transpose(1, 2, 0)
    away = np.linalg.norm(table - (np.array(SIZE) - 1.0) / 2.0, axis=2)
    assert np.isfinite(table).all()
    spacing = float(np.linalg.norm(table[16, 17] - table[16, 16]))
    assert away.max() == pytest.approx(reach, abs=2.0 * spacing)  # a polynomial goes through an edge smoothly
    assert (away > reach - spacing).mean() > 0.1


@given(st.integers(0, 2**32 - 1), st.integers(1, 7))
def test_many_patches_are_the_same_as_one_by_one(seed, count):
    view = view_at()
    random = np.random.default_rng(seed)
    centers = [center_at(view, place) for place in random.random((count, 2)) * SIZE]
    centers = np.array([each for each in centers if np.isfinite(each).all()])
    assume(len(centers))
    image = random.integers(0, 256, (SIZE[1], SIZE[0], 3), dtype=np.uint8)
    together = cut_patches(Pyramid(image, "bgr"), patch_nodes(view, Tangents.at(view, centers), EXTENT), SAMPLES)
    for center, patch in zip(centers, together, strict=True):
        difference = np.abs(patch_of(view, image, center).astype(int) - patch)
        assert (difference > 12).mean() < 0.01  # sums of another order may move a sample by a rounded 1/32 px


@pytest.mark.parametrize("format", FORMATS)
def test_patches_have_the_same_colors_in_every_format(format):
    view = view_at()
    center = center_at(view, (320.0, 300.0))
    red, green, blue = 200, 120, 40
    orders = {"bgr": (blue, green, red), "rgb": (red, green, blue)}
    orders |= {"bgra": (blue, green, red, 255), "rgba": (red, green, blue, 255)}
    image = np.empty((SIZE[1], SIZE[0], len(orders.get(format, (0,)))), dtype=np.uint8)
    expected = (red, green, blue)
    if format in orders:
        image[:] = orders[format]
    elif format == "gray":
        image[:], expected = 120, (120, 120, 120)
    else:
        names = format.removeprefix("bayer_")
        for position, name in enumerate(names):
            image[position // 2 :: 2, position % 2 :: 2] = {"r": red, "g": green, "b": blue}[name]
    pyramid = Pyramid(checked_image(image, format), format)
    patch = cut_patches(pyramid, patch_nodes(view, Tangents.at(view, center[None]), EXTENT), SAMPLES)[0]
    np.testing.assert_array_equal(patch, np.broadcast_to(expected, patch.shape))


def test_a_patch_is_read_from_the_sharpest_level_that_has_a_pixel_for_each_sample():
    view = view_at(pitch=0.9)
    center = center_at(view, (320.0, 256.0))
    outline = view.outline(center)
    radius = np.ptp(outline[:, 0]) / 2.0
    for size in (128, 40, 16, 8):
        expected = int(np.log2(max(2.0 * EXTENT * radius / size, 1.0)))
        image = np.random.default_rng(0).integers(0, 256, (SIZE[1], SIZE[0], 3), dtype=np.uint8)
        pyramid = Pyramid(image, "bgr")
        cut_patches(pyramid, patch_nodes(view, Tangents.at(view, center[None]), EXTENT), size)
        assert max(pyramid._levels) == expected


@given(st.floats(0.02, 0.2), st.floats(0.2, 5.0), st.floats(1.1, 6.0), st.floats(4.0, 30.0), st.floats(0.0, 6.28))
def test_a_patch_holds_a_whole_cylinder_of_any_proportion(radius, proportion, clearance, away, heading):
    """proportion: height over radius. clearance: of the camera, in heights. away: distance in halves of its size."""
    shape = Cylinder(radius, proportion * radius)
    view = view_at()._replace(shape=shape, height=clearance * shape.object_height + 0.05)
    spot = away * shape.half_size * np.array([np.cos(heading), np.sin(heading)])
    center = np.array([*spot, shape.center_height - view.height])
    place = Tangents.at(view, center[None])
    outline = shape.outline(center, view.height)
    ahead = outline @ place.axes[0]
    across = np.stack([outline @ place.right[0], outline @ place.down[0]]) / ahead / place.radius[0]
    assert np.abs(across).max() < EXTENT
    assert np.abs(across).max() > 0.6
