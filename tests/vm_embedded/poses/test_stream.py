"""Poses over real sockets: a camera that turns fast, poses that come late and shaken, and what is no pose."""

import asyncio
import json
import random
import socket
import subprocess
import threading
import time
from contextlib import suppress

import numpy as np
import pytest

from tests.messages import read_message
from tests.preloaded import run_preloaded
from tests.vm_embedded.live.running import arguments, counts, running
from tests.vm_embedded.poses.test_parsing import quaternion
from vm_embedded.cameras.synthetic import Motion
from vm_embedded.poses import stream
from vm_embedded.poses.settings import PoseSettings

TURN = 3.0
MOTION = Motion(TURN)


def pose_line(motion, at):
    orientation = motion.orientation(at)
    return json.dumps({"t": at, "height": orientation.height, "quaternion": quaternion(orientation)}).encode() + b"\n"


class Sender(threading.Thread):
    """Sends the poses of a motion, 100 a second, 20 ms late, each up to 5 ms more or less."""

    def __init__(self, send, motion=MOTION):
        super().__init__(daemon=True)
        self._send, self._motion = send, motion
        self.on = True

    def run(self):
        chance = random.Random(5)
        at = time.monotonic()
        while self.on:
            at += 0.01
            due = at + 0.02 + chance.uniform(-0.005, 0.005)
            time.sleep(max(due - time.monotonic(), 0.0))
            try:
                self._send(pose_line(self._motion, at))
            except OSError:
                return


def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as made:
        made.bind(("127.0.0.1", 0))
        return made.getsockname()[1]


def errors_of(found):
    """Distance of each ball from where it was, as a part of its distance."""
    errors = []
    for each in found.frames:
        truth = MOTION.ball(each["t"])
        errors += [np.linalg.norm(ball["position"] - truth) / np.linalg.norm(truth) for ball in each["detections"][:1]]
    return np.array(errors)


def measured(tmp_path):
    """Errors of a hundred balls while the camera turns."""
    port = free_port()
    source = ("--camera", f"synthetic:{TURN}", "--pose-source", f"udp:127.0.0.1:{port}")
    with running(tmp_path, *source) as found, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sending:
        sender = Sender(lambda line: sending.sendto(line, ("127.0.0.1", port)))
        sender.start()
        found.wait(lambda: len(errors_of(found)) >= 100)
        sender.on = False
        sender.join()
        found.stop()
    return errors_of(found)


@pytest.mark.long
def test_a_ball_is_in_its_place_while_the_camera_turns_fast(tmp_path):
    error = np.median(measured(tmp_path))
    assert error < 0.02
    print(f"{100 * error:.2f} % of the distance")


@pytest.mark.long
def test_poses_that_stop_are_stale_and_nothing_is_reported(tmp_path):
    path = tmp_path / "poses"
    with running(tmp_path, "--camera", "synthetic", "--pose-source", f"unix:{path}") as found:
        found.wait_for_state("pose_stale")
        assert found.frames == []
        with socket.socket(socket.AF_UNIX) as connection:
            connection.connect(str(path))
            sender = Sender(connection.sendall, Motion())
            sender.start()
            found.wait_for_state("ok")
            found.wait(lambda: len(found.frames) > 10)
            sender.on = False
            sender.join()
        found.wait_for_state("pose_stale")
        before = counts(tmp_path)["frames"]  # which messages on their way can't change
        time.sleep(0.5)
        assert counts(tmp_path)["frames"] == before
        found.stop()


def test_poses_come_by_standard_input_too(tmp_path):
    options = ("--camera", "synthetic", "--pose-source", "stdin")
    with running(tmp_path, *options, stdin=subprocess.PIPE) as found:

        def send(line):
            found.process.stdin.write(line)
            found.process.stdin.flush()

        sender = Sender(send, Motion())
        sender.start()
        found.wait_for_state("ok")
        found.wait(lambda: len(found.frames) > 10)
        sender.on = False
        sender.join()
        found.stop()


