"""What a picture shows: camera, ground, ball and all things around, drawn from the configuration's ranges.

World frame: the plane is z = 0, z up, the camera stands over the origin.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from vm_embedded.arrays import Floats, Mask
from vm_embedded.lens import RadialLens, Size
from vm_embedded.orientation import Orientation

from .ball_design import BallDesign
from .balls import draw_design
from .bodies import draw_carrier, draw_clutter, draw_distractor, draw_furniture, draw_person, draw_robot
from .camera import draw_lens, draw_orientation
from .clutter import pedestal
from .configuration import SceneConfiguration
from .environment import Environment
from .field import Field, draw_field
from .goals import goal
from .ranges import Range, log_uniform, uniform
from .sensor import Sensor, draw_sensor
from .solids import Body, Joined, joined

_TRIES = 60
_NEAREST = 0.12  # [m] between the camera's foot and things of the scene


@dataclass(frozen=True)
class PlacedBall:
    """A sphere: center (3,) and radius [m], attitude (3, 3), looks."""

    center: Floats
    radius: float
    attitude: Floats
    design: BallDesign


@dataclass(frozen=True)
class Scene:
    """Everything that one picture shows.

    field: the soccer field, or None where the ball lies on the floor of the photograph. ball: the one to be found,
    or None where there is none of the radius that balls have here.
    other: a ball that is not, because it is of another size or off the plane; other_label says what it counts as.
    mesh: all other things, by names, each of so many vertices as counts says. ground_albedo (3,) is what the ground
    throws back at them. seed: of the paths of light.
    """

    lens: RadialLens
    size: Size
    orientation: Orientation
    field: Field | None
    ball_radius: float
    ball: PlacedBall | None
    other: PlacedBall | None
    other_label: str
    names: tuple[str, ...]
    counts: tuple[int, ...]
    mesh: Joined
    ground_albedo: tuple[float, float, float]
    sensor: Sensor
    seed: int

    @property
    def camera(self) -> Floats:
        """Where the camera is (3,) [m]."""
        return np.array([0.0, 0.0, self.orientation.height])


def draw_scene(random: np.random.Generator, ranges: SceneConfiguration, environment: Environment) -> Scene:
    """A scene under an environment map."""
    lens = draw_lens(random, ranges.camera)
    catcher = environment.floor is not None and random.random() < ranges.ground.photographed
    radius = uniform(random, ranges.ball.radius)
    missing = random.random() < ranges.ball.missing
    orientation, spot = _view(random, ranges, lens, radius, environment.floor if catcher else None)
    field = None if catcher else _field_around(random, ranges, spot, radius)

    ball = None if missing else _placed(random, ranges, np.array([*spot, radius]), radius)
    things = _Things(random, ranges, lens, orientation, field, environment.floor if catcher else None)
    if ball is not None:
        things.keep_clear(spot, radius)
        if random.random() < ranges.ball.hidden:
            things.add_between(spot, radius)
    other, label = things.other_ball(radius)
    if field is not None and random.random() < ranges.field.goals:
        things.add_goals(field)
    things.add_all(radius)
    bodies = [each for each in things.bodies if not (_pierces(each, ball) or _pierces(each, other))]
    return Scene(
        lens=lens,
        size=ranges.camera.size,
        orientation=orientation,
        field=field,
        ball_radius=radius,
        ball=ball,
        other=other,
        other_label=label,
        names=tuple(each.name for each in bodies),
        counts=tuple(len(each.vertices) for each in bodies),
        mesh=joined(bodies),
        ground_albedo=field.grass if field else environment.ground,
        sensor=draw_sensor(random, ranges.sensor),
        seed=int(random.integers(1 << 31)),
    )


def _view(
    random: np.random.Generator, ranges: SceneConfiguration, lens: RadialLens, radius: float, floor: float | None
) -> tuple[Orientation, Floats]:
    """A camera and a place (2,) for a ball that it sees, the ball's angular size being uniform."""
    for _ in range(_TRIES):
        orientation = draw_orientation(random, ranges.camera)
        low, high = ranges.ball.distance
        if floor is not None:
            high = min(high, max(orientation.height - radius, 0.0) / math.tan(floor))
        rise = max(orientation.height - radius, radius)  # a camera below the ball's top still sees it
        largest, smallest = (
            math.asin(radius / max(math.hypot(d, rise), 1.01 * radius)) for d in (min(low, high), high)
        )
        angle = random.uniform(smallest, largest)
        distance = math.sqrt(max((radius / math.sin(angle)) ** 2 - rise**2, 0.0))
        heading = random.uniform(-np.pi, np.pi, 256)
        spots = distance * np.stack([np.cos(heading), np.sin(heading)], axis=1)
        depth = np.full(len(spots), radius - orientation.height)
        rays = np.column_stack([spots, depth])
        rays /= np.linalg.norm(rays, axis=1, keepdims=True)
        cut = 0.6 * angle if random.random() < ranges.ball.cut else -1.0 * angle
        good = np.flatnonzero(_in_picture(lens, ranges.camera.size, rays @ orientation.rotation, cut))
        if len(good) and distance > _NEAREST * (orientation.height < 4.0 * radius):
            return orientation, spots[good[0]]
    return orientation, spots[0]


