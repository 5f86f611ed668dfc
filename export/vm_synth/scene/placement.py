"""Places the objects of a scene: visible, on the ground and apart from each other."""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from vm_embedded.arrays import Floats, Mask
from vm_embedded.geometry.lens import Size
from vm_embedded.geometry.orientation import Orientation
from vm_embedded.geometry.radial_lenses import RadialLens
from vm_workstation.ranges import log_uniform, uniform

from ..balls.draw_design import draw_design
from ..bodies.catalog import (
    draw_carrier,
    draw_clutter,
    draw_distractor,
    draw_furniture,
    draw_person,
    draw_robot,
    draw_shoes,
)
from ..bodies.clutter import pedestal
from ..bodies.goals import goal
from ..bodies.solids import Body
from .configuration import SceneConfiguration
from .field import Field
from .scene import PlacedBall
from .surface import Surface

ATTEMPTS = 60
NEAREST = 0.12  # [m], smallest distance on the plane between camera and objects

_ASIDE = math.radians(110.0)
"""Largest angle at the ball between the direction away from the camera and what touches the ball."""

_TOUCH, _HALVINGS = 0.04, 4
"""Step in which something approaches the ball [m], and how often the last step is halved."""


def in_picture(lens: RadialLens, size: Size, rays: Floats, margin: float) -> Mask:
    """Which rays (n, 3) of the camera hit the picture, or miss it by at most an angle `margin` [rad]."""
    pixels = lens.project(rays, size)
    center = np.array(size) / 2.0
    with np.errstate(invalid="ignore"):
        # The local scale of the picture [px/rad], from a second ray close to each.
        beside = rays + 1e-3 * np.cross(rays, [0.3, 0.5, 0.8])
        beside /= np.linalg.norm(beside, axis=1, keepdims=True)
        scale = np.linalg.norm(lens.project(beside, size) - pixels, axis=1)
        scale /= np.maximum(np.arccos(np.clip((beside * rays).sum(axis=1), -1.0, 1.0)), 1e-9)
        inside = (np.abs(pixels - center) <= center - 0.5 + (margin * scale)[:, None]).all(axis=1)
    return np.asarray(inside & lens.sees(rays))


def draw_ball_at(random: np.random.Generator, ranges: SceneConfiguration, center: Floats, radius: float) -> PlacedBall:
    """Draw a ball with any design and attitude around a center (3,) [m].

    The mesh is not invariant to rotations of the object (paper: section "Discussion and Conclusion").
    """
    attitude, _ = np.linalg.qr(random.normal(size=(3, 3)))
    attitude[:, 0] *= np.sign(np.linalg.det(attitude))
    return PlacedBall(center, radius, attitude, draw_design(random, ranges.ball_design))


