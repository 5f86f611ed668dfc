"""The C++ client: what it decodes, and the example behavior on a real vm-detect that fails, hangs and comes back."""

import re
import shutil
import signal
import socket
import subprocess
import threading
import time
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.soak.failing_camera import Fault
from tests.vm_embedded.live.running import PATIENCE, running
from tests.vm_embedded.output.features import demo_frame, full, scene
from vm_embedded import Tracker
from vm_embedded.borders.records import entries
from vm_embedded.cameras.camera import Shot
from vm_embedded.detection.detections import STAGES
from vm_embedded.output.binary_form import HEADER as HEAD
from vm_embedded.output.binary_form import LAYOUT, RECORDS, number_type, to_binary
from vm_embedded.output.messages import LiveFrame, live_frame, state_message

CHECKOUT = Path(__file__).parents[2]
HEADER = CHECKOUT / "deploy" / "cpp" / "vm_detect.hpp"
EXAMPLE = CHECKOUT / "docs" / "examples" / "behavior.cpp"
STRICT = ("-std=c++17", "-Wall", "-Wextra", "-Werror", "-Wconversion", "-Wshadow", "-pedantic")
BINARY = ("--output-unix-format", "binary")


def printers(record, done):
    """Functions of C++ that print the fields of a record and its parts, under their names in JSON."""
    fields = [each for each in entries(record) if (each.is_record or number_type(each)) and each.name != "state"]
    for each in fields:
        if each.is_record and each.type not in done:
            yield from printers(each.type, done | {each.type})
            done.add(each.type)
    name = "Frame" if record is LiveFrame else record.__name__
    yield f"void print_fields(const {name}& made) {{\n"
    for each in fields:
        if each.many is dict:
            yield "".join(f'print("{stage}", made.{each.attribute}.{stage});\n' for stage in STAGES)
        else:
            yield f'print("{each.name}", made.{each.attribute});\n'
    yield "}\n"


@pytest.fixture(scope="module")
def compiled(tmp_path_factory):
    """Compiles a program with the header, and returns its path."""
    if shutil.which("g++") is None:
        pytest.skip("needs g++")
    folder = tmp_path_factory.mktemp("cpp")

    def build(source, *options):
        target = folder / f"{source.stem}{len(options)}"
        if not target.exists():
            (folder / "printers.hpp").write_text("".join(printers(LiveFrame, set())))
            command = ["g++", *STRICT, *options, "-I", HEADER.parent, "-I", folder, source, "-o", target]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            assert done.returncode == 0, done.stderr
        return target

    return build


@pytest.fixture(scope="module")
def dump(compiled):
    """What the header decodes from bytes, as lines; with the compiler's checks of memory and undefined behavior."""
    program = compiled(
        CHECKOUT / "tests/deploy/cpp/dump.cpp", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"
    )

    def read(content):
        done = subprocess.run([program], input=content, capture_output=True, timeout=PATIENCE, check=False)
        assert done.returncode == 0, done.stderr.decode()
        return done.stdout.decode(errors="replace").splitlines()

    return read


@pytest.fixture(scope="module")
def messages():
    """Messages with all that a frame can have, and one with nothing."""
    image, detections = demo_frame(6)
    now = time.monotonic()
    shot = Shot(image, now - 0.02, arrived=now - 0.01)
    view = detections.observation.view
    tracked = Tracker().update(replace(detections, field=scene(view)), 1.0)
    results = [detections, tracked, replace(detections, field=full(view)), replace(detections, objects=())]
    numbered = enumerate(results, start=2**32 + 5)
    frames = [live_frame(number, "ok", shot, each, now).as_dict() for number, each in numbered]
    return [*frames, state_message("camera_lost", "no new frame for 1.0 s - 10 µs late"), state_message("ok", "")]


def leaves(name, value):
    """What dump.cpp prints for a value of a message: names, each with a number or a text."""
    if isinstance(value, dict):
        for each, part in value.items():
            if part is not None and each not in ("type", "state", "truth", "reason"):
                yield from leaves(each, part)
    elif isinstance(value, list):
        for each in value:
            yield from leaves(name, each)
    else:
        yield name, np.nan if value is None else value


def expected_lines(message):
    """What dump.cpp prints for a message."""
    yield "state", f"{message['state']} {message.get('reason', '')}"
    if message["type"] == "frame":
        times = dict.fromkeys(STAGES, np.nan) | message["timing_ms"]
        yield from leaves("", message | {"frame": message["frame"] % 2**32, "timing_ms": times})