def _in_picture(lens: RadialLens, size: Size, rays: Floats, margin: float) -> Mask:
    """Which rays (n, 3) of the camera are in the picture or at most an angle `margin` [rad] beyond its edge."""
    pixels = lens.project(rays, size)
    center = np.array(size) / 2.0
    with np.errstate(invalid="ignore"):
        # The scale of the picture there, from a ray beside each.
        beside = rays + 1e-3 * np.cross(rays, [0.3, 0.5, 0.8])
        beside /= np.linalg.norm(beside, axis=1, keepdims=True)
        scale = np.linalg.norm(lens.project(beside, size) - pixels, axis=1)
        scale /= np.maximum(np.arccos(np.clip((beside * rays).sum(axis=1), -1.0, 1.0)), 1e-9)
        inside = (np.abs(pixels - center) <= center - 0.5 + (margin * scale)[:, None]).all(axis=1)
    return np.asarray(inside & lens.sees(rays))


def _field_around(random: np.random.Generator, ranges: SceneConfiguration, spot: Floats, radius: float) -> Field:
    """A field under the camera, and under the ball's place if it is large enough."""
    for _ in range(_TRIES):
        field = draw_field(random, ranges.field)
        if field.on_carpet(spot, 2.0 * radius):
            break
    return field


def _placed(random: np.random.Generator, ranges: SceneConfiguration, center: Floats, radius: float) -> PlacedBall:
    attitude, _ = np.linalg.qr(random.normal(size=(3, 3)))
    attitude[:, 0] *= np.sign(np.linalg.det(attitude))
    return PlacedBall(center, radius, attitude, draw_design(random, ranges.ball_design))


