"""A running detector gets models whose names are of any kind, while all its outputs are read."""

import json
import random
import signal
import socket
import struct
import threading
from urllib.request import urlopen

import cv2
import numpy as np
import pytest

from tests.fixtures.make_drawn import FOLDER
from tests.named_models import GOOD, random_name, with_names
from tests.vm_embedded.live.running import running
from tests.vm_embedded.live.test_status_page import free_address
from vm_embedded.borders.text import name_fault, text_fault

PARTS, MODELS = 2, 125
"""Models with four names each."""


class Readers:
    """Threads that read the page, the stream and the binary form until they are stopped.

    counts: what each has read. names: the classes of the last frame in the binary form. faults: what went wrong.
    """

    def __init__(self, page, lines):
        self.counts, self.names, self.faults = {}, (), []
        self._page, self._lines, self._stopped = page, lines, threading.Event()
        self._threads = [
            threading.Thread(target=self._guarded, args=(each,))
            for each in (self._read_pages, self._read_stream, self._read_binary)
        ]

    def __enter__(self):
        for each in self._threads:
            each.start()
        return self

    def __exit__(self, *_):
        self._stopped.set()
        for each in self._threads:
            each.join()

    def _guarded(self, read):
        try:
            read()
        except Exception as error:  # noqa: BLE001 - it is told by the test
            self.faults.append(f"{read.__name__}: {error!r}")

    def _count(self, what):
        self.counts[what] = self.counts.get(what, 0) + 1

    def _read_pages(self):
        while not self._stopped.wait(0.3):
            for name in ("/", "/state", "/map", "/preview?value=0.2", "/metrics"):
                with urlopen(f"http://{self._page}{name}", timeout=60.0) as answer:
                    content = answer.read().decode()
                if name not in ("/", "/metrics"):
                    json.loads(content)
                self._count(name)

    def _read_stream(self):
        with urlopen(f"http://{self._page}/stream", timeout=60.0) as answer:
            while not self._stopped.is_set():
                length = 0
                while (line := answer.readline()) != b"\r\n" or not length:
                    assert line, "the stream has ended"
                    name, _, value = line.partition(b":")
                    length = int(value) if name == b"Content-Length" else length
                picture = cv2.imdecode(np.frombuffer(answer.read(length), np.uint8), cv2.IMREAD_COLOR)
                assert picture is not None
                self._count("/stream")

    def _read_binary(self):
        with socket.socket(socket.AF_UNIX) as connection:
            connection.settimeout(60.0)
            connection.connect(str(self._lines))
            stream = connection.makefile("rb")
            while not self._stopped.is_set():
                (rest,) = struct.unpack("<I", stream.read(4))
                body = stream.read(rest)
                assert len(body) == rest, "the binary form has ended"
                (size,) = struct.unpack_from("<I", body, 128 - 4)
                text = body[len(body) - size :].decode()
                if body[8 - 4]:  # a frame
                    self.names = tuple(text.split("\n"))
                self._count("binary")


@pytest.mark.long
@pytest.mark.parametrize("part", range(PARTS))
def test_a_thousand_names_in_models_are_shown_or_refused(part, tmp_path):
    chance = random.Random(part)
    page, lines, model = free_address(), tmp_path / "binary", tmp_path / "model.onnx"
    model.write_bytes(with_names())
    camera = ("--camera", FOLDER, "--camera-fps", "5", "--camera-loop", "--live")
    outputs = ("--status-page", page, "--output-unix", lines, "--output-unix-format", "binary")
    shown, refused, seen = "ball", 0, 0
    with running(tmp_path, *camera, "--model", model, *outputs) as found:
        found.wait_for_state("ok")
        with Readers(page, lines) as readers:
            for _ in range(MODELS):
                names = random_names(chance)
                put(model, with_names(*names))
                found.process.send_signal(signal.SIGHUP)
                event = found.wait(lambda seen=seen: next(iter(reloads(found)[seen:]), None))
                seen += 1
                assert readers.faults == []
                # Two halves of a character beside each other become one character in JSON.
                *three, text = (json.loads(json.dumps(each)) for each in names)
                if any(map(name_fault, three)) or text_fault(text) or three[0] == three[1]:
                    refused += 1
                    assert event["event"] == "reload refused"
                    assert event["reason"].isprintable()
                else:
                    assert event["event"] == "reloaded", (names, event)
                    shown = three[0]
                since = len(found.messages)
                found.wait(lambda since=since, name=shown: name in classes(found.messages[since:]))
            found.wait(lambda: shown in readers.names)
        assert readers.faults == []
        assert min(readers.counts.values()) > 5
        assert set(readers.counts) == {"/", "/state", "/map", "/preview?value=0.2", "/metrics", "/stream", "binary"}
        assert 0 < refused < MODELS
        assert found.stop()[0] == 0


def random_names(chance):
    """Four names for a model: of any kind, or good ones."""
    names = [random_name(chance) for _ in range(4)]
    if chance.randrange(2):
        names = [name if not name_fault(name) else chance.choice(GOOD) for name in names]
    return names


def put(path, content):
    """Replace a file at once."""
    new = path.with_suffix(".new")
    new.write_bytes(content)
    new.replace(path)


def reloads(found):
    return [each for each in list(found.events) if each["event"] in ("reload refused", "reloaded")]


def classes(messages):
    return {each["class"] for message in messages for each in message.get("detections", ())}
