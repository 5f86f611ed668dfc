"""The choice between the layouts."""

from __future__ import annotations

from ..mesh.mesh import Mesh
from .canvas_layout import CanvasLayout
from .lattice_layout import LatticeLayout
from .layout import WholeLayout
from .manifest import Manifest
from .plain_layout import PlainLayout
from .runs_layout import RunsLayout


def choose_layout(mesh: Mesh, manifest: Manifest) -> WholeLayout:
    """The mesh in the layout that the manifest's network takes."""
    if manifest.layout == "runs":
        return RunsLayout(mesh, manifest.model.groups)
    if manifest.layout in ("lattice", "canvas"):
        assert manifest.model.steps is not None  # Manifest accepts these layouts only for lattices.
        kind = LatticeLayout if manifest.layout == "lattice" else CanvasLayout
        return kind(mesh, manifest.model.steps)
    return PlainLayout(mesh, manifest.edge)
