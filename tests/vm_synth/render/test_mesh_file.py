"""Meshes of users: OBJ and PLY files are read alike, and bad ones are named."""

import numpy as np
import pytest

from vm_embedded.errors import InputError
from vm_synth.bodies.primitives import box
from vm_synth.bodies.targets import unit_sized
from vm_synth.render.mesh_file import read_mesh

SOLID = box(0.2, 0.4, 0.6)


@pytest.fixture(autouse=True)
def mitsuba(tracer):
    """Skips these tests where Mitsuba is missing."""


def obj(solid):
    lines = [f"v {x} {y} {z}" for x, y, z in solid.vertices]
    return "\n".join([*lines, *(f"f {a + 1} {b + 1} {c + 1}" for a, b, c in solid.triangles)]) + "\n"


def ply(solid):
    head = ["ply", "format ascii 1.0", f"element vertex {len(solid.vertices)}"]
    head += [f"property float {axis}" for axis in "xyz"]
    head += [f"element face {len(solid.triangles)}", "property list uchar int vertex_indices", "end_header"]
    rows = [" ".join(map(str, each)) for each in solid.vertices]
    return "\n".join([*head, *rows, *(f"3 {a} {b} {c}" for a, b, c in solid.triangles)]) + "\n"


@pytest.mark.parametrize(
    ("name", "text"), [("crate.obj", obj), ("crate.ply", ply), ("CRATE.OBJ", obj), ("cr\udce4te.ply", ply)]
)
def test_a_mesh_is_read_as_it_is(tmp_path, name, text):
    path = tmp_path / name
    path.write_text(text(SOLID))
    found = read_mesh(path, "z")
    assert found.high - found.low == pytest.approx([0.2, 0.4, 0.6], abs=1e-6)
    assert np.linalg.norm(found.normals, axis=1) == pytest.approx(1.0, abs=1e-5)
    assert len(found.triangles) == len(SOLID.triangles)
    upright = unit_sized(read_mesh(path, "y"))
    assert upright.high - upright.low == pytest.approx([0.6325, 1.897, 1.0], rel=1e-2)


def test_up_is_up(tmp_path):
    path = tmp_path / "pyramid.obj"
    path.write_text("v -1 0 -1\nv 1 0 -1\nv 0 0 1\nv 0 3 0\nf 1 2 4\nf 2 3 4\nf 3 1 4\nf 1 3 2\n")
    found = read_mesh(path, "y")
    top = found.vertices[found.vertices[:, 2].argmax()]
    assert top == pytest.approx([0.0, 0.0, 3.0], abs=1e-6)


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("cup.stl", "solid", "must be an .obj or .ply file"),
        ("cup.obj", "", "cup.obj"),
        ("cup.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "is flat"),
        ("cup.obj", "v 0 0 0\nf 1 2 9\n", "can't be read"),
        ("cup.ply", "ply\nformat ascii 1.0\nelement vertex 9\n", "can't be read"),
    ],
)
def test_bad_meshes_are_named_in_one_line(tmp_path, name, text, said):
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(InputError, match=said) as raised:
        read_mesh(path, "z")
    assert "\n" not in str(raised.value)


def test_a_missing_mesh_is_named(tmp_path):
    with pytest.raises(InputError, match="there is no mesh"):
        read_mesh(tmp_path / "cup.obj", "z")
