"""The configuration vm.toml: all its sections, read and checked.

`vm-detect --print-config` prints it with all defaults. Paths of model and lens are relative to the file's folder.
"""

from __future__ import annotations

import base64
import math
from collections.abc import Mapping
from dataclasses import Field, dataclass, field, replace
from pathlib import Path
from typing import Any

from ..borders.sockets import checked_address
from ..cameras.camera import CameraSettings
from ..cameras.ros.settings import RosSettings
from ..config.entries import EntryError, check_entries, entry, file_name, number, switch
from ..config.sections import read_sections
from ..config.toml_writer import to_commented_toml
from ..config.units import angle, length
from ..detection.settings import Settings
from ..detection.track_settings import TrackSettings
from ..errors import InputError, VisualMeshError
from ..geometry.lens import Lens, Size
from ..geometry.lens_files import LensFile, read_lens_file
from ..geometry.orientation import Orientation
from ..geometry.radial_lenses import Rectilinear
from ..network.bundled import DEFAULT, model_path, shipped_name
from ..network.model_file import ModelFile
from ..output.channels import OutputSettings
from ..output.recorder import CONFIGURATION, RecorderSettings
from ..poses.settings import PoseSettings
from .top_level_entries import (
    checked_fov,
    commented_fov,
    commented_lens,
    commented_model,
    read_lens_entry,
    read_model_entry,
)

_ED25519 = b"\x00\x00\x00\x0bssh-ed25519\x00\x00\x00\x20"
"""First bytes of such a public key (RFC 8709); its 32 bytes follow."""


def _checked_signer(entry: Field[Any], value: Any) -> str:
    """An Ed25519 public key in ssh-keygen's format, without its comment, or an empty string. Raises InputError."""
    words = value.split()[:2] if isinstance(value, str) else [value]
    if not words:
        return ""
    try:
        key = base64.b64decode(words[1], validate=True) if words[0] == "ssh-ed25519" else b""
    except (IndexError, ValueError):
        key = b""
    if not key.startswith(_ED25519) or len(key) != len(_ED25519) + 32:
        raise InputError(
            f"{entry.name} must be an Ed25519 public key from ssh-keygen's .pub file, 'ssh-ed25519 AAAA...', "
            f"not {str(value)[:60]!r}"
        )
    return " ".join(words)


@dataclass(frozen=True, kw_only=True)
class DeploySettings:
    """How long a new release has to become healthy, and who must sign bundles and models."""

    healthy_s: float = number(
        30.0, "time within which a new release must be ready and ok; otherwise vm-deploy rolls it back", "s", (5, 600)
    )
    signer: str = entry(
        _checked_signer,
        "",
        "Ed25519 public key, from ssh-keygen's .pub file; vm-deploy accepts only bundles and models signed with its "
        "private key; empty: it accepts unsigned ones",
    )

    def __post_init__(self) -> None:
        check_entries(self)


HEADER = """Configuration of vm-detect. `vm-detect --print-config` prints this file.
Keep only the entries that you change: missing entries have their defaults.
Each comment gives the meaning of the next entry, its unit in brackets, and its limits."""
"""First comment of a vm.toml that is printed."""

_RECORDED_MODEL = "model.onnx"


@dataclass(frozen=True)
class FixedPose:
    """Section [orientation]: the pose of the camera if neither the frames nor a pose stream give it.

    Without a height, the pose comes from the lens file.
    """

    height: float | None = length(None, "height of the camera above the plane")
    pitch: float | None = angle(
        None, 'angle of the optical axis below the horizon, in radians or as in "20deg"', (-math.pi / 2, math.pi / 2)
    )
    roll: float | None = angle(
        None, 'roll of the camera to the right, in radians or as in "-2deg"', (-math.pi, math.pi)
    )

    def __post_init__(self) -> None:
        check_entries(self)

    def orientation(self) -> Orientation | None:
        """The orientation, or None without a height. Raises InputError for angles without a height."""
        if self.height is None:
            if self.pitch is not None or self.roll is not None:
                raise InputError("pitch and roll need a height: give --height")
            return None
        return Orientation.from_roll_pitch(self.height, self.roll or 0.0, self.pitch or 0.0)


@dataclass(frozen=True, kw_only=True)
class TrackSection(TrackSettings):
    """Section [track]: whether objects are followed over the frames, and how."""

    on: bool = switch(False, "follow each object: add its number, smoothed position and velocity to its detections")


