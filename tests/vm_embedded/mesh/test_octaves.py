"""Mesh octaves: strips that hold the paper's rings, each direction in one of them, and their context."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_embedded.errors import GeometryError
from vm_embedded.geometry.shapes import Circle, Cylinder, Sphere
from vm_embedded.mesh.mesh import STRIDE
from vm_embedded.mesh.models import build_mesh, mesh_model
from vm_embedded.mesh.octaves import BLOCK, GAP
from vm_embedded.mesh.rings import inclinations, ring_counts

from ..strategies import reals, seeds

CASES = [
    (Sphere(0.1), 0.6, 3.0, 8.0),
    (Sphere(0.095), 0.4, 3.0, 14.0),
    (Sphere(0.075), 1.2, 4.0, 5.0),
    (Sphere(0.11), 2.0, 2.0, 10.0),
    (Circle(0.1), 0.8, 3.0, 6.0),
    (Circle(0.3), 0.5, 4.0, 9.0),
    (Cylinder(0.05, 0.4), 0.8, 3.0, 6.0),
    (Cylinder(0.2, 0.7), 1.2, 5.0, 10.0),
    (Cylinder(0.05, 0.4), 0.45, 2.0, 10.0),
]
"""Shape, height of the camera [m], intersections, and maximum distance [m]."""

every_case = pytest.mark.parametrize("case", CASES, ids=str)


@st.composite
def cases(draw):
    """What meshes of up to some ten thousand points are made of."""
    radius = draw(reals(0.05, 0.3))
    shape = draw(st.sampled_from([Circle(radius), Sphere(radius), Cylinder(radius, draw(reals(0.1, 1.0)))]))
    top = {Circle: 0.4, Sphere: 2.2 * radius}.get(type(shape), 1.1 * getattr(shape, "object_height", 0.0))
    return shape, draw(reals(top, top + 1.5)), draw(reals(0.5, 5.0)), draw(reals(0.2, 5.0))


def inclination_of(mesh):
    return np.arccos(np.clip(-mesh.rays[:, 2], -1.0, 1.0))


def strips_of(mesh):
    """The meshes of the strips, the farthest first and the foot last."""
    return [mesh.part(np.flatnonzero(mesh.strips == number)) for number in range(mesh.strips.max() + 1)]


def core_of(mesh):
    return mesh.part(np.flatnonzero(~mesh.margin))


@given(cases())
def test_core_rows_are_the_rings_of_the_mesh_each_in_one_strip(case):
    *octaves, foot = strips_of(build_mesh(*case, "octaves"))
    phi = inclinations(*case)
    inside = int((phi <= inclination_of(core_of(foot)).max() + 1e-9).sum()) if octaves else len(phi)
    rows = []
    for strip in octaves:
        core = core_of(strip)
        own = np.unique(core.cells[:, 1])
        rows.append([float(np.median(inclination_of(core)[core.cells[:, 1] == each])) for each in own])
        assert np.ptp(own) + 1 == len(own)
    found = np.concatenate([*reversed(rows), []])
    np.testing.assert_allclose(found, phi[len(phi) - len(found) :], atol=1e-7)
    # The foot has the rest: up to half a ring beyond its last one, as far as the corners of a lattice reach.
    assert abs(inside - (len(phi) - len(found))) <= 1


@given(cases())
def test_an_object_is_at_most_by_the_square_root_of_two_wider_or_narrower(case):
    """And half a column, by which the number of columns is rounded."""
    shape, height, k, _ = case
    *octaves, _ = strips_of(build_mesh(*case, "octaves"))
    phi = inclinations(*case)
    for strip in octaves:
        core = core_of(strip)
        ring = np.unique(np.abs(inclination_of(core)[:, None] - phi).argmin(axis=1))
        columns = len(np.unique(core.cells[:, 0]))
        assert columns == np.bincount(core.cells[:, 1]).max()  # each row has all of them
        wanted = 2.0 * math.pi * k / shape.theta(ring / k, height)
        assert (columns <= math.sqrt(2.0) * wanted + 1.0).all()
        assert (columns >= wanted / math.sqrt(2.0) - 1.0).all()


@every_case
def test_octaves_have_as_many_points_as_the_rings_that_they_stand_for(case):
    """Two percent fewer if distances grow by a constant factor from ring to ring, six if by a constant step."""
    shape, height, k, _ = case
    mesh = build_mesh(*case, "octaves")
    core = core_of(mesh)
    own = core.strips < core.strips.max()
    phi = inclinations(*case)
    ring = np.unique(np.abs(inclination_of(core)[own, None] - phi).argmin(axis=1))
    ratio = own.sum() / ring_counts(shape, height, k, len(phi))[ring].sum()
    assert (0.94 if isinstance(shape, Circle) else 0.965) < ratio < 1.0
    assert len(core) == pytest.approx(ring_counts(shape, height, k, len(phi)).sum(), rel=0.06)


@given(cases(), seeds)
def test_every_direction_has_a_core_point_within_a_spacing(case, seed):
    """Within a ring and a column of the ring, or within a step of the foot's lattice."""
    shape, height, k, _ = case
    core, phi, random = core_of(build_mesh(*case, "octaves")), inclinations(*case), np.random.default_rng(seed)
    ring = random.uniform(0.0, len(phi) - 1.0, 50)
    inclination = shape.phi(ring / k, height)
    bearing = random.uniform(-math.pi, math.pi, len(ring))
    rings_off = np.abs(k * shape.n(inclination_of(core), height) - ring[:, None])
    turn = np.abs(np.angle(np.exp(1j * (np.arctan2(core.rays[:, 1], core.rays[:, 0]) - bearing[:, None]))))
    columns_off = turn * k / shape.theta(ring / k, height)[:, None]
    off = np.maximum(rings_off, columns_off).min(axis=1)
    plane = core.rays[:, :2] / -core.rays[:, 2:]
    place = np.tan(inclination)[:, None] * np.stack([np.cos(bearing), np.sin(bearing)], axis=1)
    step = math.tan(phi[1]) if len(phi) > 1 else 1.0
    steps_off = np.linalg.norm(plane - place[:, None], axis=2).min(axis=1) / step
    assert np.minimum(off, steps_off).max() <= 1.0


