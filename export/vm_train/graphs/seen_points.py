"""The points that a network gets of a picture: those of its mesh that are on screen."""

from __future__ import annotations

import math

import numpy as np

from vm_embedded.arrays import Floats
from vm_embedded.detection.projection import Projection, along, project
from vm_embedded.geometry.lens import Lens, Size
from vm_embedded.geometry.lens_files import LensFile
from vm_embedded.mesh.mesh import Mesh
from vm_embedded.network.manifest import Manifest
from vm_export.grid import VISUAL, Grid

from .hexagonal import HexagonalMesh, hexagonal_mesh, visible_hexagonal_mesh


def seen_points(lens: LensFile, size: Size, manifest: Manifest, grid: Grid = VISUAL) -> Projection:
    """The points that a network gets of a picture: on screen all of them, rays in the observation-plane frame.

    The lens file must hold an orientation. Raises GeometryError if the camera is too low for a mesh, and InputError if
    the lens does not fit the picture or sees none of it.
    """
    orientation = lens.orientation
    assert orientation is not None  # read_picture checked it
    fitted = lens.lens.for_image(size)
    mesh = manifest.model.build(manifest.mesh_shape, orientation.height, manifest.intersections, manifest.max_distance)
    mesh = _near_picture(mesh, orientation.level, fitted, size)
    if grid.is_visual:
        seen = project(mesh, orientation.level, fitted, size)
        return seen.only(mesh.needed(seen.on_screen)).visible
    if grid.equal_at:
        flat = _equal_hexagonal_mesh(fitted, size, manifest, orientation.height, grid.equal_at)
    else:
        count = np.count_nonzero(project(mesh, orientation.level, fitted, size).on_screen)
        flat = visible_hexagonal_mesh(fitted, size, max(int(count), 1))
    rays = np.asarray(fitted.unproject(flat.pixels, size) @ orientation.level.T)
    return Projection(Mesh(rays, flat.neighbors), flat.pixels, np.ones(len(flat), dtype=bool))


def _near_picture(mesh: Mesh, rotation: Floats, lens: Lens, size: Size) -> Mesh:
    """The part of a mesh in the cone around the picture's middle ray that contains the picture: less to project.

    rotation (3, 3): camera to mesh frame. Returns the whole mesh if the picture covers a hemisphere or more, or if the
    lens does not see the whole border.
    """
    x, y = np.linspace(0.0, size[0] - 1.0, 17), np.linspace(0.0, size[1] - 1.0, 17)
    sides = [np.stack(np.broadcast_arrays(x, at), axis=1) for at in (0.0, size[1] - 1.0)]
    sides += [np.stack(np.broadcast_arrays(at, y), axis=1) for at in (0.0, size[0] - 1.0)]
    middle = np.array([[size[0] - 1.0, size[1] - 1.0]]) / 2.0
    axis, *border = lens.unproject(np.concatenate([middle, *sides]), size)
    # Between two of these pixels the border may reach a little farther.
    reach = 1.05 * float(np.arccos(np.clip(np.stack(border) @ axis, -1.0, 1.0)).max()) + 0.01
    if not reach < math.pi / 2.0:  # NaN if the lens does not see part of the border
        return mesh
    return mesh.part(np.flatnonzero(along(mesh.rays, rotation @ axis) > math.cos(reach)))


def _equal_hexagonal_mesh(lens: Lens, size: Size, manifest: Manifest, height: float, distance: float) -> HexagonalMesh:
    """A mesh with as many points on an object at a distance [m] as the Visual Mesh has.

    The Visual Mesh has k^2 points on the square around an object. The object's size in the picture is that on the
    lens's axis.
    """
    radius = manifest.radius
    away = math.hypot(distance, height - manifest.mesh_shape.center_height)
    step = 1e-4  # [rad]
    axis = np.array([[1.0, 0.0, 0.0], [1.0, step, 0.0], [1.0, 0.0, step]])
    middle, left, up = lens.project(axis / np.linalg.norm(axis, axis=1, keepdims=True), size)
    scale = math.sqrt(abs(float(np.linalg.det(np.stack([left - middle, up - middle]))))) / step  # [px/rad]
    cell = (2.0 * radius / away * scale / manifest.intersections) ** 2  # [px^2] for each point
    count = max(round((size[0] - 1.0) * (size[1] - 1.0) / cell), 1)
    mesh = hexagonal_mesh(size, count)
    return mesh.part(np.flatnonzero(mesh.on_screen(lens, size)))