class Placement:
    """Draws the objects of one scene and finds free places for them."""

    def __init__(
        self,
        random: np.random.Generator,
        ranges: SceneConfiguration,
        lens: RadialLens,
        orientation: Orientation,
        field: Field | Surface | None,
        floor: float | None,
    ) -> None:
        self.bodies: list[Body] = []
        self._random = random
        self._ranges = ranges
        self._lens = lens
        self._orientation = orientation
        self._field = field
        self._farthest = ranges.things.distance[1]
        if floor is not None:
            self._farthest = min(self._farthest, orientation.height / math.tan(floor))
        self._taken: list[tuple[Floats, float]] = [(np.zeros(2), NEAREST)]

    def keep_clear(self, spot: Floats, radius: float) -> None:
        """Reserve the area within a radius [m] of a spot (2,) [m]."""
        self._taken.append((spot, radius))

    def add_all(self, ball_radius: float) -> None:
        """Draw and place the configured numbers of all kinds of objects."""
        random, things, bodies = self._random, self._ranges.things, self._ranges.bodies
        for numbers, draw in (
            (things.robots, draw_robot),
            (things.clutter, draw_clutter),
            (things.round_things, partial(draw_distractor, ball_radius=ball_radius)),
            (things.furniture, draw_furniture),
            (things.people, draw_person),
        ):
            for _ in range(int(random.integers(int(numbers[0]), int(numbers[1]) + 1))):
                self.add(draw(random, bodies))
        if random.random() < things.carrier:
            carrier = draw_carrier(random, bodies, self._orientation.height)
            if carrier is not None:
                self.bodies.append(carrier.moved(self._orientation.yaw, (0.0, 0.0, 0.0)))

    def add(self, bodies: list[Body]) -> None:
        """Place bodies at a free spot, if there is one."""
        half = _reach(bodies)
        spot = self._free(half)
        if spot is not None:
            self._put(bodies, spot, half)

    def add_goals(self, field: Field) -> None:
        """Place two goals at the ends of their field."""
        ranges = self._ranges.field
        width, height = uniform(self._random, ranges.goal_width), uniform(self._random, ranges.goal_height)
        for side in (-1.0, 1.0):
            place = np.array(field.middle) + field.rotation @ np.array([side * field.length / 2.0, 0.0])
            if np.linalg.norm(place) > 0.75 * width:
                heading = field.heading + (math.pi if side > 0 else 0.0)
                bodies = goal(self._random, min(width, 0.8 * field.width), height, 0.35 * width)
                self.bodies += [each.moved(heading, (*place, 0.0)) for each in bodies]
                self.keep_clear(place, 0.6 * width)

    def add_between(self, spot: Floats, radius: float) -> None:
        """Place an object between the camera and the spot (2,) [m] of the ball, slightly to its side."""
        random = self._random
        draw = (draw_robot, draw_clutter, draw_person, draw_furniture)[int(random.choice(4, p=[0.35, 0.4, 0.15, 0.1]))]
        bodies = draw(random, self._ranges.bodies)
        half = _reach(bodies)
        distance = float(np.linalg.norm(spot))
        ahead = np.array(spot) / max(distance, 1e-9)
        near, far = NEAREST + half, distance - half - 0.7 * radius
        if far <= near:
            return
        along = random.uniform(0.5 * (near + far), far)
        aside = random.uniform(-1.0, 1.0) * (half + 0.8 * radius * along / distance)
        self._put(bodies, along * ahead + aside * np.array([-ahead[1], ahead[0]]), half)

    def add_touching(self, ball: PlacedBall) -> None:
        """Place a robot, a person or shoes so that they touch the ball, mostly from behind or from the side."""
        random = self._random
        draw = (draw_robot, draw_person, draw_shoes)[int(random.choice(3, p=[0.5, 0.3, 0.2]))]
        turn = random.uniform(-math.pi, math.pi)
        bodies = [each.moved(turn, (0.0, 0.0, 0.0)) for each in draw(random, self._ranges.bodies)]
        half = _reach(bodies)
        spot = ball.center[:2]
        aside = math.atan2(spot[1], spot[0]) + random.uniform(-_ASIDE, _ASIDE)
        away = np.array([math.cos(aside), math.sin(aside)])

        def at(distance: float) -> list[Body]:
            return [each.shifted((*(spot + distance * away), 0.0)) for each in bodies]

        far = half + ball.radius
        steps = np.arange(far, -0.5 * _TOUCH, -_TOUCH).tolist()
        hit = next((each for each in steps if any(intersects_ball(one, ball) for one in at(each))), None)
        if hit is None:  # the ball fits between the legs
            return
        low, high = hit, min(hit + _TOUCH, far)
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if any(intersects_ball(one, ball) for one in at(middle)) else (low, middle)
        if np.linalg.norm(spot + high * away) > NEAREST + half:
            self.bodies += at(high)
            self.keep_clear(spot + high * away, half)

    def draw_other_ball(self, radius: float) -> tuple[PlacedBall | None, str]:
        """Draw a ball of the same size above the plane, one of the wrong size on it, or None, and its class."""
        ranges, kind = self._ranges.ball, self._random.random()
        if kind < ranges.off_plane:
            return self._draw_raised_ball(radius), ranges.off_plane_label
        if kind < ranges.off_plane + ranges.wrong_size:
            return self._draw_ball_of_wrong_size(radius), "environment"
        return None, "environment"

    def _draw_raised_ball(self, radius: float) -> PlacedBall | None:
        """A ball above the plane, mostly on a stand; None without a free spot."""
        random = self._random
        height = log_uniform(random, self._ranges.ball.off_plane_height)
        stand = pedestal(random, height, 2.0 * radius * random.uniform(1.2, 3.0))
        spot = self._free(_reach(stand))
        if spot is None:
            return None
        if random.random() < 0.8:
            self._put(stand, spot, _reach(stand))
        self.keep_clear(spot, _reach(stand))
        return draw_ball_at(random, self._ranges, np.array([*spot, height + radius]), radius)

    def _draw_ball_of_wrong_size(self, radius: float) -> PlacedBall | None:
        """A ball on the plane that is clearly larger or smaller than `radius` [m]; None without a free spot."""
        random, ranges = self._random, self._ranges.ball
        other = radius * uniform(random, ranges.larger if random.random() < 0.5 else ranges.smaller)
        spot = self._free(other)
        if spot is None:
            return None
        self.keep_clear(spot, other)
        return draw_ball_at(random, self._ranges, np.array([*spot, other]), other)

    def _put(self, bodies: list[Body], spot: Floats, half: float) -> None:
        turn = self._random.uniform(-math.pi, math.pi)
        self.bodies += [each.moved(turn, (*spot, 0.0)) for each in bodies]
        self.keep_clear(spot, half)

    def _free(self, half: float) -> Floats | None:
        """A visible spot (2,) [m] with this free radius [m] around it, or None."""
        random = self._random
        nearest = max(self._ranges.things.distance[0], NEAREST + 2.0 * half)  # a closer object would fill the picture
        if nearest >= self._farthest:
            return None
        for _ in range(ATTEMPTS):
            distance = log_uniform(random, (nearest, self._farthest))
            heading = random.uniform(-math.pi, math.pi)
            spot = distance * np.array([math.cos(heading), math.sin(heading)])
            if self._field is not None and not self._field.on_carpet(spot, min(half, 0.3)):
                continue
            ray = np.array([*spot, min(half, 0.3) - self._orientation.height])
            ray = (ray / np.linalg.norm(ray)) @ self._orientation.rotation
            seen = in_picture(self._lens, self._ranges.camera.size, ray[None], half / (2.0 * distance))[0]
            if seen and all(np.linalg.norm(spot - other) > half + room for other, room in self._taken):
                return spot
        return None


