"""From a scene to its picture: what each pixel meets, the light that it gets, and what it counts as.

Ground and sky are computed for each pixel without noise: the sky is a look-up in the map, and on the plane under a far
map the irradiance E is constant, so ground = albedo E / pi, times the traced share of light that gets past all things.
Only the pixels that things reach are traced (things.py).
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from vm_embedded.arrays import Floats, Mask, Singles
from vm_workstation.ranges import uniform

from ..scene.configuration import CLASSES, GroundRanges
from ..scene.environment import Environment
from ..scene.field import ground_noise, paint_ground
from ..scene.scene import Scene
from .foreground import pixel_angle, pixel_grid, rays_through, trace_things
from .tracer import Tracer

UNLABELED = 255
"""Where the lens sees nothing."""

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
    rays = rays_through(scene, pixel_grid(scene.size))
    seen = np.isfinite(rays[..., 0])
    radiance, classes = _background(scene, environment, rays, random, ground)
    if scene.ball is not None or scene.other is not None or len(scene.mesh.triangles):
        below = seen & (rays[..., 2] < -1e-3)
        radiance *= _shadows(scene, rays, below, tracer, random)
    things = trace_things(scene, tracer, rays, 30.0 * max(float(radiance.mean()), 1e-6))
    radiance += things.share[..., None] * (things.light - radiance)
    classes = things.classes_before(classes)
    radiance[~seen] = 0.0
    classes[~seen] = UNLABELED
    return Picture(radiance, classes, things.coverage)


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
    pixel = pixel_angle(scene.lens, scene.size)
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
