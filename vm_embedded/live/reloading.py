"""Read the configuration and the network again while the daemon runs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from ..detection.detector import Detector
from ..errors import InputError
from .bridge import Bridge
from .configuration import Configuration
from .load_detector import check_lens_and_pose, check_trigger_class, find_opener, prove_model

_NEEDS_RESTART = ("camera", "pose", "output", "status", "recorder", "ros")
"""Sections that a reload does not change."""


@dataclass(frozen=True, eq=False)
class Reloaded:
    """The parts of a daemon that a reload replaces.

    proved: in words, what shows that the network works. needs_restart: names of the changed sections and entries that
    only a restart applies; the configuration has their old values.
    """

    configuration: Configuration
    detector: Detector
    proved: str
    needs_restart: list[str]


async def read_again(
    configure: Callable[[], Configuration], running: Configuration, bridge: Bridge | None = None
) -> Reloaded:
    """Read the configuration and load its network. running: the current configuration. Raises VisualMeshError.

    What was read must work with the sections of the running one, and also at the next start. The running detector waits
    only while the network is loaded, after another process has proved it.
    """
    wanted = configure()
    kept = {name: getattr(running, name) for name in _NEEDS_RESTART}
    needs_restart = [name for name, section in kept.items() if section != getattr(wanted, name)]
    # The open camera delivers its frames in the format of the start.
    detector_settings = replace(wanted.detector, format=running.detector.format)
    if wanted.detector.format != running.detector.format:
        needs_restart.append("detector.format")
    configuration = replace(wanted, detector=detector_settings, **kept)
    find_opener(wanted, bridge)  # only for its checks
    check_lens_and_pose(wanted)
    try:
        model, proved = await prove_model(configuration)
    except InputError as error:
        if not needs_restart:
            raise
        raise InputError(f"{error} (only a restart changes {', '.join(needs_restart)})") from error
    check_trigger_class(wanted, model)
    return Reloaded(configuration, Detector(model, configuration.detector), proved, needs_restart)
