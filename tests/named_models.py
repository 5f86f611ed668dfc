"""Model files with other names in their manifest, and names of all kinds."""

import json
from functools import cache

import onnx
from onnx import helper

from tests.fixtures.make_drawn import FOLDER
from vm_embedded.network.manifest import METADATA_KEY
from vm_embedded.network.model_file import SEAL_KEY, sealed

from .vm_embedded.network.protobuf import varint

GOOD = ("ball", "Bälle", "ボール", "мяч", "⚽ 球", "\U0001f3c0", "traffic light", "<b>&amp;</b>", "a'\"\\$%", "x" * 100)
_BAD = (
    "\n",
    "\r",
    "\0",
    "\x1b[2J",
    "\x9b",
    "\x7f",
    "\t",
    "\u2028",
    "\u2029",
    "\x85",
    "\u202e",
    "\ufeff",
    "\ud800",
    "\udfff",
)


@cache
def _drawn():
    """The drawn network's file without manifest, seal and canary, and its manifest."""
    model = onnx.load(FOLDER / "ball.onnx")
    manifest = next(each.value for each in model.metadata_props if each.key == METADATA_KEY)
    helper.set_model_props(model, {})
    return model.SerializeToString(), manifest


def with_names(ball="ball", other="line", origin="made_from", text="a test"):
    """The drawn network's model file with other names of two classes and other names and texts of its provenance."""
    content, manifest = _drawn()
    manifest = json.loads(manifest)
    for entry, name in zip(manifest["classes"], (ball, other), strict=False):
        entry["name"] = name
    manifest["provenance"] = {origin: text}
    entry = b"".join(
        bytes([number << 3 | 2]) + varint(len(text)) + text
        for number, text in ((1, METADATA_KEY.encode()), (2, json.dumps(manifest).encode()))
    )
    assert SEAL_KEY.encode() not in content
    return sealed(content + bytes([14 << 3 | 2]) + varint(len(entry)) + entry)


def random_name(chance):
    """A name of any Unicode, of up to a million characters, as JSON may have it. chance: of random."""
    kind = chance.randrange(10)
    if kind == 0:
        return chance.choice(GOOD)
    if kind == 1:  # letters of many writings
        return "".join(chr(chance.randrange(0xA1, 0x3000)) for _ in range(chance.randrange(1, 30)))
    if kind == 2:
        name = chance.choice(GOOD)
        at = chance.randrange(len(name) + 1)
        return name[:at] + chance.choice(_BAD) + name[at:]
    if kind == 3:
        return "".join(chance.choices(GOOD, k=chance.randrange(1, 60)))
    if kind == 4:
        return chance.choice("x\U0001f3c0\u20e3") * chance.choice((99, 100, 101, 10**3, 7 * 10**4, 10**6))
    if kind == 5:
        return "".join(chr(chance.randrange(32)) for _ in range(chance.randrange(1, 9)))
    length = int(10 ** chance.uniform(0.0, 6.0)) if kind == 6 else chance.randrange(1, 40)
    return "".join(map(chr, chance.choices(range(0x110000), k=length)))