def test_it_decodes_the_numbers_of_the_json(dump, messages):
    lines = dump(b"".join(map(to_binary, messages)))
    expected = [each for message in messages for each in expected_lines(message)]
    assert [line.partition(" ")[0] for line in lines] == [name for name, _ in expected]
    assert len(lines) > 1000
    for line, (name, value) in zip(lines, expected, strict=True):
        found = line.partition(" ")[2]
        if isinstance(value, str):
            assert found == value
        else:
            tolerance = 1e-15 if name in ("t", "wall") else 1e-6
            np.testing.assert_allclose(float(found), value, rtol=tolerance, err_msg=line)


@pytest.mark.long
@settings(max_examples=60)
@given(st.data())
def test_damaged_messages_are_errors_and_touch_no_foreign_memory(dump, messages, data):
    content = bytearray(to_binary(data.draw(st.sampled_from(messages))))
    for _ in range(data.draw(st.integers(1, 4))):
        place = data.draw(st.integers(0, min(len(content), 200) - 1))
        content[place] = data.draw(st.integers(0, 255))
    dump(bytes(content[: data.draw(st.integers(1, len(content)))]))


LARGEST = 2**32 - 1


def hostile(message):
    """(what is wrong, bytes) of copies of a message whose header, records and text do not fit together."""
    content = to_binary(message)
    head = np.frombuffer(content, HEAD, 1)[0]
    body = content[HEAD.itemsize :]

    def changed(body, **numbers):
        new = head.copy()
        for name, number in numbers.items():
            new[name] = number
        return new.tobytes() + body

    text = int(head["text"])
    for number in {text + 1, len(body) + 1, LARGEST, text - 1} - {-1}:
        yield f"text of {number} bytes, not {text}", changed(body, text=number)
    for name, kind in RECORDS.items():
        count = int(head[name])
        for number in {count + 1, count + len(body) // kind.itemsize + 1, LARGEST, count - 1} - {-1}:
            yield f"{number} {name}, not {count}", changed(body, **{name: number})
    for end in {0, 1, len(body) // 2, len(body) - 1} - {-1, len(body)}:
        yield f"only {end} bytes behind the header, as announced", changed(body[:end], length=HEAD.itemsize - 4 + end)
    for more in (1, max(kind.itemsize for kind in RECORDS.values())):
        yield f"{more} more bytes, as announced", changed(body + bytes(more), length=len(content) - 4 + more)
    if body:
        yield "a header alone", content[: HEAD.itemsize]
    yield "a header that ends early", content[: HEAD.itemsize - 1]
    yield "a length within the header", changed(body, length=HEAD.itemsize - 5)
    yield "the largest length", changed(body, length=LARGEST)
    yield "neither a frame nor a state", changed(body, is_frame=2)
    yield "an unknown state", changed(body, state=LARGEST)


@pytest.mark.long
def test_a_message_that_does_not_fit_its_header_is_refused(dump, messages):
    """Each is alone in memory of its size, so that the checks of the compiler find any read beyond its end."""
    cases = [each for message in (messages[2], messages[-2], messages[-1]) for each in hostile(message)]
    assert len(cases) > 100
    accepted = {}
    for wrong, content in cases:
        *lines, last = dump(content)
        if lines or not last.startswith("error "):
            accepted[wrong] = last
    assert not accepted


def test_a_goal_whose_post_is_not_there_is_refused(dump, messages):
    content, count = to_binary(messages[2]), len(messages[2]["field"]["goals"])
    head = np.frombuffer(content, HEAD, 1)[0]
    start = HEAD.itemsize + sum(int(head[name]) * RECORDS[name].itemsize for name in ("detections", "posts"))
    assert np.frombuffer(content, RECORDS["goals"], count, start)["goals"].tolist() == messages[2]["field"]["goals"]
    for post in (int(head["posts"]), LARGEST):
        (line,) = dump(content[:start] + np.uint32(post).tobytes() + content[start + 4 :])
        assert line == "error a goal has a post that is not there"


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"{", 'lines of JSON; set [output] unix_format = "binary"'),
        (b"\xff\xff\xff\xff", "is this vm-detect?"),
        (b"\0\0\0\0", "a message of 4 bytes"),
    ],
)
def test_it_says_what_is_wrong(dump, content, says):
    (line,) = dump(content)
    assert line.startswith("error ")
    assert says in line


