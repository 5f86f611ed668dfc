"""The layout that a model file asks for."""

from __future__ import annotations

from ..mesh.mesh import Mesh
from .lattice_layout import LatticeLayout
from .layout import Layout, PlainLayout
from .manifest import Manifest
from .runs_layout import RunsLayout


def laid_out(mesh: Mesh, manifest: Manifest) -> Layout:
    """The mesh as a manifest's network takes it."""
    if manifest.layout == "runs":
        return RunsLayout(mesh, manifest.model.runs)
    if manifest.layout == "lattice":
        assert manifest.model.steps is not None  # the manifest has seen to it
        return LatticeLayout(mesh, manifest.model.steps)
    return PlainLayout(mesh, manifest.edge)
