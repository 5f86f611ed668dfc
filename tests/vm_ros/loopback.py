"""DDS between processes of this machine, without a network, and a vm-ros that runs, for tests."""

import os
import socket
import subprocess
import sys
import threading
from contextlib import contextmanager, suppress
from pathlib import Path
from types import SimpleNamespace

from tests.vm_embedded.live.running import PATIENCE, Running
from vm_embedded.cameras.ros.bag_types import typestore
from vm_embedded.cameras.ros.message_fields import MESSAGES
from vm_ros.dds_middleware import DdsMiddleware
from vm_ros.middleware import TRANSFORMS

COMMAND = Path(sys.executable).parent / "vm-ros"

URI = (
    "<CycloneDDS><Domain><General><Interfaces><NetworkInterface name='lo' multicast='false'/></Interfaces>"
    "<AllowMulticast>false</AllowMulticast></General><Discovery><ParticipantIndex>auto</ParticipantIndex>"
    "<MaxAutoParticipantIndex>9</MaxAutoParticipantIndex><Peers><Peer address='127.0.0.1'/></Peers></Discovery>"
    "</Domain></CycloneDDS>"
)

_PORTS, _FIRST_PORT, _SPARE = 250, 7400, 249
"""Ports of a domain, the first port of domain 0, and one in each domain that DDS does not use."""


_CLAIMS = []


@contextmanager
def own_domain(monkeypatch):
    """A domain of DDS that no other test uses, in the environment. A participant may outlive its test."""
    for domain in range(1, 200):
        claim = socket.socket()
        with suppress(OSError):
            claim.bind(("127.0.0.1", _FIRST_PORT + _PORTS * domain + _SPARE))
            _CLAIMS.append(claim)
            break
        claim.close()
    else:
        raise AssertionError("no domain is free")
    monkeypatch.setenv("CYCLONEDDS_URI", URI)
    monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
    yield


class Peer:
    """Another node. It keeps the bytes of messages as they arrive, and rosbags decodes them."""

    def __init__(self):
        self.middleware = DdsMiddleware()
        self.types = self.middleware.types
        self._received = {}
        self._lock = threading.Lock()

    def listen(self, topic, kind):
        """Keep the messages of a topic. Their bytes are not decoded by the package that sent them."""
        kept = self._received[topic] = []

        class Raw(getattr(self.types, kind)):
            @classmethod
            def deserialize(cls, data, *_, **__):
                return SimpleNamespace(bytes=bytes(data))

        setattr(self.types, f"Raw{kind}", Raw)
        store, full = typestore(), MESSAGES[kind]

        def take(message):
            with self._lock:
                kept.append(store.deserialize_cdr(message.bytes, full))

        self.middleware.subscribe(topic, f"Raw{kind}", take, TRANSFORMS)

    def received(self, topic):
        """All messages of a topic so far."""
        with self._lock:
            return list(self._received[topic])


@contextmanager
def running(tmp_path, *options, command=None):
    """A vm-ros that ends with the block, whatever happens in it. command: instead of that with `options`."""
    words = [COMMAND, "--status-socket", tmp_path / "control", "--max-distance", "6", "--output-stdout", *options]
    words = command or words
    process = subprocess.Popen(
        list(map(str, words)), stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=dict(os.environ)
    )
    found = Running(process)
    try:
        yield found
        assert not found.errors, found.errors
    finally:
        process.kill()
        process.wait(PATIENCE)
        process.stdout.close()
        process.stderr.close()