@pytest.mark.long
def test_ten_thousand_bad_poses_change_nothing(tmp_path):
    chance = random.Random(3)
    port = free_port()
    good = [pose_line(Motion(), at) for at in range(10)]

    def spoilt():
        line = bytearray(chance.choice(good))
        for _ in range(chance.randrange(1, 8)):
            line[chance.randrange(len(line))] = chance.randrange(256)
        kind = chance.randrange(4)
        if kind == 0:
            return bytes(line)
        if kind == 1:
            return bytes(line[: chance.randrange(len(line))])
        if kind == 2:
            value = chance.choice([None, True, "x", 1e400, [1], {}, -1e300, 10**400])
            return json.dumps({"t": time.monotonic(), "height": value, "quaternion": [1, 0, 0, 0]}).encode()
        return chance.randbytes(chance.randrange(1, 200))

    with running(tmp_path, "--camera", "synthetic", "--pose-source", f"udp:127.0.0.1:{port}") as found:
        found.wait_for_state("pose_stale")
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sending:
            sent = 0
            while sent < 10000:
                for _ in range(50):
                    sending.sendto(spoilt(), ("127.0.0.1", port))
                    sent += 1
                time.sleep(0.01)
            found.wait(lambda: counts(tmp_path)["poses_bad"] > 5000)
            sender = Sender(lambda line: sending.sendto(line, ("127.0.0.1", port)), Motion())
            sender.start()
            found.wait_for_state("ok")
            sender.on = False
            sender.join()
        assert found.stop()[0] == 0


@pytest.mark.long
def test_what_the_line_of_a_pose_lacks_is_said_in_the_state(tmp_path):
    port = free_port()
    with running(tmp_path, "--camera", "synthetic", "--pose-source", f"udp:127.0.0.1:{port}") as found:
        found.wait_for_state("pose_stale")
        asked = run_preloaded(arguments(tmp_path, "--status"))
        assert read_message(asked.stdout)["reason"] == "no pose received yet"
        found.stop()


@pytest.mark.long
def test_a_long_line_on_standard_input_is_left_out_and_the_next_one_is_read(tmp_path):
    with running(tmp_path, "--camera", "synthetic", "--pose-source", "stdin", stdin=subprocess.PIPE) as found:
        found.wait_for_state("pose_stale")
        found.process.stdin.write(b"x" * 9000 + b"\n")
        for _ in range(200):
            pose = {"t": time.monotonic(), "height": 0.8, "quaternion": [0.98, 0.0, 0.199, 0.0]}
            found.process.stdin.write(json.dumps(pose).encode() + b"\n")
            found.process.stdin.flush()
            time.sleep(0.01)
        found.wait_for_state("ok")
        found.stop()


@pytest.mark.long
def test_attack_12_a_pose_in_the_future_is_refused_and_blocks_no_good_one(tmp_path):
    port = free_port()
    source = ("--camera", f"synthetic:{TURN}", "--pose-source", f"udp:127.0.0.1:{port}")
    with running(tmp_path, *source) as found, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sending:
        sender = Sender(lambda line: sending.sendto(line, ("127.0.0.1", port)))
        sender.start()
        found.wait_for_state("ok")
        for ahead in (0.1, 0.5, 0.9):
            sending.sendto(pose_line(MOTION, time.monotonic() + ahead), ("127.0.0.1", port))
        found.wait(lambda: counts(tmp_path)["poses_bad"] >= 3)
        before, accepted = len(found.frames), counts(tmp_path)["poses"]
        found.wait(lambda: len(found.frames) > before + 5)
        assert counts(tmp_path)["poses"] > accepted

        def says_why():
            sending.sendto(pose_line(MOTION, time.monotonic() + 0.5), ("127.0.0.1", port))
            return any("from now on the monotonic clock" in each.get("reason", "") for each in found.messages)

        found.wait(says_why)
        sender.on = False
        sender.join()
        found.stop()


