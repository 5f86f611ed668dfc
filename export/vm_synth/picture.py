"""From a scene to its picture: what each pixel meets, the light that it gets, and what it counts as.

Ground and sky are computed for each pixel without noise: the sky is a look-up in the map, and on the plane under a far
map the irradiance E is constant, so ground = albedo E / pi, times the traced share of light that gets past all things.
Only pixels that things reach are traced: a few rays tell which, then many shade them.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from vm_embedded.arrays import Floats, Mask, Singles
from vm_embedded.lens import Lens, Size

from .configuration import CLASSES, GroundRanges
from .environment import Environment
from .field import ground_noise, paint_ground
from .ranges import uniform
from .scene import PlacedBall, Scene
from .smoothing import smoothed
from .solids import LABELS
from .tracer import BALL, NOTHING, OTHER, Tracer

UNLABELED = 255
"""Where the lens sees nothing."""

_LOOKS = ((0.0, 0.0), (-0.25, -0.25), (0.25, 0.25))  # where in a pixel rays look for things
_FINE, _FINEST = 4, 8  # rays a pixel and direction that shade things, and small balls
_SMALL = 2500  # [px]
_SHADOW_STEP = 2  # pixels between traced shadows


@dataclass(frozen=True)
class Picture:
    """What was rendered: radiance (h, w, 3) in linear RGB, 0 where the lens sees nothing; classes (h, w) by position
    in CLASSES or UNLABELED; coverage (h, w) of each pixel by the ball, 0 to 1."""

    radiance: Singles
    classes: npt.NDArray[np.uint8]
    coverage: Singles


def render(scene: Scene, environment: Environment, tracer: Tracer, ground: GroundRanges) -> Picture:
    """Render a scene; the same scene gives the same picture."""
    random = np.random.default_rng(scene.seed)
    tracer.set(scene, environment)
    rays = _rays(scene, pixel_grid(scene.size))
    seen = np.isfinite(rays[..., 0])
    radiance, classes = _background(scene, environment, rays, random, ground)
    if scene.ball is not None or scene.other is not None or len(scene.mesh.triangles):
        below = seen & (rays[..., 2] < -1e-3)
        radiance *= _shadows(scene, rays, below, tracer, random)
    coverage = np.zeros(seen.shape, dtype=np.float32)
    busy, round_ = _busy(scene, tracer, rays)
    _shade(scene, tracer, busy & ~round_, _FINE, True, radiance, classes, coverage)
    _shade(scene, tracer, busy & round_, _FINEST, False, radiance, classes, coverage)
    radiance[~seen] = 0.0
    classes[~seen] = UNLABELED
    return Picture(radiance, classes, coverage)


def pixel_grid(size: Size) -> Floats:
    """Centers (h, w, 2) of all pixels."""
    x, y = np.meshgrid(np.arange(size[0], dtype=np.float64), np.arange(size[1], dtype=np.float64))
    return np.stack([x, y], axis=-1)


def _rays(scene: Scene, pixels: Floats) -> Floats:
    """Rays (..., 3) of the world through pixels (..., 2); NaN where the lens sees nothing."""
    rays = scene.lens.unproject(pixels.reshape(-1, 2), scene.size)
    rays[~scene.lens.sees(rays)] = np.nan
    return (rays @ scene.orientation.rotation.T).reshape(*pixels.shape[:-1], 3)


def _background(
    scene: Scene, environment: Environment, rays: Floats, random: np.random.Generator, ground: GroundRanges
) -> tuple[Singles, npt.NDArray[np.uint8]]:
    """Radiance (h, w, 3) and classes (h, w) of a scene without things and shadows."""
    up = np.array([0.0, 0.0, 1.0])
    safe = np.where(np.isfinite(rays), rays, up)
    radiance = environment.toward(safe)
    classes = np.full(rays.shape[:2], CLASSES.index("environment"), dtype=np.uint8)
    below = safe[..., 2] < -1e-4
    with np.errstate(divide="ignore"):
        distance = np.where(below, scene.orientation.height / -safe[..., 2], np.inf)
    points = np.where(below[..., None], safe[..., :2] * np.where(below, distance, 0.0)[..., None], np.inf)
    pixel = _pixel_angle(scene.lens, scene.size)
    if scene.field is None:
        strength = uniform(random, ground.detail)
        grain = ground_noise(points, np.where(below, distance, 1.0) * pixel, scene.seed)
        radiance *= 1.0 + strength * grain * below[..., None]
        return radiance, classes
    albedo, lines, carpet = paint_ground(scene.field, points, np.where(below, distance, 1e6), pixel)
    light = 1.0 + uniform(random, ground.light) * ground_light(points, scene.seed)
    lit = albedo * (environment.irradiance / np.pi).astype(np.float32) * light[..., None]
    radiance += carpet[..., None] * (lit - radiance)
    classes[carpet > 0.5] = CLASSES.index("field")
    classes[(lines * carpet) > 0.5] = CLASSES.index("line")
    return radiance, classes


def ground_light(points: Floats, seed: int) -> Singles:
    """Slow changes (h, w) of the light over the plane, within -1 to 1."""
    random = np.random.default_rng(seed)
    turn, length = random.uniform(0.0, 2.0 * np.pi, 3), random.uniform(3.0, 9.0, 3)
    safe = np.where(np.isfinite(points), points, 0.0)
    waves = [
        np.sin((safe @ [np.cos(a), np.sin(a)]) * (2.0 * np.pi / each) + a) for a, each in zip(turn, length, strict=True)
    ]
    return np.asarray(sum(waves) / 3.0, dtype=np.float32)


def _pixel_angle(lens: Lens, size: Size) -> float:
    """Angle [rad] between two pixels in the middle of the picture."""
    middle = np.array([[size[0] / 2.0, size[1] / 2.0], [size[0] / 2.0 + 1.0, size[1] / 2.0]])
    first, second = lens.unproject(middle, size)
    return float(np.arccos(np.clip(first @ second, -1.0, 1.0)))


def _shadows(scene: Scene, rays: Floats, below: Mask, tracer: Tracer, random: np.random.Generator) -> Singles:
    """Share (h, w, 3) of light that reaches what the pixels see of the plane; 1 elsewhere."""
    step = _SHADOW_STEP
    offset = step // 2
    coarse, here = rays[offset::step, offset::step], below[offset::step, offset::step]
    points = coarse[here][:, :2] * (scene.orientation.height / -coarse[here][:, 2])[:, None]
    near = _near(scene, points)
    share = np.ones((*here.shape, 3), dtype=np.float32)
    found = np.ones((len(points), 3), dtype=np.float32)
    found[near] = tracer.shadows(points[near], random)
    share[here] = found
    share = cv2.GaussianBlur(share, (0, 0), 0.8)
    height, width = below.shape
    x, y = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32))
    share = cv2.remap(
        share, (x - offset) / step, (y - offset) / step, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )
    share[~below] = 1.0
    return np.asarray(share, dtype=np.float32)


def _near(scene: Scene, points: Floats) -> Mask:
    """Which places (n, 2) can be in a shadow: those not farther from all things than six times their height."""
    near = np.zeros(len(points), dtype=bool)
    for ball in (scene.ball, scene.other):
        if ball is not None:
            reach = ball.radius + 6.0 * (ball.center[2] + ball.radius)
            near |= ((points - ball.center[:2]) ** 2).sum(axis=1) < reach**2
    vertices, last = scene.mesh.vertices, 0
    for count in scene.counts:
        body = vertices[last : last + count]
        last += count
        low, high = body[:, :2].min(axis=0), body[:, :2].max(axis=0)
        outside = np.maximum(np.maximum(low - points, points - high), 0.0)
        near |= (outside**2).sum(axis=1) < (6.0 * float(body[:, 2].max()) + 0.05) ** 2
    return near


def _busy(scene: Scene, tracer: Tracer, rays: Floats) -> tuple[Mask, Mask]:
    """Which pixels (h, w) things may reach, and which of these a small ball may."""
    seen = np.isfinite(rays[..., 0])
    grid = pixel_grid(scene.size)
    met = np.zeros(seen.shape, dtype=bool)
    for offset in _LOOKS:
        looking = (_rays(scene, grid + offset) if any(offset) else rays).reshape(-1, 3)
        good = np.flatnonzero(np.isfinite(looking[:, 0]))
        met.reshape(-1)[good] |= tracer.meets(scene.camera, looking[good].astype(np.float32)) != NOTHING
    round_ = np.zeros(seen.shape, dtype=bool)
    for ball in (scene.ball, scene.other):
        if ball is not None:
            around = _around(scene, rays, ball)
            met |= around
            if around.sum() < _SMALL:
                round_ |= around
    kernel = np.ones((3, 3), np.uint8)
    busy = cv2.dilate(met.astype(np.uint8), kernel).astype(bool)
    return busy & seen, round_


def _around(scene: Scene, rays: Floats, ball: PlacedBall) -> Mask:
    """Pixels (h, w) within two pixels of a ball's outline or inside it."""
    toward = ball.center - scene.camera
    distance = float(np.linalg.norm(toward))
    angle = np.arcsin(min(ball.radius / distance, 1.0)) + 2.0 * _pixel_angle(scene.lens, scene.size)
    with np.errstate(invalid="ignore"):
        return np.asarray(rays @ (toward / distance) > np.cos(min(angle, np.pi)))


