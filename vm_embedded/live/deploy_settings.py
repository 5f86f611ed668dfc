"""Section [deploy]: what vm-deploy asks of a release before it stays, and of a model before it is taken."""

from __future__ import annotations

import base64
import binascii
from dataclasses import Field, dataclass
from typing import Any

from ..config.entries import check_entries, entry, number
from ..errors import InputError

_ED25519 = b"\x00\x00\x00\x0bssh-ed25519\x00\x00\x00\x20"
"""How the bytes of such a key begin (RFC 8709); 32 bytes follow."""


def checked_signer(entry: Field[Any], value: Any) -> str:
    """An Ed25519 public key as ssh-keygen writes it, its comment left out, or nothing. Raises InputError."""
    words = value.split()[:2] if isinstance(value, str) else [value]
    if not words:
        return ""
    try:
        key = base64.b64decode(words[1], validate=True) if words[0] == "ssh-ed25519" else b""
    except (IndexError, binascii.Error):
        key = b""
    if not key.startswith(_ED25519) or len(key) != len(_ED25519) + 32:
        raise InputError(
            f"{entry.name} must be an Ed25519 public key as in ssh-keygen's .pub file, 'ssh-ed25519 AAAA...', "
            f"not {str(value)[:60]!r}"
        )
    return " ".join(words)


@dataclass(frozen=True, kw_only=True)
class DeploySettings:
    """When a release is kept, and whose models are taken."""

    healthy_s: float = number(
        30.0, "time in which a new release must be ready and ok before the old one comes back", "s", (5, 600)
    )
    signer: str = entry(
        checked_signer,
        "",
        "Ed25519 public key, as in ssh-keygen's .pub file, with which models for vm-deploy model must be signed; none: "
        "they need not be",
    )

    def __post_init__(self) -> None:
        check_entries(self)
