"""Pictures agree with geometry: masks with outlines, shadows with things, light with the map."""

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest

from vm_embedded import read_lens_file
from vm_embedded.geometry.orientation import Orientation
from vm_embedded.geometry.radial_lenses import Equidistant, Equisolid, Rectilinear
from vm_synth.balls.draw_design import DesignRanges, draw_design
from vm_synth.bodies.clutter import carton
from vm_synth.bodies.solids import join_bodies
from vm_synth.dataset.files import CLASS_COLORS, file_of
from vm_synth.dataset.picture_writer import write_picture
from vm_synth.render.picture import UNLABELED, render
from vm_synth.render.rays import pixel_grid
from vm_synth.scene.configuration import CLASSES, GroundRanges
from vm_synth.scene.environment import Environment
from vm_synth.scene.scene import PlacedBall, Scene
from vm_synth.scene.sensor import Sensor

SIZE = (320, 256)
LENSES = {
    "rectilinear": Rectilinear(focal_length=200.0, fov=2.9),
    "equisolid": Equisolid(focal_length=120.0, fov=3.0, center=(3.0, -2.0), distortion=(2e-6, 0.0)),
    "equidistant": Equidistant(focal_length=110.0, fov=3.2),
}
BALL = CLASSES.index("ball")


def scene(lens, pitch=0.6, roll=0.1, height=0.8, spot=None, radius=0.1, bodies=(), **changes):
    """A ball, by default where the optical axis meets the plane, and bodies on a photographed floor."""
    orientation = Orientation.from_roll_pitch(height, roll, pitch, yaw=0.7)
    if spot is None:
        spot = orientation.rotation[:2, 0] * (height - radius) / max(-orientation.rotation[2, 0], 0.05)
    design = draw_design(np.random.default_rng(3), DesignRanges())
    made = Scene(
        lens=lens,
        size=SIZE,
        orientation=orientation,
        field=None,
        ball_radius=radius,
        ball=PlacedBall(np.array([*spot, radius]), radius, np.eye(3), design),
        other=None,
        other_label="environment",
        names=tuple(each.name for each in bodies),
        counts=tuple(len(each.vertices) for each in bodies),
        mesh=join_bodies(bodies),
        ground_albedo=(0.3, 0.3, 0.3),
        sensor=Sensor(),
        seed=5,
    )
    return replace(made, **changes)


def toward(made):
    """Unit ray (3,) of the camera to the ball's center, and the ball's angular radius [rad]."""
    ray = (made.ball.center - made.camera) @ made.orientation.rotation
    distance = np.linalg.norm(ray)
    return ray / distance, math.asin(made.ball.radius / distance)


TILTS = [(0.0, 0.0), (0.3, -0.2), (0.8, 0.4), (1.2, 0.0), (math.pi / 2.0, 0.3)]


@pytest.mark.parametrize(("pitch", "roll"), TILTS)
@pytest.mark.parametrize("name", LENSES)
def test_the_mask_is_the_analytic_outline_within_a_pixel(name, pitch, roll, tracer, environment):
    made = scene(LENSES[name], pitch, roll)
    if pitch == 0.0:
        made = scene(LENSES[name], pitch, roll, spot=Orientation.from_roll_pitch(1.0, yaw=0.7).rotation[:2, 0] * 2.0)
    picture = render(made, environment, tracer, GroundRanges())
    ray, angle = toward(made)
    rays = made.lens.unproject(pixel_grid(SIZE).reshape(-1, 2), SIZE)
    apart = np.arccos(np.clip(rays @ ray, -1.0, 1.0)).reshape(SIZE[::-1]) - angle
    down, right = np.gradient(apart)
    pixels = apart / np.maximum(np.hypot(down, right), 1e-9)  # from the outline, negative inside
    ball = picture.classes == BALL
    assert ball.sum() > 50
    assert (pixels[ball] < 1.0).all()
    assert (pixels[~ball & np.isfinite(pixels)] > -1.0).all()
    assert (picture.coverage[pixels < -1.0] == 1.0).all()
    assert (picture.coverage[pixels > 1.0] == 0.0).all()


@pytest.mark.parametrize("name", LENSES)
@pytest.mark.parametrize("distance", [0.3, 1.5, 5.0])
def test_the_written_lens_projects_the_true_center_onto_the_masks_center(name, distance, tracer, environment, tmp_path):
    direction = np.array([math.cos(0.75), math.sin(0.75)])
    made = scene(LENSES[name], pitch=0.9 if distance < 1.0 else 0.3, spot=distance * direction)
    picture = render(made, environment, tracer, GroundRanges())
    write_picture(tmp_path, 12, "sky", made, picture)

    file = read_lens_file(file_of(tmp_path, "lens", 12))
    assert file.lens == made.lens
    assert (file.orientation.rotation == made.orientation.rotation).all()
    assert file.orientation.height == made.orientation.height
    ray = (made.ball.center - [0.0, 0.0, file.orientation.height]) @ file.orientation.rotation
    pixel = file.lens.project((ray / np.linalg.norm(ray))[None], SIZE)[0]

    # The mask's center is the axis of the cone of its rays, each weighted by the solid angle of its pixel.
    mask = cv2.imread(str(file_of(tmp_path, "coverage", 12)), cv2.IMREAD_UNCHANGED) / 255.0
    rays = file.lens.unproject(pixel_grid(SIZE).reshape(-1, 2), SIZE).reshape(*SIZE[::-1], 3)
    solid = np.linalg.norm(np.cross(np.gradient(rays, axis=0), np.gradient(rays, axis=1)), axis=-1)
    axis = np.nansum(rays * (mask * solid)[..., None], axis=(0, 1))
    center = file.lens.project((axis / np.linalg.norm(axis))[None], SIZE)[0]
    assert np.linalg.norm(center - pixel) < 0.5


