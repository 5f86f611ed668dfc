"""Temperatures of the machine, as Linux reports them."""

from __future__ import annotations

from pathlib import Path

_ZONES = Path("/sys/class/thermal")
_LOWEST, _HIGHEST = -40.0, 150.0
"""Temperatures outside of these are those of sensors that are not there [degrees Celsius]."""


def read_temperatures(zones: Path = _ZONES) -> dict[str, float]:
    """The highest temperature of each kind of thermal zone, by its name [degrees Celsius]; empty if there is none."""
    found: dict[str, float] = {}
    for zone in sorted(zones.glob("thermal_zone*")):
        try:
            name, degrees = (zone / "type").read_text().strip(), 1e-3 * float((zone / "temp").read_text())
        except (OSError, ValueError):
            continue  # a sensor that is switched off can't be read
        if _LOWEST < degrees < _HIGHEST:
            found[name] = max(round(degrees, 1), found.get(name, _LOWEST))
    return found