def test_a_wait_before_a_pose_is_read_does_not_move_its_wall_time(monkeypatch):
    """The other processes of a busy robot take the processor from the daemon at any place."""
    now = [100.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    monkeypatch.setattr(time, "time", lambda: now[0] + 1000.0)
    read = stream.parse_pose_line

    def read_late(*given):
        now[0] += 0.03
        return read(*given)

    monkeypatch.setattr(stream, "parse_pose_line", read_late)
    poses = stream.PoseStream(PoseSettings(source="stdin", clock="wall"), lambda reason: None)
    assert poses.take(pose_line(MOTION, 1100.0))
    assert poses.poses.newest == pytest.approx(100.0, abs=1e-6)


@pytest.mark.long
@pytest.mark.parametrize("flood", [b"x\n", b"\n", b'{"t": 1.0, "height": 0.8, "quaternion": [1, 0, 0, 0]}\n'])
def test_a_client_that_floods_the_pose_socket_stops_nothing(flood, tmp_path):
    path = tmp_path / "poses"
    with running(tmp_path, "--camera", "synthetic", "--pose-source", f"unix:{path}") as found:
        found.wait_for_state("pose_stale")
        with socket.socket(socket.AF_UNIX) as good, socket.socket(socket.AF_UNIX) as bad:
            good.connect(str(path))
            bad.connect(str(path))
            sender = Sender(good.sendall, Motion())
            sender.start()
            found.wait_for_state("ok")
            threading.Thread(target=send_until_closed, args=(bad, 10000 * flood), daemon=True).start()
            found.wait(lambda: len(found.frames) > 10)
            before = len(found.frames)
            found.wait(lambda: len(found.frames) > before + 10)
            assert counts(tmp_path)["frames"] > before
            assert found.stop()[0] == 0
            sender.on = False
            sender.join()


def send_until_closed(connection, block):
    with suppress(OSError):
        while True:
            connection.sendall(block)


@pytest.mark.long
def test_a_datagram_of_many_lines_is_cut_off(tmp_path):
    port = free_port()
    with running(tmp_path, "--camera", "synthetic", "--pose-source", f"udp:127.0.0.1:{port}") as found:
        found.wait_for_state("pose_stale")
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sending:
            sending.sendto(64 * b"x\n", ("127.0.0.1", port))
            sending.sendto(30000 * b"x\n", ("127.0.0.1", port))
            sending.sendto(pose_line(Motion(), time.monotonic()), ("127.0.0.1", port))

        found.wait(lambda: counts(tmp_path)["poses"] == 1)
        assert counts(tmp_path)["poses_bad"] == 64 + 64 + 1
        found.stop()


@pytest.mark.long
def test_another_reason_of_the_same_state_is_logged_but_not_another_number_in_it(tmp_path):
    path = tmp_path / "poses"

    def reasons():
        return [each["reason"] for each in found.events if each["event"] == "reason"]

    with running(tmp_path, "--camera", "synthetic", "--pose-source", f"unix:{path}") as found:
        found.wait_for_state("pose_stale")
        with socket.socket(socket.AF_UNIX) as connection:
            connection.connect(str(path))
            for digit in "123":
                connection.sendall(f"{digit}\n".encode())
                shown = f"'{digit}"
                found.wait(lambda shown=shown: shown in found.messages[-1].get("reason", ""))
            connection.sendall(b'{"height": 0.8, "quaternion": [1, 0, 0, 0]}\n')
            found.wait(lambda: reasons() and "pose lacks t" in reasons()[-1])
        found.stop()
    assert len(reasons()) == 2
    # On a busy core, the first frames may be late.
    assert found.states[found.states.index("pose_stale") :] == ["pose_stale", "stopping"]


@pytest.mark.long
def test_a_bad_state_with_another_reason_is_sent_while_frames_arrive(tmp_path):
    path = tmp_path / "poses"
    with running(tmp_path, "--camera", "synthetic", "--pose-source", f"unix:{path}") as found:
        with socket.socket(socket.AF_UNIX) as good, socket.socket(socket.AF_UNIX) as bad:
            found.wait_for_state("pose_stale")
            good.connect(str(path))
            bad.connect(str(path))
            sender = Sender(good.sendall, Motion())
            sender.start()
            found.wait_for_state("ok")

            def is_sent(line, reason):
                bad.sendall(line)
                return any(reason in each.get("reason", "") for each in found.messages)

            found.wait(lambda: is_sent(b"x\n", "not valid JSON"))
            found.wait(lambda: is_sent(b'{"height": 0.8, "quaternion": [1, 0, 0, 0]}\n', "pose lacks t"))
            sender.on = False
            sender.join()
        found.stop()


OLD = b'{"t": 1.0, "height": 0.8, "quaternion": [1, 0, 0, 0]}\n'


@pytest.fixture
def clock(monkeypatch):
    """A clock that only sleeps move."""
    now, yielded = [1000.0], asyncio.sleep

    async def sleep(seconds):
        now[0] += seconds
        await yielded(0)

    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    monkeypatch.setattr(asyncio, "sleep", sleep)
    return now


def test_lines_of_a_flood_are_read_at_four_in_a_millisecond(clock):
    """Without pauses, the thread of the camera would not get Python's lock."""

    async def read():
        poses, reader = stream.PoseStream(PoseSettings(source="stdin"), lambda reason: None), asyncio.StreamReader()
        reader.feed_data(4000 * OLD)
        reader.feed_eof()
        await poses._take_lines(reader)
        return poses.bad

    assert asyncio.run(read()) == 4000
    assert 0.9 < clock[0] - 1000.0 < 1.1


def test_datagrams_beyond_four_lines_in_a_millisecond_are_dropped(clock):
    reasons = []
    poses = stream.PoseStream(PoseSettings(source="udp:127.0.0.1:5600"), reasons.append)
    datagrams = stream._Datagrams(poses)
    for _ in range(10):
        datagrams.datagram_received(64 * OLD, None)
    assert poses.bad == 256 + 6
    assert reasons[-1] == "more than 256 pose lines in 64 ms"
    clock[0] += 0.1
    datagrams.datagram_received(pose_line(MOTION, clock[0]), None)
    assert poses.received == 1
