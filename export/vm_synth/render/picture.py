"""Renders a scene: the light and the class of each pixel, and how much of it the ball covers.

Ground and sky are computed without noise. The sky is looked up in the map. Under a distant map the irradiance E is the
same on the whole plane, so the ground's radiance is albedo E / pi, times the share of light that objects do not block.
Only objects and their shadows are traced.

The paper's pictures come from physically based rendering, too (section "Dataset").
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
from ..scene.field import Field
from ..scene.scene import Scene
from ..scene.surface import Surface
from .foreground import trace_foreground
from .ground import ground_light, paint_ground
from .rays import pixel_angle, pixel_grid, rays_through
from .surface_paint import paint_surface
from .tracer import Tracer
from .turf import ground_noise

UNLABELED = 255
"""Class of pixels outside of the lens's field of view."""

_SHADOW_STEP = 2  # pixels between traced shadows


@dataclass(frozen=True)
class Render:
    """A rendered scene.

    radiance: linear RGB (h, w, 3), 0 outside of the lens's field of view. classes: position in CLASSES of each pixel
    (h, w), or UNLABELED. coverage: share (h, w) of each pixel that the object to detect covers. areas: visible area of
    each of the scene's objects [px^2].
    """

    radiance: Singles
    classes: npt.NDArray[np.uint8]
    coverage: Singles
    areas: tuple[float, ...] = ()


def render(scene: Scene, environment: Environment, tracer: Tracer, ground: GroundRanges) -> Render:
    """Render a scene. The same scene gives the same picture."""
    random = np.random.default_rng(scene.seed)
    tracer.load_scene(scene, environment)
    rays = rays_through(scene, pixel_grid(scene.size))
    seen = np.isfinite(rays[..., 0])
    radiance, classes, table = _background(scene, environment, rays, random, ground)
    if scene.ball is not None or scene.other is not None or len(scene.mesh.triangles):
        below = seen & (rays[..., 2] < -1e-3)
        radiance *= 1.0 + table[..., None] * (_shadows(scene, rays, below, tracer, random) - 1.0)
    foreground = trace_foreground(scene, tracer, rays, 30.0 * max(float(radiance.mean()), 1e-6))
    radiance += foreground.share[..., None] * (foreground.light - radiance)
    classes = foreground.classes_over(classes)
    radiance[~seen] = 0.0
    classes[~seen] = UNLABELED
    return Render(radiance, classes, foreground.coverage, foreground.areas)


def _background(
    scene: Scene, environment: Environment, rays: Floats, random: np.random.Generator, ground: GroundRanges
) -> tuple[Singles, npt.NDArray[np.uint8], Singles]:
    """Radiance (h, w, 3) and classes (h, w) of a scene without objects and shadows.

    Also the share (h, w) of each pixel that shows ground on which shadows fall: all but the surroundings of a table.
    """
    up = np.array([0.0, 0.0, 1.0])
    safe = np.where(np.isfinite(rays), rays, up)
    radiance = environment.radiance_along(safe)
    classes = np.full(rays.shape[:2], CLASSES.index("environment"), dtype=np.uint8)
    ground_share = np.full(rays.shape[:2], float(scene.surface is None), dtype=np.float32)
    rows = np.flatnonzero((safe[..., 2] < -1e-4).any(axis=1))
    if len(rows):
        # One more row on each side: lines are drawn from differences between neighboring pixels.
        part = slice(max(int(rows[0]) - 1, 0), int(rows[-1]) + 2)
        lower, here = safe[part], radiance[part]
        if scene.surface is not None:
            lit, share = _surface_light(scene, scene.surface, environment, lower, uniform(random, ground.light))
            here += share[..., None] * (lit - here)
            ground_share[part] = share
        elif scene.field is not None:
            lit, lines, carpet = _field_light(scene, scene.field, environment, lower, uniform(random, ground.light))
            here += carpet[..., None] * (lit - here)
            classes[part][carpet > 0.5] = CLASSES.index("field")
            classes[part][(lines * carpet) > 0.5] = CLASSES.index("line")
        else:
            here *= 1.0 + _photographed_grain(scene, lower, uniform(random, ground.detail))
    return radiance, classes, ground_share


