"""Random lenses, rays, orientations and meshes for the laws."""

import math

import numpy as np
from hypothesis import strategies as st

from vm_embedded.borders.text import MOST_NAME
from vm_embedded.geometry.calibrated_lenses import BrownLens, FisheyeLens
from vm_embedded.geometry.orientation import Orientation
from vm_embedded.geometry.radial_lenses import Equidistant, Equisolid, Rectilinear
from vm_embedded.mesh.mesh import Mesh

SIZE = (640, 480)
RADIUS = 400.0
"""Distance of the corners of a picture of SIZE from its center [px]."""


def attempt(kind, function, *arguments):
    """What a function returns, or the error of this kind that it raises."""
    try:
        return function(*arguments)
    except kind as error:
        return error


def reals(low, high):
    return st.floats(low, high, allow_nan=False, allow_infinity=False)


printable = st.characters(exclude_categories=("C", "Z")) | st.just(" ")
"""Characters of names and of other lines of text."""

class_names = st.text(printable, min_size=1, max_size=MOST_NAME).filter(lambda each: each == each.strip(" "))
"""Names that a class may have."""

seeds = st.integers(0, 2**32 - 1)
"""For numpy's generators, where an example needs many numbers."""


@st.composite
def distortions(draw, strength=0.5):
    """(k0, k1) whose terms reach up to `strength` at the picture's corner."""
    kind = draw(st.sampled_from(["none", "k0", "k1", "both"]))
    k0 = draw(reals(-strength, strength)) if kind in ("k0", "both") else 0.0
    k1 = draw(reals(-strength, strength)) if kind in ("k1", "both") else 0.0
    # A coefficient is none at all or one that can be noticed.
    return tuple(0.0 if abs(k) < 1e-6 else k / RADIUS**power for k, power in ((k0, 2), (k1, 4)))


@st.composite
def radial_lenses(draw, strength=0.5):
    kind = draw(st.sampled_from([Rectilinear, Equisolid, Equidistant]))
    fov = draw(reals(0.3, 2.8 if kind is Rectilinear else 2.0 * math.pi))
    return kind(
        focal_length=draw(reals(80.0, 1200.0)),
        fov=fov,
        center=(draw(reals(-60.0, 60.0)), draw(reals(-60.0, 60.0))),
        distortion=draw(distortions(strength)),
        size=draw(st.sampled_from([None, SIZE])),
    )


@st.composite
def camera_matrices(draw):
    focal = draw(reals(150.0, 1000.0))
    return {
        "focal_lengths": (focal, focal * draw(reals(0.95, 1.05))),
        "optical_center": (draw(reals(280.0, 360.0)), draw(reals(200.0, 280.0))),
    }


@st.composite
def brown_lenses(draw):
    count = draw(st.sampled_from([0, 4, 5, 8]))
    limits = (0.4, 0.15, 0.002, 0.002, 0.05)
    coefficients = [draw(reals(-limit, limit)) for limit in limits[: min(count, 5)]]
    coefficients += [draw(reals(0.0, limit)) for limit in ((0.4, 0.1, 0.02) if count == 8 else ())]
    return BrownLens(
        **draw(camera_matrices()),
        coefficients=tuple(coefficients),
        fov=draw(reals(0.3, math.radians(160.0))),
        size=SIZE,
    )


@st.composite
def fisheye_lenses(draw):
    limits = (0.1, 0.03, 0.01, 0.003)
    coefficients = tuple(draw(reals(-limit, limit)) for limit in limits) if draw(st.booleans()) else ()
    return FisheyeLens(
        **draw(camera_matrices()), coefficients=coefficients, fov=draw(reals(0.3, 2.0 * math.pi)), size=SIZE
    )


def lenses(strength=0.5):
    """Lenses of every kind."""
    return st.one_of(radial_lenses(strength), brown_lenses(), fisheye_lenses())


def rays_at(theta, around):
    """Rays (n, 3) in the camera frame at angles [rad] from the optical axis, and around it."""
    return np.stack(
        np.broadcast_arrays(np.cos(theta), np.sin(theta) * np.cos(around), np.sin(theta) * np.sin(around)), axis=-1
    )


def rays_within(limit, count, random):
    """Random rays (count, 3) up to `limit` [rad] from the optical axis."""
    return rays_at(limit * random.random(count), 2.0 * np.pi * random.random(count))


def rotation(axis_angle):
    """Rotation (3, 3) around a vector by its length [rad]: Rodrigues' formula."""
    angle = float(np.linalg.norm(axis_angle))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = np.asarray(axis_angle) / angle
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + math.sin(angle) * cross + (1.0 - math.cos(angle)) * cross @ cross


def random_direction(random):
    vector = random.normal(size=3)
    return vector / np.linalg.norm(vector)


@st.composite
def orientations(draw, low=0.3, high=2.0):
    return Orientation.from_roll_pitch(
        draw(reals(low, high)),
        roll=draw(reals(-math.pi, math.pi)),
        pitch=draw(reals(-0.5 * math.pi, 0.5 * math.pi)),
        yaw=draw(reals(-math.pi, math.pi)),
    )


def scattered_mesh(count, random):
    """A mesh without links whose rays point everywhere, the sky included."""
    rays = random.normal(size=(count, 3))
    rays = np.asfortranarray(rays / np.linalg.norm(rays, axis=1, keepdims=True))
    return Mesh(rays, np.full((count + 1, 6), count, dtype=np.int32))
