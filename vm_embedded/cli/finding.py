"""What a check of vm-doctor has found."""

from __future__ import annotations

from dataclasses import dataclass

GOOD, WARNING, BAD = "ok", "warning", "failure"


@dataclass(frozen=True)
class Finding:
    """Result of a check.

    about: the checked part. state: GOOD, WARNING or BAD. seen: description. mend: command that fixes it, if any.
    """

    about: str
    state: str
    seen: str
    mend: str = ""
