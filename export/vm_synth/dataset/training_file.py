"""train.toml: what vm-train must know about the objects of a set that are not the ball."""

from __future__ import annotations

from pathlib import Path

from vm_embedded.config.toml_writer import toml_key
from vm_embedded.files import write_file

from ..scene.configuration import SceneConfiguration
from .files import CLASS_COLORS

NAME = "train.toml"


def write_training(folder: Path, configuration: SceneConfiguration) -> None:
    """Write the file for a set of these objects, unless the folder has it already."""
    path = folder / NAME
    if not path.exists():
        write_file(path, training_text(configuration))


def training_text(configuration: SceneConfiguration) -> str:
    """The sections that these objects need, as TOML."""
    own = configuration.object
    radius, height = (sum(each) / 2.0 for each in (own.radius, own.height))
    # The ray through the center of the farthest object, from the lowest camera, meets the plane behind the object.
    low = max(configuration.camera.height[0], 1.2 * own.height[1])
    farthest = own.distance[1] * low / (low - own.height[1] / 2.0) + own.radius[1]
    found, *others = (list(color) for color in CLASS_COLORS.values())
    return f"""\
# For vm-train, written by vm-synth: the classes in the masks of this folder, and a network for its objects.

[classes]
{toml_key(own.name)} = {{ kind = "object", colors = [{found}] }}
other = {{ kind = "background", colors = {others} }}

[mesh]
shape = "cylinder"
radius = {radius:.6g}
object_height = {height:.6g}
max_distance = {max(1.02 * farthest, 0.2):.3g}
model = "octaves"

[network]
depth = 2
width = 16

[training]
optimizer = "muon"
"""