def intersects_ball(body: Body, ball: PlacedBall | None) -> bool:
    """Whether the surface of a body passes through a ball. Touching it does not count."""
    if ball is None:
        return False
    inner = 0.98 * ball.radius
    if np.linalg.norm(np.maximum(np.maximum(body.low - ball.center, ball.center - body.high), 0.0)) > inner:
        return False
    corners = body.vertices[body.triangles] - ball.center
    edges = np.roll(corners, -1, axis=1) - corners
    share = -(corners * edges).sum(axis=-1) / np.maximum((edges**2).sum(axis=-1), 1e-18)
    if np.linalg.norm(corners + np.clip(share, 0.0, 1.0)[..., None] * edges, axis=-1).min() < inner:
        return True
    # No edge does. A face does if it contains the foot of the perpendicular from the ball's center.
    normal = np.cross(edges[:, 0], edges[:, 1])
    normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-18)
    foot = (corners[:, 0] * normal).sum(axis=-1, keepdims=True) * normal
    within = (np.cross(edges, foot[:, None] - corners) * normal[:, None]).sum(axis=-1) > 0.0
    return bool((within.all(axis=-1) & (np.linalg.norm(foot, axis=-1) < inner)).any())


def _reach(bodies: list[Body]) -> float:
    """Largest horizontal distance of the bodies' vertices from the origin [m]."""
    return max(float(np.hypot(each.vertices[:, 0], each.vertices[:, 1]).max()) for each in bodies)