@given(cases())
def test_core_points_lie_apart(case):
    """Of one strip as of two: no two closer than half a spacing."""
    mesh = core_of(build_mesh(*case, "octaves"))
    assert len(np.unique(mesh.rays.round(9), axis=0)) == len(mesh)
    phi = inclinations(*case)
    *octaves, foot = strips_of(mesh)
    for nearer, farther in zip([foot, *reversed(octaves)], reversed(octaves), strict=False):
        last = inclination_of(nearer).max()
        first = inclination_of(farther).min()
        ring = int(np.abs(phi - first).argmin())
        assert np.tan(first) - np.tan(last) >= 0.49 * (np.tan(phi[ring]) - np.tan(phi[ring - 1]))


@given(cases())
def test_mirror_images_are_alike(case):
    """The mirror image of a strip has the same rays, in the mirrored columns."""
    for strip in strips_of(build_mesh(*case, "octaves")):
        column, row = strip.cells.T
        order, mirrored = np.lexsort([column, row]), np.lexsort([-column, row])
        np.testing.assert_allclose(strip.rays[order] * [1.0, -1.0, 1.0], strip.rays[mirrored], atol=1e-9)
        np.testing.assert_array_equal(strip.margin[order], strip.margin[mirrored])


@given(cases())
def test_strips_are_whole_pictures_with_context_on_all_sides(case):
    """At least four rows below, or all rings that there are, rows at equal angles above, and columns beside."""
    *octaves, foot = strips_of(build_mesh(*case, "octaves"))
    for strip in [*octaves, foot]:
        rows, columns = (strip.cells[:, ::-1] - strip.cells[:, ::-1].min(axis=0)).max(axis=0) + 1
        assert len(strip) == rows * columns
        assert (strip.cells[:, 1] % STRIDE).min() == 0
    for strip in octaves:
        column, row = strip.cells.T
        row = row - row.min()
        core = strip.cells[~strip.margin] - [0, strip.cells[:, 1].min()]
        below, above = core[:, 1].min(), row.max() - core[:, 1].max()
        assert below in range(5)
        assert core[:, 0].min() == column.max() - core[:, 0].max() == 8
        phi = inclination_of(strip)[np.searchsorted(row, np.arange(row.max() + 1))]
        angles = np.diff(phi[core[:, 1].max() :])
        np.testing.assert_allclose(angles, angles[0], atol=1e-6)
        assert phi[-1] < math.pi
        assert above >= 8 or phi[-1] + angles[0] > math.pi - 1e-6
        assert (len(phi) + GAP) % BLOCK == 0 or phi[-1] + angles[0] > math.pi - 1e-6
    assert 4 <= foot.cells[~foot.margin][:, 0].min() <= 5


@given(cases())
def test_context_of_the_outermost_strip_reaches_above_the_horizon(case):
    outermost, *others = strips_of(build_mesh(*case, "octaves"))
    if others:  # else there is only the foot
        assert inclination_of(outermost)[outermost.margin].max() > 0.5 * math.pi


@given(cases())
def test_neighbors_are_those_of_the_strip_s_lattice(case):
    mesh = build_mesh(*case, "octaves")
    point_at = {cell: point for point, cell in enumerate(map(tuple, mesh.cells.tolist()))}
    assert len(point_at) == len(mesh)
    steps = np.array(mesh_model("octaves").steps)
    some = np.arange(0, len(mesh), max(len(mesh) // 200, 1))
    expected = [[point_at.get(tuple(cell), len(mesh)) for cell in mesh.cells[point] + steps] for point in some.tolist()]
    np.testing.assert_array_equal(mesh.links(some), expected)
    beside = mesh.links(some)
    present = beside < len(mesh)
    assert (mesh.strips[np.minimum(beside, len(mesh) - 1)] == mesh.strips[some][:, None])[present].all()
    assert (mesh.neighbors[-1] == len(mesh)).all()


@pytest.mark.parametrize(
    ("case", "said"),
    [
        ((Circle(0.1), 0.8, 600.0, 0.18), f"rows, and at most {STRIDE - 1}"),
        ((Sphere(0.1), 1.0, 1e300, 10.0), "at most 8,000,000"),
        ((Sphere(0.1), 1.0, 300.0, 10.0), "at most 8,000,000"),
        ((Circle(0.1), 1.0, 4.0, 1e300), "at most 8,000,000"),
    ],
    ids=str,
)
def test_too_many_rows_or_points_are_refused(case, said):
    with pytest.raises(GeometryError, match=said):
        build_mesh(*case, "octaves")
