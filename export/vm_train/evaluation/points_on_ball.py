"""How many points of a mesh fall on a ball, over its distance: the paper's figure `ball_distance_graph`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vm_embedded.arrays import Floats, Mask, Number, frozen
from vm_embedded.detection.projection import project
from vm_embedded.errors import InputError
from vm_embedded.geometry.lens import Lens, Size
from vm_embedded.geometry.orientation import Orientation
from vm_embedded.geometry.radial_lenses import Equisolid
from vm_embedded.geometry.sphere import Sphere
from vm_embedded.mesh.mesh import Mesh
from vm_embedded.mesh.models import build_mesh

from ..graphs.hexagonal import HexagonalMesh, visible_hexagonal_mesh

MESHES = ("visual", "hexagonal", "early")
"""What a curve is of. visual: our rings. hexagonal: the baseline. early: rings as wide as EarlySphere has them."""

DISTANCES: Floats = frozen(np.linspace(0.0, 10.0, 401))
"""From the point below the camera to the point below the ball's center [m]."""

BEARINGS: Floats = frozen(math.radians(25.0) * (2.0 * (np.arange(64) * (math.sqrt(5.0) - 1.0) / 2.0 % 1.0) - 1.0))
"""Where the balls lie [rad], 0 ahead of the camera: spread evenly, but in step with no ring."""

_MAX_DISTANCE = 20.0  # of a mesh [m], the reference's


@dataclass(frozen=True)
class Camera:
    """Height and attitude, lens, and size of the picture."""

    orientation: Orientation
    lens: Lens
    size: Size


PAPER_BALL = Sphere(0.075)
"""The ball of the authors' pictures."""

PAPER_CAMERA = Camera(
    Orientation.from_roll_pitch(0.9, pitch=math.radians(45.0)),
    Equisolid(focal_length=420.0, fov=2.6, size=(1280, 1024)),
    (1280, 1024),
)
"""A camera such as took the authors' pictures, which sees from below itself to the horizon.

The paper says of its figure's camera only that pictures had 1280 x 1024 px. Height and lens are those of the pictures
published with its code: 0.78 to 1.2 m, median 0.9 m; equisolid, f = 420 px, fov 1.6 to 2.6 rad.
"""


class EarlySphere(Sphere):
    """A ball as an early version of the authors' program had it: theta = 2 asin(r / (h tan(phi) + r)).

    Its +r keeps the paper's singularity (`circle_dtheta`) away, where the sine would pass 1; but rings near the
    camera's foot are then too dense, by (d + r) / d at distance d. This gives a peak at 0 m like the
    paper's; our theta gives none.
    """

    def theta(self, n: Number, height: Number) -> Number:
        return 2.0 * np.arcsin(self.radius / (height * np.tan(self.phi(n, height)) + self.radius))


@dataclass(frozen=True, eq=False)
class Curve:
    """Points on a ball over distance.

    mesh: one of MESHES. intersections: its k; a hexagonal mesh has that of the Visual Mesh whose size it shares.
    count: points on screen. distances (m,) [m]. mean, low, high (m,): points on the ball over all bearings, NaN where
    the camera shows no ball as a whole. rings (m,): rings of the Visual Mesh, or rows of the hexagonal one, that cross
    the ball; of rows the mean over all bearings.
    """

    mesh: str
    intersections: float
    count: int
    distances: Floats
    mean: Floats
    low: Floats
    high: Floats
    rings: Floats

    def at(self, distance: float) -> tuple[float, float]:
        """Mean number of points, and of rings or rows, at the nearest distance [m] that was looked at."""
        nearest = int(np.argmin(np.abs(self.distances - distance)))
        return float(self.mean[nearest]), float(self.rings[nearest])


def centers(ball: Sphere, height: float, distance: float, bearings: Floats) -> Floats:
    """Centers (m, 3) [m], relative to the camera, of balls at a distance [m] and bearings (m,) [rad]."""
    z = np.full(len(bearings), ball.center_height - height)
    return np.stack([distance * np.cos(bearings), distance * np.sin(bearings), z], axis=1)