def test_masks_have_the_colors_of_the_classes(tracer, environment, tmp_path):
    made = scene(Equisolid(focal_length=120.0, fov=1.6))
    picture = render(made, environment, tracer, GroundRanges())
    write_picture(tmp_path, 0, "sky", made, picture)
    mask = cv2.imread(str(file_of(tmp_path, "mask", 0)), cv2.IMREAD_UNCHANGED)
    assert (mask[picture.classes == BALL] == (*CLASS_COLORS["ball"][::-1], 255)).all()
    unseen = picture.classes == UNLABELED
    assert unseen.any()
    assert (mask[unseen] == 0).all()
    assert (picture.radiance[unseen] == 0.0).all()


def test_what_stands_before_the_ball_hides_it_in_image_and_mask(tracer, environment):
    open_ = render(scene(LENSES["rectilinear"], pitch=0.4), environment, tracer, GroundRanges())
    made = scene(LENSES["rectilinear"], pitch=0.4)
    [box] = carton(np.random.default_rng(1), 0.4)
    before = box.moved(0.0, (*made.ball.center[:2] * 0.85, 0.0))
    hidden = render(scene(LENSES["rectilinear"], pitch=0.4, bodies=[before]), environment, tracer, GroundRanges())
    assert hidden.coverage.sum() < 0.7 * open_.coverage.sum()
    behind = box.moved(0.0, (*made.ball.center[:2] * 1.6, 0.0))
    seen = render(scene(LENSES["rectilinear"], pitch=0.4, bodies=[behind]), environment, tracer, GroundRanges())
    assert seen.coverage.sum() == pytest.approx(open_.coverage.sum(), rel=1e-3)


@pytest.mark.parametrize("label", ["environment", "ball"])
def test_a_ball_off_the_plane_counts_as_configured(label, tracer, environment):
    made = scene(LENSES["rectilinear"])
    made = replace(made, ball=None, other=made.ball, other_label=label)
    picture = render(made, environment, tracer, GroundRanges())
    assert (picture.classes == BALL).any() == (label == "ball")
    assert picture.coverage.sum() == 0.0


def test_traced_ground_is_as_bright_as_computed_ground(tracer, environment):
    """The map's irradiance E gives the plane the radiance albedo E / pi, whether it is traced or not."""
    made = replace(scene(LENSES["rectilinear"]), ball=None)
    tracer.load_scene(made, environment)
    ray = np.array([0.3, 0.2, -0.9], dtype=np.float32)
    rays = np.tile(ray / np.linalg.norm(ray), (1 << 14, 1))
    light = tracer.trace_light(made.camera, rays, np.ones(len(rays), bool), 16, seed=1).mean(axis=0)
    assert light == pytest.approx(0.3 * environment.irradiance / np.pi, rel=0.02)


def test_shadows_are_dark_under_the_ball_and_away_from_the_sun(tracer, environment):
    made = scene(LENSES["rectilinear"], spot=(1.0, 0.0))
    tracer.load_scene(made, environment)
    sun = environment.lighting((1024, 512)).toward_sun
    away = -sun[:2] / np.linalg.norm(sun[:2])
    cast = 0.1 / math.tan(math.asin(sun[2]))  # from the foot to the shadow's middle
    places = np.array([[1.0, 0.0], [1.0, 0.0] + cast * away, [1.0, 0.0] - 3.0 * cast * away, [1.0, 3.0]])
    contact, shade, sunny, far = tracer.unblocked_light(places, np.random.default_rng(0)).mean(axis=1)
    assert contact < 0.2
    assert shade < 0.6
    assert sunny > 0.9
    assert far > 0.99


def test_a_white_ball_under_an_even_sky_is_about_as_bright_as_the_sky(tracer):
    even = Environment("even", np.ones((64, 128, 3), dtype=np.float32), None)
    white = draw_design(np.random.default_rng(0), DesignRanges(kinds=("plain",), white=1.0, bright=1.0, worn=0.0))
    made = scene(LENSES["rectilinear"], pitch=0.9)
    made = replace(made, ball=replace(made.ball, design=white), ground_albedo=(0.9, 0.9, 0.9))
    picture = render(made, even, tracer, GroundRanges())
    ball = picture.radiance[picture.coverage == 1.0]
    assert 0.75 < np.median(ball) < 1.1


def test_the_same_scene_gives_the_same_picture(tracer, environment):
    [box] = carton(np.random.default_rng(1), 0.3)
    made = scene(LENSES["equisolid"], bodies=[box.moved(0.3, (0.9, -0.2, 0.0))])
    first = render(made, environment, tracer, GroundRanges())
    render(scene(LENSES["rectilinear"]), environment, tracer, GroundRanges())
    second = render(made, environment, tracer, GroundRanges())
    assert (first.radiance == second.radiance).all()
    assert (first.classes == second.classes).all()
    assert np.isfinite(first.radiance).all()
