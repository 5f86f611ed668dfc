"""The state of the daemon as others hear of it: in the log, in messages, and from systemd."""

from __future__ import annotations

import re
import time

from ..borders.text import printable
from ..cameras.grabber import Grabber
from ..output.channels import Channels
from .health import Health
from .log import EventLog
from .systemd import SystemdNotifier

_GOOD = ("ok", "starting", "stopping")
"""States that are not worth a warning."""


class DaemonState:
    """The current state, one of messages.STATES, and its reason.

    health: determines the state. grabber, outputs: their troubles count for it.
    """

    def __init__(
        self, health: Health, grabber: Grabber, outputs: Channels, log: EventLog, notifier: SystemdNotifier
    ) -> None:
        self.name, self.reason = "", ""
        self._health, self._grabber, self._outputs = health, grabber, outputs
        self._log, self._notifier = log, notifier
        self._logged = ""  # the reason in the log
        self._rejected = 0  # frames of the camera that were rejected

    def update(self) -> bool:
        """Determine the state. Log a new one and a new reason of a bad one, and return whether there was one."""
        now, was = time.monotonic(), self.name
        is_lost = self._grabber.supervise(now)
        self._collect_troubles(now)
        self.name, reason = self._health.state(now, is_lost, self._grabber.trouble)
        self.reason = printable(reason)
        is_bad = self.name not in _GOOD
        if self.name != was:
            self._log("state", "warning" if is_bad else "info", state=self.name, was=was, reason=self.reason)
        elif is_bad and _without_numbers(self.reason) != _without_numbers(self._logged):
            self._log("reason", "warning", state=self.name, reason=self.reason)
        else:
            return False
        self._logged = self.reason
        self._notifier.send(STATUS=f"{self.name}{': ' if self.reason else ''}{self.reason}")
        return True

    def _collect_troubles(self, now: float) -> None:
        """Tell the health of lost messages and of rejected frames."""
        if self._outputs.failure:
            self._health.add_trouble(now, f"messages are lost: {self._outputs.failure}")
        rejected = self._grabber.counts.rejected
        if rejected != self._rejected:
            self._rejected = rejected
            self._health.add_trouble(now, self._grabber.trouble)


def _without_numbers(reason: str) -> str:
    """What a reason says, whatever its times and sizes."""
    return re.sub(r"\d", "", reason)