def points_on_ball(
    rays: Floats, ball: Sphere, height: float, distance: float, bearings: Floats = BEARINGS
) -> npt.NDArray[np.int64]:
    """How many unit rays (n, 3) hit each of the balls at a distance [m] and bearings (m,) [rad]: (m,).

    A ray hits a ball if it lies within the cone around it. Rays are in the observation-plane frame; NaN hits nothing.
    """
    near, far = _inclinations(ball, height, distance)
    down = -rays[:, 2]  # only rays in the ball's band of inclination can hit it
    band = rays[(down >= math.cos(far) - 1e-9) & (down <= math.cos(max(near, 0.0)) + 1e-9)]
    hits = ball.offset(band, centers(ball, height, distance, bearings), height) < 1.0
    return np.asarray(np.count_nonzero(hits, axis=1))


def rings_across(mesh: Mesh, ball: Sphere, height: float, distance: float) -> int:
    """How many rings of a mesh cross a ball at a distance [m], on the line from the camera's foot through its middle.

    Rings that such a ball reaches on both sides of the camera's foot count twice.
    """
    near, far = _inclinations(ball, height, distance)
    phi = np.arctan2(np.hypot(mesh.rays[:, 0], mesh.rays[:, 1]), -mesh.rays[:, 2])
    rings = phi[np.append(True, np.diff(phi) > 1e-9)]
    beyond = -rings[rings > 0.0]  # the nadir is there once
    return int(np.count_nonzero((rings > near) & (rings < far)) + np.count_nonzero((beyond > near) & (beyond < far)))


def rows_across(mesh: HexagonalMesh, camera: Camera, ball: Sphere, distance: float, bearings: Floats) -> Floats:
    """How many rows of a hexagonal mesh cross each of the balls at a distance [m] and bearings (m,) [rad]: (m,)."""
    rows = np.unique(mesh.pixels[:, 1])
    height = camera.orientation.height
    counts = []
    for center in centers(ball, height, distance, bearings):
        y = _projected(ball.outline(center, height), camera)[0][:, 1]
        counts.append(np.count_nonzero((rows > y.min()) & (rows < y.max())))
    return np.array(counts, dtype=np.float64)


def shown_as_a_whole(camera: Camera, ball: Sphere, distance: float, bearings: Floats) -> Mask:
    """Which of the balls at a distance [m] and bearings (m,) [rad] are in the picture with all of their outline."""
    height = camera.orientation.height
    outlines = [ball.outline(center, height) for center in centers(ball, height, distance, bearings)]
    return np.array([_projected(outline, camera)[1].all() for outline in outlines], dtype=bool)


def points_over_distance(
    camera: Camera,
    ball: Sphere,
    intersections: Sequence[float] = (3, 4, 5),
    distances: Floats = DISTANCES,
    equal_at: float | None = None,
    early: bool = False,
) -> list[Curve]:
    """Curves of the Visual Mesh and of the hexagonal mesh for each of the intersections, and the `early` on demand.

    The hexagonal mesh has as many points on screen as the Visual Mesh or, with `equal_at`, as many on a ball at that
    distance [m]. Raises GeometryError if the camera is too low for the ball, InputError if it shows none of the mesh or
    no ball at `equal_at`.
    """
    camera = Camera(camera.orientation, camera.lens.for_image(camera.size), camera.size)
    seen = [(distance, BEARINGS[shown_as_a_whole(camera, ball, distance, BEARINGS)]) for distance in distances.tolist()]
    curves = []
    for k in intersections:
        mesh = _rings_on_screen(camera, ball, k)
        curves.append(_ring_curve("visual", mesh, camera, ball, k, seen))
        count = len(mesh) if equal_at is None else _equal_count(mesh, camera, ball, equal_at)
        hexagonal = visible_hexagonal_mesh(camera.lens, camera.size, count)
        curves.append(_hexagonal_curve(hexagonal, camera, ball, k, seen))
        if early:
            mesh = _rings_on_screen(camera, EarlySphere(ball.radius), k)
            curves.append(_ring_curve("early", mesh, camera, ball, k, seen))
    return curves


