"""Section [deploy]: when vm-deploy keeps a new release, and whose bundles and models it accepts."""

from __future__ import annotations

import base64
from dataclasses import Field, dataclass
from typing import Any

from ..config.entries import check_entries, entry, number
from ..errors import InputError

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
