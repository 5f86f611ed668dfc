import pytest

from vm_embedded.errors import GeometryError, InputError
from vm_embedded.geometry.shapes import Circle, Cylinder, Sphere, make_shape


@pytest.mark.parametrize(("name", "kind"), [("circle", Circle), ("sphere", Sphere), ("Sphere", Sphere)])
def test_a_shape_is_found_by_its_name(name, kind):
    assert make_shape(name, 0.1) == kind(0.1)


@pytest.mark.parametrize("name", ["cylinder", "Cylinder"])
def test_a_cylinder_is_found_with_its_height(name):
    assert make_shape(name, 0.05, 1.8) == Cylinder(0.05, 1.8)
    with pytest.raises(GeometryError, match="cylinder height"):
        make_shape(name, 0.05)


@pytest.mark.parametrize("name", ["circle", "sphere"])
def test_only_a_cylinder_has_a_height(name):
    with pytest.raises(InputError, match=rf"only a cylinder takes an object height.*1\.8 m from the {name}"):
        make_shape(name, 0.05, 1.8)


def test_an_unknown_shape_names_the_nearest():
    with pytest.raises(InputError, match=r"'spher'.*'sphere'"):
        make_shape("spher", 0.1)