def _subpixels(side: int) -> Floats:
    """Offsets (side^2, 2) of rays in a pixel."""
    steps = (np.arange(side) + 0.5) / side - 0.5
    return np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)


def _shade(
    scene: Scene,
    tracer: Tracer,
    chosen: Mask,
    rays_a_side: int,
    smooth: bool,
    radiance: Singles,
    classes: npt.NDArray[np.uint8],
    coverage: Singles,
) -> None:
    """Trace the chosen pixels (h, w) and write what they show into radiance, classes and coverage."""
    rows, columns = np.nonzero(chosen)
    if not len(rows):
        return
    offsets = _subpixels(rays_a_side)
    pixels = np.stack([columns, rows], axis=-1)[:, None].astype(np.float64) + offsets
    rays = _rays(scene, pixels).reshape(-1, 3)
    rays[~np.isfinite(rays[:, 0])] = (0.0, 0.0, 1.0)
    single = rays.astype(np.float32)
    what = tracer.meets(scene.camera, single)
    thing = what != NOTHING
    count = len(offsets)
    light = tracer.radiance(scene.camera, single, count, scene.seed + rays_a_side)
    np.minimum(light, 30.0 * max(float(radiance.mean()), 1e-6), out=light)  # no fireflies
    inside = thing.reshape(len(rows), count, 1)
    share = inside.mean(axis=1, dtype=np.float32)
    shown = _mean(light, inside)
    if smooth:
        shown = _without_grain(scene, tracer, single, inside, shown, rows, columns)
    radiance[rows, columns] += share * (shown - radiance[rows, columns])
    what = what.reshape(len(rows), count)
    coverage[rows, columns] = (what == BALL).mean(axis=1, dtype=np.float32)
    classes[rows, columns] = _majority(scene, what, classes[rows, columns])