def test_another_layout_is_an_error(dump, messages):
    content = bytearray(to_binary(messages[0]))
    content[4:8] = (LAYOUT ^ 1).to_bytes(4, "little")
    (line,) = dump(bytes(content))
    assert f"layout {LAYOUT ^ 1} of the binary form" in line


class Behaving:
    """The example behavior as a process, and the actions that it prints."""

    def __init__(self, process):
        self.process, self.actions = process, []
        self._passed = 0
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    def _listen(self):
        for line in self.process.stdout:
            self.actions.append(line.split(" ", 1)[1].strip())

    def wait_for(self, start):
        """Wait until an action starts so, after those that were waited for before."""
        deadline = time.monotonic() + PATIENCE
        while time.monotonic() < deadline:
            for number, action in enumerate(self.actions[self._passed :], start=self._passed + 1):
                if action.startswith(start):
                    self._passed = number
                    return action
            assert self.process.poll() is None
            time.sleep(0.02)
        raise AssertionError(f"waited in vain for {start}: {self.actions[-5:]}")


@contextmanager
def behaving(compiled, path):
    """The example behavior while the block runs; it must stop when it is asked to."""
    with subprocess.Popen([compiled(EXAMPLE), str(path)], stdout=subprocess.PIPE, text=True) as process:
        try:
            yield Behaving(process)
            assert process.poll() is None
            process.send_signal(signal.SIGTERM)
            assert process.wait(PATIENCE) == 0
        finally:
            process.kill()


@pytest.mark.long
def test_a_behavior_walks_to_the_ball_and_stands_while_the_camera_is_lost(compiled, tmp_path):
    path = tmp_path / "lines"
    camera = ("--camera-lost-ms", 500, "--camera-retry-ms", 50, "--track")
    unplugged = Fault("unplug", at=4.0, seconds=4.0)
    with behaving(compiled, path) as robot:
        robot.wait_for("stand: unreachable: can't connect")
        with running(tmp_path, *camera, "--output-unix", path, *BINARY, faults=[unplugged]):
            assert re.match(r"walk: the ball is -?\d\.\d m ahead", robot.wait_for("walk: "))
            robot.wait_for("stand: camera_lost")
            robot.wait_for("walk: ")


@pytest.mark.long
def test_a_behavior_goes_on_while_the_detector_hangs_dies_and_comes_back(compiled, tmp_path):
    path = tmp_path / "lines"
    options = ("--camera", "synthetic", "--output-unix", path, *BINARY)
    with behaving(compiled, path) as robot:
        with running(tmp_path, *options) as found:
            robot.wait_for("walk: ")
            found.process.send_signal(signal.SIGSTOP)
            robot.wait_for("stand: no frame is new enough")
            robot.wait_for("stand: unreachable: vm-detect is silent")
            found.process.send_signal(signal.SIGCONT)
            robot.wait_for("walk: ")
            found.stop(signal.SIGKILL)
        robot.wait_for("stand: unreachable: ")
        with running(tmp_path, *options):
            robot.wait_for("walk: ")


@pytest.mark.long
def test_a_behavior_survives_what_is_no_detector(compiled, tmp_path, messages):
    path = tmp_path / "lines"
    whole = to_binary(state_message("pose_stale", "no pose received yet"))
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind(str(path))
        listening.listen()
        listening.settimeout(PATIENCE)
        with behaving(compiled, path) as robot:
            connection, _ = listening.accept()
            with connection:
                robot.wait_for("stand: unreachable: waiting for the first message")
            for content, start in (
                (b'{"type": "state"}\n', "stand: unreachable: the socket sends lines of JSON"),
                (b"\xff" * 1000, "stand: unreachable: a message of"),
                (whole[:-3], "stand: unreachable: vm-detect has closed the connection"),
                (np.random.default_rng(0).bytes(HEAD.itemsize), "stand: unreachable: "),
            ):
                connection, _ = listening.accept()
                with connection:
                    connection.sendall(content)
                    if content != whole[:-3]:
                        robot.wait_for(start)
                if content == whole[:-3]:
                    robot.wait_for(start)
            connection, _ = listening.accept()
            with connection:
                for each in whole:  # byte by byte
                    connection.sendall(bytes([each]))
                robot.wait_for("stand: pose_stale: no pose received yet")


def test_a_path_that_is_too_long_is_an_error(compiled, tmp_path):
    done = subprocess.run([compiled(EXAMPLE), "/tmp/" + "x" * 200], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.startswith("behavior: the path of a socket must have 1 to 107 bytes: /tmp/x")
