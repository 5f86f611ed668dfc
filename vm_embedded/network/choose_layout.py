"""The choice between the layouts."""

from __future__ import annotations

from ..mesh.mesh import Mesh
from .canvas_layout import CanvasLayout
from .layout import WholeLayout
from .manifest import Manifest
from .plain_layout import PlainLayout
from .runs_layout import RunsLayout


def choose_layout(mesh: Mesh, manifest: Manifest) -> WholeLayout:
    """The mesh in the layout that the manifest's network takes."""
    if manifest.layout == "runs":
        return RunsLayout(mesh, manifest.model.groups)
    if manifest.layout == "canvas":
        assert manifest.model.steps is not None  # Manifest accepts this layout only for strips.
        return CanvasLayout(mesh, manifest.model.steps)
    return PlainLayout(mesh, manifest.edge)