def _inclinations(ball: Sphere, height: float, distance: float) -> tuple[float, float]:
    """Inclinations [rad] of the near and the far side of a ball; the near one is below 0 beyond the camera's foot."""
    below = height - ball.center_height
    middle = math.atan2(distance, below)
    half = math.asin(ball.radius / math.hypot(distance, below))
    return middle - half, middle + half


def _projected(rays: Floats, camera: Camera) -> tuple[Floats, Mask]:
    """Pixels (n, 2) of rays (n, 3) of the observation-plane frame, and which are on screen (n,)."""
    alone = Mesh(rays, np.empty((len(rays) + 1, 0), dtype=np.int32))
    projection = project(alone, camera.orientation.level, camera.lens, camera.size)
    return projection.pixels, projection.on_screen


def _rings_on_screen(camera: Camera, ball: Sphere, intersections: float) -> Mesh:
    mesh = build_mesh(ball, camera.orientation.height, intersections, _MAX_DISTANCE)
    visible = project(mesh, camera.orientation.level, camera.lens, camera.size).visible.graph
    if len(visible) == 0:
        raise InputError("the camera shows nothing of the Visual Mesh")
    return visible


def _hexagonal_rays(mesh: HexagonalMesh, camera: Camera) -> Floats:
    """Rays (n, 3) of its points, in the observation-plane frame."""
    return np.asarray(camera.lens.unproject(mesh.pixels, camera.size) @ camera.orientation.level.T)


_Seen = Sequence[tuple[float, Floats]]
"""Distances [m], each with the bearings [rad] at which the camera shows a ball as a whole."""


def _ring_curve(kind: str, mesh: Mesh, camera: Camera, ball: Sphere, intersections: float, seen: _Seen) -> Curve:
    height = camera.orientation.height
    rings = [rings_across(mesh, ball, height, distance) for distance, _ in seen]
    return _curve(kind, mesh.rays, rings, height, ball, intersections, seen)


def _hexagonal_curve(mesh: HexagonalMesh, camera: Camera, ball: Sphere, intersections: float, seen: _Seen) -> Curve:
    rows = [
        float(rows_across(mesh, camera, ball, distance, bearings).mean()) if len(bearings) else math.nan
        for distance, bearings in seen
    ]
    rays = _hexagonal_rays(mesh, camera)
    return _curve("hexagonal", rays, rows, camera.orientation.height, ball, intersections, seen)


def _curve(
    kind: str, rays: Floats, rings: Sequence[float], height: float, ball: Sphere, intersections: float, seen: _Seen
) -> Curve:
    rows = np.full((3, len(seen)), np.nan)
    for column, (distance, bearings) in enumerate(seen):
        if len(bearings):
            counts = points_on_ball(rays, ball, height, distance, bearings)
            rows[:, column] = counts.mean(), counts.min(), counts.max()
    crossed = np.where(np.isnan(rows[0]), np.nan, np.array(rings, dtype=np.float64))
    distances = np.array([distance for distance, _ in seen])
    return Curve(kind, intersections, len(rays), distances, rows[0], rows[1], rows[2], crossed)


def _equal_count(mesh: Mesh, camera: Camera, ball: Sphere, distance: float) -> int:
    """How many points a hexagonal mesh needs, to have as many as this mesh on a ball at about this distance [m]."""
    hexagonal = visible_hexagonal_mesh(camera.lens, camera.size, len(mesh))
    totals = np.zeros(2)
    for near in (distance * np.linspace(0.9, 1.1, 9)).tolist():
        bearings = BEARINGS[shown_as_a_whole(camera, ball, near, BEARINGS)]
        for which, rays in enumerate((mesh.rays, _hexagonal_rays(hexagonal, camera))):
            totals[which] += points_on_ball(rays, ball, camera.orientation.height, near, bearings).sum()
    if not totals.all():
        raise InputError(f"the camera shows no ball at {distance:g} m")
    return round(len(hexagonal) * float(totals[0] / totals[1]))
