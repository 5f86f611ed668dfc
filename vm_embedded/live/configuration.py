"""vm.toml: everything about a detector that is to run, a section each, checked at the border.

`vm-detect --print-config` writes it with all defaults. Paths of model and lens count from the file's own folder.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from ..cameras.camera import CameraSettings
from ..config.entries import check_entries
from ..config.sections import read_sections
from ..config.units import angle, length
from ..detection.settings import Settings
from ..errors import InputError, VisualMeshError
from ..geometry.lens_files import LensFile, lens_from_table, read_lens_file
from ..geometry.orientation import Orientation
from ..geometry.radial_lenses import RadialLens
from ..network.bundled import DEFAULT, SHIPPED, model_path
from ..output.channels import OutputSettings
from ..output.recorder import RecorderSettings
from ..poses.buffer import PoseSettings
from .deploy_settings import DeploySettings
from .status_settings import StatusSettings


@dataclass(frozen=True)
class FixedPose:
    """Section [orientation]: where the camera is, if neither the frames nor a pose stream say so."""

    height: float | None = length(None, "height of the camera over the plane")
    pitch: float | None = angle(None, 'angle of the optical axis below the horizon, or as in "20deg"')
    roll: float | None = angle(None, 'lean of the camera to the right, or as in "-2deg"')

    def __post_init__(self) -> None:
        check_entries(self)

    def orientation(self) -> Orientation | None:
        """The orientation, or None if no height is given. Raises InputError for angles without one."""
        if self.height is None:
            if self.pitch is not None or self.roll is not None:
                raise InputError("pitch and roll need a height: give --height")
            return None
        return Orientation.from_roll_pitch(self.height, self.roll or 0.0, self.pitch or 0.0)


def _read_model(value: object) -> str:
    if not isinstance(value, str):
        raise InputError(f"model must be a path, not {value!r}")
    return value


def _commented_model(value: str) -> str:
    comment = f"# the network: a file that vm-export wrote, or one of the package: {', '.join(SHIPPED)}"
    return f"{comment}\nmodel = {json.dumps(value)}"


def _read_lens(value: object) -> Path | LensFile:
    if isinstance(value, str):
        return Path(value)
    if not isinstance(value, Mapping):
        raise InputError(f"lens must be a table, [lens], not {value!r}")
    return LensFile(lens_from_table(value), None)


def _commented_lens(value: LensFile | None) -> str:
    comment = (
        "# the lens: a file of the reference, of OpenCV or of ROS, or TOML; or a table, [lens], with projection,\n"
        "# focal_length [px], fov [rad], and where they matter center, distortion and size [px]\n"
    )
    lens = value.lens if value is not None else None
    if not isinstance(lens, RadialLens):
        return comment + '# lens = "lens.yaml"'
    size = "" if lens.size is None else f", size = {list(lens.size)}"
    return comment + (
        f'lens = {{ projection = "{type(lens).__name__.lower()}", focal_length = {lens.focal_length!r}, '
        f"fov = {lens.fov!r}, center = {list(lens.center)}, distortion = {list(lens.distortion)}{size} }}"
    )


@dataclass(frozen=True)
class Configuration:
    """All sections, and the two that are no tables of entries."""

    model: str = field(default=DEFAULT, metadata={"read": _read_model, "to_commented_toml": _commented_model})
    lens: LensFile | None = field(default=None, metadata={"read": _read_lens, "to_commented_toml": _commented_lens})
    orientation: FixedPose = field(default_factory=FixedPose)
    detector: Settings = field(default_factory=Settings)
    camera: CameraSettings = field(default_factory=CameraSettings)
    pose: PoseSettings = field(default_factory=PoseSettings)
    output: OutputSettings = field(default_factory=OutputSettings)
    status: StatusSettings = field(default_factory=StatusSettings)
    recorder: RecorderSettings = field(default_factory=RecorderSettings)
    deploy: DeploySettings = field(default_factory=DeploySettings)


def read_configuration(path: str | Path) -> Configuration:
    """Read a vm.toml. Raises InputError naming the file, the line, an unknown key with the nearest known one, or a bad
    value."""
    path = Path(path)
    read = read_sections(Configuration, path)
    try:
        lens: object = read.lens
        if isinstance(lens, Path):
            read = replace(read, lens=read_lens_file(path.parent / lens))
        return replace(read, model=str(path.parent / model_path(read.model)))
    except VisualMeshError as error:
        raise InputError(f"configuration {path}: {error}") from error


def overridden(configuration: Configuration, sections: Mapping[str, Mapping[str, Any]]) -> Configuration:
    """A configuration in which the given entries of the given sections count instead. Raises InputError."""
    changed = {name: replace(getattr(configuration, name), **entries) for name, entries in sections.items()}
    return replace(configuration, **changed)