def _mean(values: Singles, inside: Mask) -> Singles:
    """Means (n, c) over the rays of each pixel that are inside (n, k, 1), of values (n k, c)."""
    values = values.reshape(*inside.shape[:2], -1)
    total = np.where(inside, values, 0.0).sum(axis=1, dtype=np.float32)
    return np.asarray(total / np.maximum(inside.sum(axis=1), 1), dtype=np.float32)


def _without_grain(
    scene: Scene,
    tracer: Tracer,
    rays: Singles,
    inside: Mask,
    light: Singles,
    rows: npt.NDArray[np.intp],
    columns: npt.NDArray[np.intp],
) -> Singles:
    """Light (n, 3) of the pixels at rows and columns (n,) without the grain of few rays."""
    surfaces = tracer.surfaces(scene.camera, rays)
    top, left = rows.min(), columns.min()
    box = (rows - top, columns - left)
    size = (int(box[0].max()) + 1, int(box[1].max()) + 1)

    def spread(values: Singles, empty: float) -> Singles:
        field = np.full((*size, values.shape[1]), empty, dtype=np.float32)
        field[box] = values
        return field

    depth = np.where(np.isfinite(surfaces.depth), surfaces.depth, 1.0)
    found = smoothed(
        spread(light, 0.0),
        spread(_mean(surfaces.albedo, inside), 0.0),
        spread(_mean(surfaces.normal, inside), 0.0),
        np.maximum(spread(_mean(depth, inside), 1.0)[..., 0], 1e-3),
        spread(inside.mean(axis=1, dtype=np.float32), 0.0)[..., 0],
    )
    return np.asarray(found[box])


def _majority(scene: Scene, what: npt.NDArray[np.int32], behind: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
    """The class (n,) of most rays (n, k) of each pixel, where those that meet nothing count as what is behind (n,)."""
    of_label = np.array([CLASSES.index(label) for label in LABELS])
    labels = np.broadcast_to(behind[:, None], what.shape).astype(np.intp)
    mesh = what >= 0
    labels[mesh] = of_label[scene.mesh.labels[what[mesh]]]
    labels[what == BALL] = CLASSES.index("ball")
    labels[what == OTHER] = CLASSES.index(scene.other_label)
    votes = np.stack([(labels == each).sum(axis=1) for each in range(len(CLASSES))], axis=1)
    return np.asarray(votes.argmax(axis=1), dtype=np.uint8)
