"""The choice between the layouts."""

from __future__ import annotations

from ..mesh.mesh import Mesh
from .canvas_layout import CanvasLayout
from .layout import Layout
from .manifest import Manifest
from .plain_layout import PlainLayout


def choose_layout(mesh: Mesh, manifest: Manifest) -> Layout:
    """The mesh in the layout that the manifest's network takes."""
    if manifest.on_canvas:
        return CanvasLayout(mesh)
    return PlainLayout(mesh, manifest.edge)
