"""Views and pictures of a ball for the tests of proposals, patches and the close look."""

import numpy as np

from tests.manifests import ball_manifest
from vm_embedded.detection.observation import Observation
from vm_embedded.detection.prepared_view import PreparedView
from vm_embedded.detection.projection import project
from vm_embedded.detection.pyramid import Pyramid
from vm_embedded.geometry.orientation import Orientation
from vm_embedded.geometry.radial_lenses import Equisolid
from vm_embedded.geometry.shapes import Sphere
from vm_embedded.mesh.models import build_mesh
from vm_embedded.network.choose_layout import PlainLayout

SIZE = (640, 512)
BALL = Sphere(0.1)
K = 4.0
LENS = Equisolid(focal_length=400.0, fov=2.2)


def view_at(height=0.9, pitch=0.5, lens=LENS, roll=0.05):
    """What a camera at this height [m] sees of a mesh for BALL."""
    orientation = Orientation.from_roll_pitch(height, roll, pitch)
    layout = PlainLayout(build_mesh(BALL, height, K, 8.0), "hard")
    return PreparedView(layout, None, BALL, K, height, orientation.level, np.eye(3), lens, SIZE)


def center_at(view, pixel):
    """Center (3,) [m], relative to the camera, of a ball on the plane that is seen at this pixel; above the horizon
    NaN."""
    ray = view.lens.unproject(np.array([pixel], dtype=float), view.size) @ view.rotation.T
    return BALL.center_along(ray, view.height)[0] if ray[0, 2] < -0.02 else np.full(3, np.nan)


def picture_of(view, *centers):
    """A black picture (512, 640, 3) with white balls, smooth at their outlines."""
    width, height = view.size
    x, y = np.meshgrid(np.arange(width), np.arange(height))
    pixels = np.stack([x, y], axis=2).reshape(-1, 2).astype(float)
    rays = np.nan_to_num(view.lens.unproject(pixels, view.size) @ view.rotation.T)
    white = np.zeros(len(rays))
    for center in centers:
        distance = np.linalg.norm(center)
        radius = view.lens.scale * np.arcsin(BALL.radius / distance)  # about: for the width of the edge
        offset = BALL.offset(rays, center[None], view.height)[0]
        white = np.maximum(white, np.clip(0.5 + (1.0 - offset) * radius, 0.0, 1.0))
    shade = np.rint(255.0 * white).astype(np.uint8).reshape(height, width)
    return np.ascontiguousarray(np.repeat(shade[:, :, None], 3, axis=2))


def observation_of(view, *centers, image=None, background=0.0):
    """An observation by a perfect mesh network of a picture with balls at these centers."""
    projected = project(view.layout, view.rotation, view.lens, view.size)
    seen = np.zeros(len(view.layout), dtype=np.float32)
    for center in centers:
        seen[BALL.offset(view.layout.rays, center[None], view.height)[0] < 1.0] = 0.97
    pyramid = Pyramid(picture_of(view, *centers) if image is None else image, "bgr")
    probabilities = np.maximum(seen, np.float32(background))[:, None]
    return Observation(pyramid, view, ball_manifest(), projected, probabilities)