def _surface_light(
    scene: Scene, surface: Surface, environment: Environment, rays: Floats, unevenness: float
) -> tuple[Singles, Singles]:
    """Light (h, w, 3) of a table or floor along rays (h, w, 3), and the share (h, w) of each pixel that it covers.

    unevenness: how much the light changes over the plane, as a share.
    """
    distance, points = _plane_points(scene, rays)
    albedo, share = paint_surface(surface, points, distance, pixel_angle(scene.lens, scene.size))
    lit = _lit(albedo, environment, points, surface.seed, unevenness)
    mirrored = environment.radiance_along(rays * (1.0, 1.0, -1.0))
    # A glossy top scatters bright lamps; no camera shows them unbroken.
    limit = 4.0 * float(np.median(lit)) + 1e-6
    lit += surface.shine * cv2.GaussianBlur(np.minimum(mirrored, limit), (0, 0), 3.0)
    return lit, share


def _field_light(
    scene: Scene, field: Field, environment: Environment, rays: Floats, unevenness: float
) -> tuple[Singles, Singles, Singles]:
    """Light (h, w, 3) of a field along rays (h, w, 3), and the shares (h, w) that lines and carpet cover.

    unevenness: how much the light changes over the plane, as a share.
    """
    distance, points = _plane_points(scene, rays)
    range_ = np.where(np.isfinite(distance), distance, 1e6)
    albedo, lines, carpet = paint_ground(field, points, range_, pixel_angle(scene.lens, scene.size))
    return _lit(albedo, environment, points, scene.seed, unevenness), lines, carpet


def _lit(albedo: Singles, environment: Environment, points: Floats, seed: int, unevenness: float) -> Singles:
    """Light (h, w, 3) that points (h, w, 2) [m] of the plane with this albedo reflect, without shadows."""
    light = 1.0 + unevenness * ground_light(points, seed)
    lit: Singles = albedo * (environment.irradiance / np.pi).astype(np.float32) * light[..., None]
    return lit


def _photographed_grain(scene: Scene, rays: Floats, strength: float) -> Floats:
    """Relative change (h, w, 1) of a photographed floor along rays (h, w, 3); maps are too coarse to show grain."""
    distance, points = _plane_points(scene, rays)
    below = np.isfinite(distance)
    footprint = np.where(below, distance, 1.0) * pixel_angle(scene.lens, scene.size)
    return np.asarray(strength * ground_noise(points, footprint, scene.seed) * below[..., None])


def _plane_points(scene: Scene, safe: Floats) -> tuple[Floats, Floats]:
    """Distances (h, w) [m] along rays (h, w, 3) to the plane, and where they meet it (h, w, 2) [m].

    Both are infinite for rays that do not point down.
    """
    below = safe[..., 2] < -1e-4
    with np.errstate(divide="ignore"):
        distance = np.where(below, scene.orientation.height / -safe[..., 2], np.inf)
    return distance, np.where(below[..., None], safe[..., :2] * np.where(below, distance, 0.0)[..., None], np.inf)


def _shadows(scene: Scene, rays: Floats, below: Mask, tracer: Tracer, random: np.random.Generator) -> Singles:
    """Share (h, w, 3) of the map's light that reaches the plane at each pixel; 1 for pixels above the horizon."""
    step = _SHADOW_STEP
    offset = step // 2
    coarse, here = rays[offset::step, offset::step], below[offset::step, offset::step]
    points = coarse[here][:, :2] * (scene.orientation.height / -coarse[here][:, 2])[:, None]
    possible = _maybe_shadowed(scene, points)
    share = np.ones((*here.shape, 3), dtype=np.float32)
    found = np.ones((len(points), 3), dtype=np.float32)
    found[possible] = tracer.unblocked_light(points[possible], random)
    share[here] = found
    share = cv2.GaussianBlur(share, (0, 0), 0.8)
    height, width = below.shape
    x, y = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32))
    share = cv2.remap(
        share, (x - offset) / step, (y - offset) / step, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )
    share[~below] = 1.0
    return np.asarray(share, dtype=np.float32)


def _maybe_shadowed(scene: Scene, points: Floats) -> Mask:
    """Which points (n, 2) [m] of the plane can be in a shadow: those within six heights of an object."""
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
