"""Section [status]: how to look at a running detector."""

from __future__ import annotations

from dataclasses import dataclass

from ..config.entries import check_entries, entry, number, text_line
from ..sockets import checked_address


@dataclass(frozen=True, kw_only=True)
class StatusSettings:
    """Who may look, and how."""

    socket: str = text_line(
        "",
        "socket for vm-detect --status and its like; if none is named, vm-detect.sock in $RUNTIME_DIRECTORY or "
        "$XDG_RUNTIME_DIR, or else in /tmp with the user's number in its name",
    )
    page: str = entry(
        checked_address, "", "ADDRESS:PORT of a page with state and picture, as 127.0.0.1:8080; none: no page"
    )
    metrics: str = entry(
        checked_address, "", "ADDRESS:PORT or unix:PATH at which Prometheus gets figures; none: not at all"
    )
    budget_ms: float = number(
        0.0,
        "longest time from a frame's arrival to its message, at the median of fifteen, before the state is degraded; "
        "0: any",
        "ms",
        (0, 10000),
    )
    picture_fps: float = number(10.0, "pictures a second that the page shows", "1/s", (0.1, 100))

    def __post_init__(self) -> None:
        check_entries(self)
