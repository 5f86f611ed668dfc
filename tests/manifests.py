"""Manifests for tests."""

from __future__ import annotations

from typing import Any

from vm_embedded.network.manifest import Manifest, ObjectClass

KINDS = {"ball": "object", "field": "area", "line": "area"}
"""Kinds of classes by name; all others are background."""


def ball_manifest(*classes: str, **changes: Any) -> Manifest:
    """A manifest for balls of 0.1 m radius on mesh ring6 out to 8 m, or with other entries.

    classes: names, in the order of the outputs, or NAME:KIND; without any, the one class ball.
    """
    entries = {
        "shape": "sphere",
        "radius": 0.1,
        "object_radius": 0.1,
        "intersections": 4.0,
        "mesh": "ring6",
        "max_distance": 8.0,
        "edge": "hard",
        "classes": tuple(_class(each) for each in classes or ("ball",)),
    }
    return Manifest(**(entries | changes))


def _class(text: str) -> ObjectClass:
    name, _, kind = text.partition(":")
    return ObjectClass(name, kind or KINDS.get(name, "background"))
