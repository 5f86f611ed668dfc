"""A frame as a line for people at a terminal, with what matters most of its line of JSON."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from ..borders.text import printable
from .messages import Message

_SIBILANTS = ("s", "x", "ch", "sh")


def to_readable_line(message: Message) -> str:
    """The message of a frame for people, such as "image3.jpg  1 ball 1.38 m, 2 posts, 3 robots  14.8 ms".

    The line has the source and the time in its video, or the number of a live frame and a state that is not ok; the
    objects with their distances, goal posts and robots; and the time of the call. Rejected candidates follow in lines
    of their own.
    """
    found = ", ".join(_found(message)) or "no objects"
    line = "  ".join([*_origin(message), found, f"{message['timing_ms']['total']:.1f} ms"])
    rejected = [
        f"    rejected: {each['class']} {each['confidence']:.2f} {_place(each)}: {each['reason']}"
        for each in message.get("rejected", ())
    ]
    return "\n".join(map(printable, [line, *rejected]))


def _origin(message: Message) -> Iterator[str]:
    """Where a frame comes from, and the state of its detector."""
    yield message["source"] if "source" in message else f"frame {message['frame']}"
    if message.get("stamp") is not None:
        yield f"{message['stamp']:.2f} s"
    if message.get("state", "ok") != "ok":
        yield message["state"]


def _found(message: Message) -> Iterator[str]:
    """What a frame shows: for each class the number of objects and their distances, then goal posts and robots."""
    classes: dict[str, list[Mapping[str, Any]]] = {}
    for each in message["detections"]:
        classes.setdefault(each["class"], []).append(each)
    for name, objects in classes.items():
        yield f"{_counted(name, objects)} {_joined([_place(each) for each in objects])}"
    for kind in ("posts", "robots"):
        things = message.get("field", {}).get(kind, ())
        if things:
            yield _counted(things[0]["class"], things)


def _place(each: Mapping[str, Any]) -> str:
    """The distance of an object, after the number of its track."""
    track = f"#{each['track']['id']} " if "track" in each else ""
    return f"{track}{each['distance']:.2f} m"


def _joined(words: Sequence[str]) -> str:
    return " and ".join(filter(None, [", ".join(words[:-1]), words[-1]]))


def _counted(name: str, things: Sequence[object]) -> str:
    """A number and the name of a class, in the plural for several."""
    ending = "" if len(things) == 1 else "es" if name.endswith(_SIBILANTS) else "s"
    return f"{len(things)} {name}{ending}"
