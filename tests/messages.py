"""Validates messages of vm-detect against their published JSON Schema."""

import json
from functools import cache
from pathlib import Path

from jsonschema import Draft202012Validator
from jsonschema.exceptions import best_match

SCHEMA = Path(__file__).parents[1] / "docs" / "messages.schema.json"


@cache
def validator(kind):
    """Validates one kind of messages; "" for any."""
    schema = json.loads(SCHEMA.read_text())
    if kind:
        del schema["oneOf"]
        schema["$ref"] = f"#/$defs/{kind}"
    return Draft202012Validator(schema)


def kind_of(message):
    """The kind of a message, as the schema names it."""
    if "type" in message:
        return "status" if "counts" in message else message["type"]
    return "file_frame"


def checked(message):
    """The message; fails unless it is as the schema says."""
    error = best_match(validator(kind_of(message)).iter_errors(message))
    assert error is None, f"{kind_of(message)} {error.json_path}: {error.message[:300]}"
    return message


def read_message(line):
    """The message of a line that vm-detect has printed, sent or answered."""
    return checked(json.loads(line))
