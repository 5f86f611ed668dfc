"""Objects as the rows of a table, for pandas and CSV files."""

from __future__ import annotations

import csv
import io
from typing import Any

from ..arrays import Floats
from .detection import Detection

COLUMNS = (
    *("class", "confidence", "distance", "x", "y", "z", "xmin", "ymin", "xmax", "ymax", "center_x", "center_y"),
    *("radius", "angular_radius", "distance_by_angle", "distances_agree", "points", "track"),
)
"""x, y, z: of the position. xmin to ymax: the box in the image. track: its number. The rest is as in the JSON."""

Row = dict[str, Any]


def to_row(detection: Detection, box: Floats) -> Row:
    """An object as plain numbers, one for each column. box (4,) [px]: as in Detections.xyxy."""
    fields = detection.as_dict()
    fields |= zip("xyz", fields["position"], strict=True)
    fields |= zip(("xmin", "ymin", "xmax", "ymax"), box.round(1).tolist(), strict=True)
    fields |= zip(("center_x", "center_y"), fields["center"], strict=True)
    fields["track"] = None if detection.track is None else detection.track.id
    return {name: fields[name] for name in COLUMNS}


def to_csv(rows: list[Row]) -> str:
    """A table with a line of column names, also if it has no rows."""
    text = io.StringIO()
    writer = csv.DictWriter(text, COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()
