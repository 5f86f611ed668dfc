"""What a frame was found to show."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from ..arrays import Floats, Indices, Singles
from ..network.layout import Layout
from ..network.manifest import Manifest
from .projection import Projection


@dataclass(frozen=True, eq=False)
class Detection:
    """One object on the observation plane, or, with a `reason`, a cluster that was rejected as one.

    The plane's frame stands below the camera, z up, with the heading that the frame's orientation had.

    class_name: name of its class. confidence: mean probability inside its outline. center (2,), radius [px]: of the
    disk that covers as many pixels as its outline. outline (m, 2) [px]: what the lens sees of it. bearing (3,): unit
    vector from the camera to its center. position (3,): its center [m]. distance: from the camera to its center [m],
    where its bearing meets the plane. angular_radius [rad]: of the size that fits the points best. distance_by_angle
    [m]: what follows from that size alone. distances_agree: whether the two differ by less than the mesh can resolve.
    points: mesh points inside its outline. reason: why it was rejected, or None.
    """

    class_name: str
    confidence: float
    center: Floats
    radius: float
    outline: Floats
    bearing: Floats
    position: Floats
    distance: float
    angular_radius: float
    distance_by_angle: float
    distances_agree: bool
    points: int
    reason: str | None = None

    def as_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON: pixels to 0.1, metres to 0.001."""
        data: dict[str, Any] = {
            "class": self.class_name,
            "confidence": round(self.confidence, 3),
            "center": [round(float(value), 1) for value in self.center],
            "radius": round(self.radius, 1),
            "bearing": [round(float(value), 5) for value in self.bearing],
            "position": [round(float(value), 3) for value in self.position],
            "distance": round(self.distance, 3),
            "angular_radius": round(self.angular_radius, 5),
            "distance_by_angle": round(self.distance_by_angle, 3),
            "distances_agree": self.distances_agree,
            "points": self.points,
        }
        if self.reason is not None:
            data["reason"] = self.reason
        return data


@dataclass(frozen=True, eq=False)
class ClassPoints:
    """The m points of a class that is no object: bearings (m, 3), pixels (m, 2), probabilities (m,)."""

    class_name: str
    bearings: Floats
    pixels: Floats
    probabilities: Singles

    def __len__(self) -> int:
        return len(self.bearings)


@dataclass(frozen=True, eq=False)
class Detections:
    """The objects of a frame, most confident first, and the n mesh points on screen behind them.

    rejected: clusters that were no objects, with reasons, if they were asked for. manifest: of the network that
    looked. layout, projected, answers (m, C): what it took and gave. heading (3, 3): from the mesh's frame to the
    frame's own observation plane. threshold: above which a point counts for a class. timing_ms: milliseconds of each
    stage.
    """

    objects: tuple[Detection, ...]
    rejected: tuple[Detection, ...]
    manifest: Manifest
    layout: Layout
    projected: Projection[Layout]
    answers: Singles
    heading: Floats
    threshold: float
    timing_ms: dict[str, float] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.objects)

    def __iter__(self) -> Iterator[Detection]:
        return iter(self.objects)

    def __getitem__(self, index: int) -> Detection:
        return self.objects[index]

    @cached_property
    def _shown(self) -> Indices:
        """Slots (n,) of the points on screen, in the order of the mesh."""
        places = self.layout.places
        return places[self.projected.on_screen[places]]

    @cached_property
    def pixels(self) -> Floats:
        """Pixels (n, 2) of the points."""
        return self.projected.pixels[self._shown]

    @cached_property
    def rays(self) -> Floats:
        """Unit vectors (n, 3) to the points, in the frame's own observation plane."""
        return np.asarray(self.layout.rays[self._shown] @ self.heading.T)

    @cached_property
    def probabilities(self) -> Singles:
        """Probabilities (n, C) of the points, in the order of the manifest's classes."""
        return self.answers[self._shown]

    def points_of(self, class_name: str) -> ClassPoints:
        """The points of a class, whose probability is above the threshold. Raises InputError for an unknown class."""
        column = self.probabilities[:, self.manifest.column(class_name)]
        chosen = np.flatnonzero(column > self.threshold)
        return ClassPoints(class_name, self.rays[chosen], self.pixels[chosen], column[chosen])