class _Things:
    """The things of a scene while it is drawn."""

    def __init__(
        self,
        random: np.random.Generator,
        ranges: SceneConfiguration,
        lens: RadialLens,
        orientation: Orientation,
        field: Field | None,
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
        self._taken: list[tuple[Floats, float]] = [(np.zeros(2), _NEAREST)]

    def keep_clear(self, spot: Floats, radius: float) -> None:
        """Nothing may stand within a radius [m] of a place (2,)."""
        self._taken.append((spot, radius))

    def add_all(self, ball_radius: float) -> None:
        """Draw and place as many of each kind as configured."""
        random, things, bodies = self._random, self._ranges.things, self._ranges.bodies
        for _ in range(self._count(things.robots)):
            self._add(draw_robot(random, bodies))
        for _ in range(self._count(things.clutter)):
            self._add(draw_clutter(random, bodies))
        for _ in range(self._count(things.round_things)):
            self._add(draw_distractor(random, bodies, ball_radius))
        for _ in range(self._count(things.furniture)):
            self._add(draw_furniture(random, bodies))
        for _ in range(self._count(things.people)):
            self._add(draw_person(random, bodies))
        if random.random() < things.carrier:
            carrier = draw_carrier(random, bodies, self._orientation.height)
            if carrier is not None:
                self.bodies.append(carrier.moved(self._orientation.yaw, (0.0, 0.0, 0.0)))

    def add_goals(self, field: Field) -> None:
        """Two goals, where their field has them."""
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
        """A thing between the camera and the place (2,) of the ball, a little to its side."""
        random = self._random
        draw = (draw_robot, draw_clutter, draw_person, draw_furniture)[int(random.choice(4, p=[0.35, 0.4, 0.15, 0.1]))]
        bodies = draw(random, self._ranges.bodies)
        half = _reach(bodies)
        distance = float(np.linalg.norm(spot))
        ahead = np.array(spot) / max(distance, 1e-9)
        near, far = _NEAREST + half, distance - half - 0.7 * radius
        if far <= near:
            return
        along = random.uniform(0.5 * (near + far), far)
        aside = random.uniform(-1.0, 1.0) * (half + 0.8 * radius * along / distance)
        self._put(bodies, along * ahead + aside * np.array([-ahead[1], ahead[0]]), half)

    def other_ball(self, radius: float) -> tuple[PlacedBall | None, str]:
        """A ball of another size on the plane, or one of the same size off it, and its label."""
        random, ranges = self._random, self._ranges.ball
        kind = random.random()
        if kind < ranges.off_plane:
            height = log_uniform(random, ranges.off_plane_height)
            stand = pedestal(random, height, 2.0 * radius * random.uniform(1.2, 3.0))
            spot = self._free(_reach(stand))
            if spot is None:
                return None, ranges.off_plane_label
            if random.random() < 0.8:
                self._put(stand, spot, _reach(stand))
            self.keep_clear(spot, _reach(stand))
            return _placed(random, self._ranges, np.array([*spot, height + radius]), radius), ranges.off_plane_label
        if kind < ranges.off_plane + ranges.wrong_size:
            factor = uniform(random, ranges.larger if random.random() < 0.5 else ranges.smaller)
            spot = self._free(factor * radius)
            if spot is not None:
                self.keep_clear(spot, factor * radius)
                center = np.array([*spot, factor * radius])
                return _placed(random, self._ranges, center, factor * radius), "environment"
        return None, "environment"

    def _count(self, span: Range) -> int:
        return int(self._random.integers(int(span[0]), int(span[1]) + 1))

    def _add(self, bodies: list[Body]) -> None:
        half = _reach(bodies)
        spot = self._free(half)
        if spot is not None:
            self._put(bodies, spot, half)

    def _put(self, bodies: list[Body], spot: Floats, half: float) -> None:
        turn = self._random.uniform(-math.pi, math.pi)
        self.bodies += [each.moved(turn, (*spot, 0.0)) for each in bodies]
        self.keep_clear(spot, half)

    def _free(self, half: float) -> Floats | None:
        """A place (2,) in the picture with so much room [m] around it, or None."""
        random = self._random
        nearest = max(self._ranges.things.distance[0], _NEAREST + 2.0 * half)  # else it fills the picture
        if nearest >= self._farthest:
            return None
        for _ in range(_TRIES):
            distance = log_uniform(random, (nearest, self._farthest))
            heading = random.uniform(-math.pi, math.pi)
            spot = distance * np.array([math.cos(heading), math.sin(heading)])
            if self._field is not None and not self._field.on_carpet(spot, min(half, 0.3)):
                continue
            ray = np.array([*spot, min(half, 0.3) - self._orientation.height])
            ray = (ray / np.linalg.norm(ray)) @ self._orientation.rotation
            seen = _in_picture(self._lens, self._ranges.camera.size, ray[None], half / (2.0 * distance))[0]
            if seen and all(np.linalg.norm(spot - other) > half + room for other, room in self._taken):
                return spot
        return None


def _pierces(body: Body, ball: PlacedBall | None) -> bool:
    """Whether the surface of a body passes through a ball; touching it, as what it lies on does, is not enough."""
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
    # No edge does: a face may, where the foot of the perpendicular from the ball's center is within it.
    normal = np.cross(edges[:, 0], edges[:, 1])
    normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-18)
    foot = (corners[:, 0] * normal).sum(axis=-1, keepdims=True) * normal
    within = (np.cross(edges, foot[:, None] - corners) * normal[:, None]).sum(axis=-1) > 0.0
    return bool((within.all(axis=-1) & (np.linalg.norm(foot, axis=-1) < inner)).any())


def _reach(bodies: list[Body]) -> float:
    """Largest horizontal distance [m] of bodies' vertices from the vertical through the origin."""
    return max(float(np.hypot(each.vertices[:, 0], each.vertices[:, 1]).max()) for each in bodies)
