"""The connection to ROS 2 through the package cyclonedds, without an installation of ROS.

ROS 2 sends its messages over DDS. Nodes of all DDS vendors then see the topics: /tf is rt/tf there, and
tf2_msgs/msg/TFMessage is tf2_msgs::msg::dds_::TFMessage_.
"""

from __future__ import annotations

import os
import re
import threading
from collections.abc import Callable, Mapping
from types import SimpleNamespace
from typing import Any

from cyclonedds.core import DDSException, InstanceState, ReadCondition, SampleState, ViewState, WaitSet
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import make_idl_struct
from cyclonedds.idl import types as idl
from cyclonedds.internal import InvalidSample
from cyclonedds.pub import DataWriter
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

from vm_embedded.cameras.ros.message_fields import FIELDS, fields_of, short_name
from vm_embedded.errors import InputError, one_line

from .cdr import encode
from .middleware import DETECTIONS, FIXED_TRANSFORMS, POSES, SENSOR, TRANSFORMS
from .plain_messages import with_arrays

_RELIABLE = Policy.Reliability.Reliable(duration(milliseconds=20))
_QOS = {
    SENSOR: Qos(Policy.Reliability.BestEffort, Policy.History.KeepLast(1)),
    POSES: Qos(Policy.Reliability.BestEffort, Policy.History.KeepLast(100)),
    TRANSFORMS: Qos(_RELIABLE, Policy.History.KeepLast(100)),
    FIXED_TRANSFORMS: Qos(_RELIABLE, Policy.History.KeepLast(100), Policy.Durability.TransientLocal),
    DETECTIONS: Qos(_RELIABLE, Policy.History.KeepLast(10)),
}
_TICK = 0.1
"""Longest time after which the thread sees that it should end [s]."""


class DdsPublisher:
    """A writer of DDS."""

    def __init__(self, writer: Any) -> None:
        self._writer = writer

    def publish(self, message: Any) -> None:
        """Send a message, or lose it if a reader is too slow."""
        try:
            self._writer.write(message)
        except DDSException as error:
            if error.code not in (DDSException.DDS_RETCODE_TIMEOUT, DDSException.DDS_RETCODE_OUT_OF_RESOURCES):
                raise

    @property
    def readers(self) -> int:
        """Number of subscriptions."""
        return int(self._writer.get_publication_matched_status().current_count)


class DdsMiddleware:
    """A participant of DDS, whose readers a thread waits for. Raises InputError if DDS can't start."""

    parameters: Mapping[str, Any] = {}
    remark = ""

    def __init__(self) -> None:
        self.types: Any = message_classes()
        try:
            self._participant = DomainParticipant(_domain())
        except DDSException as error:
            raise InputError(f"DDS can't start; check the network and CYCLONEDDS_URI: {one_line(error)}") from error
        self._waiting = WaitSet(self._participant)
        self._readers: list[tuple[DataReader[Any], Callable[[Any], None]]] = []
        self._conditions: list[ReadCondition] = []
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._receive, name="ros", daemon=True)

    def subscribe(self, topic: str, message: str, take: Callable[[Any], None], kind: str = SENSOR) -> None:
        """Have `take` called with each message of a topic."""
        reader = DataReader(self._participant, self._topic(topic, message), _QOS[kind])
        condition = ReadCondition(reader, ViewState.Any | InstanceState.Any | SampleState.NotRead)
        self._waiting.attach(condition)
        self._readers.append((reader, take))
        self._conditions.append(condition)  # the wait set does not keep it alive

    def publisher(self, topic: str, message: str, kind: str = DETECTIONS) -> DdsPublisher:
        """A publisher of messages with a short name."""
        return DdsPublisher(DataWriter(self._participant, self._topic(topic, message), _QOS[kind]))

    def _topic(self, topic: str, message: str) -> Topic[Any]:
        absolute = topic.removeprefix("/")  # as a node of ROS without a namespace resolves it
        return Topic(self._participant, f"rt/{absolute}", getattr(self.types, message))

    def start(self) -> None:
        """Begin to receive."""
        self._thread.start()

    def _receive(self) -> None:
        while not self._closing.is_set():
            if self._readers:
                self._waiting.wait(duration(seconds=_TICK))
            else:  # a wait set without conditions returns at once
                self._closing.wait(_TICK)
            for reader, take in self._readers:
                for message in _valid(reader):
                    take(message)

    def close(self) -> None:
        """Stop the thread; the participant closes with this object."""
        self._closing.set()
        if self._thread.is_alive():
            self._thread.join(10 * _TICK)


def _valid(reader: DataReader[Any]) -> list[Any]:
    """The new messages of a reader, without the notes that a writer has left, and without text that is not UTF-8."""
    try:
        return [each for each in reader.take(N=100) if not isinstance(each, InvalidSample)]
    except UnicodeDecodeError:
        return []


def _domain() -> int:
    """The domain of $ROS_DOMAIN_ID. Raises InputError if it is not from 0 to 232."""
    text = os.environ.get("ROS_DOMAIN_ID", "") or "0"
    if not text.isdecimal() or int(text) > 232:
        raise InputError(f"ROS_DOMAIN_ID must be a number from 0 to 232, not {text!r}")
    return int(text)


_PRIMITIVES: dict[str, Any] = {
    "bool": bool,
    "byte": idl.uint8,
    "uint8": idl.uint8,
    "int32": idl.int32,
    "uint32": idl.uint32,
    "float32": idl.float32,
    "float64": idl.float64,
    "string": str,
}


def message_classes() -> SimpleNamespace:
    """The classes of all messages by their short names, and functions that make their arrays."""
    classes: dict[str, Any] = {}
    for full in FIELDS:
        package, _, name = full.split("/")
        classes[short_name(full)] = _message_class(full, f"{package}::msg::dds_::{name}_", classes)
    return with_arrays(classes)


def _message_class(full: str, dds_name: str, classes: dict[str, Any]) -> Any:
    """The class of a message. classes: those that it may contain."""
    name = full.rpartition("/")[2]
    types = {field: _type(kind, classes) for kind, field in fields_of(full)}
    made: Any = make_idl_struct(name, dds_name, types)
    made.serialize = lambda self, *_, **__: encode(short_name(full), self)
    octets = [field for kind, field in fields_of(full) if kind == "uint8[]"]
    if octets:
        # cyclonedds reads octets as a list of numbers, which takes a hundred times as long as bytes. But it can't
        # describe bytes to other participants, so that only the decoding is that of a class with bytes.
        made.deserialize = make_idl_struct(name, dds_name, {**types, **dict.fromkeys(octets, bytes)}).deserialize
    return made


def _type(kind: str, classes: dict[str, Any]) -> Any:
    """The type of a field: primitive, message, sequence or array."""
    found = re.fullmatch(r"(\w+)(\[(\d*)\])?", kind)
    assert found is not None, kind
    single = _PRIMITIVES.get(found[1]) or classes[found[1]]
    if found[2] is None:
        return single
    array: Any = idl.array
    sequence: Any = idl.sequence
    return array[single, int(found[3])] if found[3] else sequence[single]
