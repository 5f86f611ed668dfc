"""The choice between the three layouts."""

from __future__ import annotations

from ..mesh.mesh import Mesh
from .lattice_layout import LatticeLayout
from .layout import WholeLayout
from .manifest import Manifest
from .plain_layout import PlainLayout
from .runs_layout import RunsLayout


def choose_layout(mesh: Mesh, manifest: Manifest) -> WholeLayout:
    """The mesh in the layout that the manifest's network takes."""
    if manifest.layout == "runs":
        return RunsLayout(mesh, manifest.model.groups, manifest.dilations)
    if manifest.layout == "lattice":
        assert manifest.model.steps is not None  # Manifest accepts this layout only for lattices.
        return LatticeLayout(mesh, manifest.model.steps)
    return PlainLayout(mesh, manifest.edge, manifest.model.groups, manifest.dilations)
