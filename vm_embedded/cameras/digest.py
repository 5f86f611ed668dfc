"""HTTP authentication by digest (RFC 7616): many network cameras accept no password in clear text."""

from __future__ import annotations

import hashlib
import secrets
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any
from urllib.request import parse_http_list

_ALGORITHMS: dict[str, Callable[[bytes], Any]] = {
    "SHA-256": hashlib.sha256,
    "MD5": partial(hashlib.md5, usedforsecurity=False),
}
"""Hash functions by name, the strongest first."""


def digest_authorization(challenges: Sequence[str], user: str, password: str, target: str) -> str | None:
    """The header Authorization for GET; None if a server offers no digest that is known.

    challenges: the headers WWW-Authenticate of the server. target: path and query of the address.
    """
    offers = [offer for offer in _digests(challenges) if _algorithm(offer)[0] in _ALGORITHMS and _is_simple(offer)]
    if not offers:
        return None
    offer = min(offers, key=lambda each: list(_ALGORITHMS).index(_algorithm(each)[0]))
    algorithm, is_session = _algorithm(offer)

    def hashed(*parts: str) -> str:
        return str(_ALGORITHMS[algorithm](":".join(parts).encode()).hexdigest())

    nonce, client = offer["nonce"], secrets.token_hex(8)
    identity = hashed(user, offer.get("realm", ""), password)
    if is_session:
        identity = hashed(identity, nonce, client)
    count = ["00000001", client, "auth"] if "qop" in offer else []
    response = hashed(identity, nonce, *count, hashed("GET", target))
    fields = {"username": user, "realm": offer.get("realm", ""), "nonce": nonce, "uri": target, "response": response}
    fields |= {"opaque": offer["opaque"]} if "opaque" in offer else {}
    quoted = [f'{name}="{_escaped(value)}"' for name, value in fields.items()]
    if count:
        quoted += ["qop=auth", "nc=00000001"]
    if count or is_session:
        quoted.append(f'cnonce="{client}"')
    if "algorithm" in offer:
        quoted.append(f"algorithm={offer['algorithm']}")
    return "Digest " + ", ".join(quoted)


def _digests(challenges: Sequence[str]) -> Iterator[dict[str, str]]:
    """The fields of each digest that a server offers, by their names in lower case."""
    for header in challenges:
        offer: dict[str, str] | None = None
        for item in parse_http_list(header):
            scheme, blank, field = item.partition(" ")
            if blank and "=" not in scheme:  # the first field of another kind of authentication
                if offer is not None:
                    yield offer
                offer, item = ({} if scheme.lower() == "digest" else None), field
            if offer is not None:
                name, _, value = item.partition("=")
                offer[name.strip().lower()] = value.strip().strip('"')
        if offer is not None:
            yield offer


def _algorithm(offer: dict[str, str]) -> tuple[str, bool]:
    """Name of the hash function, and whether it also hashes the nonces into the password."""
    name = offer.get("algorithm", "MD5").upper()
    return name.removesuffix("-SESS"), name.endswith("-SESS")


def _is_simple(offer: dict[str, str]) -> bool:
    """Whether the digest is of the request only, and not of its content, too."""
    qualities = [each.strip().lower() for each in offer.get("qop", "auth").split(",")]
    return "auth" in qualities and "nonce" in offer


def _escaped(value: str) -> str:
    return value.replace("\\", "\\\\").replace('"', '\\"')