@dataclass(frozen=True, kw_only=True)
class StatusSettings:
    """Section [status]: the control socket, the status page and the metrics."""

    socket: str = file_name(
        "",
        "Unix socket for vm-detect --status and --record; empty: vm-detect.sock in $RUNTIME_DIRECTORY or "
        "$XDG_RUNTIME_DIR, otherwise in the private folder /tmp/vm-detect-UID",
    )
    page: str = entry(
        checked_address,
        "",
        "ADDRESS:PORT of the status page, such as 127.0.0.1:8080; empty: no page",
        example="127.0.0.1:8080",
    )
    metrics: str = entry(
        checked_address,
        "",
        "ADDRESS:PORT or unix:PATH of the metrics for Prometheus; empty: no metrics",
        example="127.0.0.1:8081",
    )
    budget_ms: float = number(
        0.0,
        "the state is degraded if the median latency of fifteen frames (arrival to message) exceeds this; 0: no limit",
        "ms",
        (0, 10000),
    )

    def __post_init__(self) -> None:
        check_entries(self)


@dataclass(frozen=True)
class Configuration:
    """All sections. model, lens and fov are not sections of entries, so they bring their own reader and writer."""

    model: str = field(default=DEFAULT, metadata={"read": read_model_entry, "to_commented_toml": commented_model})
    lens: LensFile | None = field(default=None, metadata={"read": read_lens_entry, "to_commented_toml": commented_lens})
    fov: float | None = field(default=None, metadata={"read": checked_fov, "to_commented_toml": commented_fov})
    orientation: FixedPose = field(default_factory=FixedPose)
    detector: Settings = field(default_factory=Settings)
    track: TrackSection = field(default_factory=TrackSection)
    camera: CameraSettings = field(default_factory=CameraSettings)
    pose: PoseSettings = field(default_factory=PoseSettings)
    output: OutputSettings = field(default_factory=OutputSettings)
    status: StatusSettings = field(default_factory=StatusSettings)
    recorder: RecorderSettings = field(default_factory=RecorderSettings)
    ros: RosSettings = field(default_factory=RosSettings)
    deploy: DeploySettings = field(default_factory=DeploySettings)

    def lens_for(self, size: Size) -> Lens | None:
        """The lens for images of this size [px]: that of the lens file, or the one of fov, or None."""
        if self.lens is not None:
            return self.lens.lens
        return None if self.fov is None else Rectilinear.from_horizontal_fov(self.fov, size)

    def fixed_orientation(self) -> Orientation | None:
        """The orientation of section [orientation], or without a height there the one of the lens file, or None.

        Raises InputError for angles without a height.
        """
        return self.orientation.orientation() or (self.lens.orientation if self.lens is not None else None)


def read_configuration(path: str | Path) -> Configuration:
    """Read a vm.toml. Raises InputError with the file, the line, and the bad value or the unknown key and its nearest
    known one."""
    path = Path(path)
    read = read_sections(Configuration, path)
    if read.lens is not None and read.fov is not None:
        raise InputError(f"configuration {path}: give lens or fov, not both")
    try:
        lens: object = read.lens  # the sections leave the path of a lens file here
        if isinstance(lens, Path):
            read = replace(read, lens=read_lens_file(path.parent / lens))
        return replace(read, model=str(model_path(read.model, path.parent)))
    except VisualMeshError as error:
        raise InputError(f"configuration {path}: {error}") from error


def with_overrides(configuration: Configuration, sections: Mapping[str, Mapping[str, Any]]) -> Configuration:
    """The configuration with the given entries of the given sections replaced.

    Raises InputError with the section, the entry and the bad value.
    """
    changed: dict[str, Any] = {}
    for name, entries in sections.items():
        try:
            changed[name] = replace(getattr(configuration, name), **entries)
        except EntryError as error:
            raise InputError(f"[{name}] {error}") from error
    return replace(configuration, **changed)


def recording_files(configuration: Configuration, model: ModelFile) -> dict[str, bytes]:
    """The files of a recording besides its frames, by name: vm.toml, and the network unless the package has it.

    So a recording can be used on another machine. model: the network that runs.
    """
    shipped = shipped_name(model.path)
    recorded = Configuration(
        model=shipped or _RECORDED_MODEL, detector=configuration.detector, track=configuration.track
    )
    return {CONFIGURATION: to_commented_toml(recorded).encode()} | ({} if shipped else {_RECORDED_MODEL: model.content})
