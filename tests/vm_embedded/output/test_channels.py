"""Messages of a real vm-detect on a Unix socket, in a file and by UDP."""

import asyncio
import os
import select
import signal
import socket
import time
from contextlib import suppress

import pytest

from tests.messages import read_message
from tests.vm_embedded.live.running import counts, running
from vm_embedded.errors import InputError
from vm_embedded.live.control import ask
from vm_embedded.output.channels import OutputSettings, UnixChannel
from vm_embedded.output.file_channel import FileChannel


@pytest.mark.long
def test_many_read_the_socket_and_one_that_sleeps_holds_nobody_up(tmp_path):
    path = tmp_path / "lines"
    options = ("--camera", "synthetic", "--output-unix", path, "--output-backlog-kib", 8, "--no-output-stdout")
    with running(tmp_path, *options) as found:
        found.wait_for_state("ok")
        readers = [socket.socket(socket.AF_UNIX) for _ in range(3)]
        sleeper = socket.socket(socket.AF_UNIX)
        sleeper.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
        for each in (*readers, sleeper):
            each.connect(str(path))
        heard = [each.makefile() for each in readers]
        # As many lines as the sleeper's buffers can't hold.
        lines = [[read_message(file.readline()) for _ in range(20)] for file in heard]
        for each in lines[1:]:
            assert {one["frame"] for one in each if "frame" in one} & {
                one["frame"] for one in lines[0] if "frame" in one
            }
        found.wait(lambda: counts(tmp_path)["dropped"] > 0 or heard[0].readline() == "")
        for each in (*heard, *readers, sleeper):
            each.close()
        found.stop()


def test_a_reader_that_stops_sending_and_reads_nothing_is_disconnected(tmp_path):
    """Otherwise each one would cost a descriptor and a backlog, without limit."""

    async def serve():
        channel = UnixChannel(tmp_path / "lines", 2**20)
        with socket.socket(socket.AF_UNIX) as reader:
            reader.connect(str(tmp_path / "lines"))
            await _until(lambda: channel._writers)
            while not any(each.transport.get_write_buffer_size() for each in channel._writers):
                channel.send(bytes(65536))
            reader.shutdown(socket.SHUT_WR)
            ended = select.poll()
            ended.register(reader, select.POLLHUP)
            await _until(lambda: ended.poll(0))
        await channel.close()

    asyncio.run(serve())


def test_what_readers_send_is_read_with_pauses(tmp_path, monkeypatch):
    """A flood of it would take the processor from the frames."""
    monkeypatch.setattr("vm_embedded.output.channels._PAUSE", 3600.0)

    async def serve():
        channel = UnixChannel(tmp_path / "lines", 2**20)
        with socket.socket(socket.AF_UNIX) as reader:
            reader.connect(str(tmp_path / "lines"))
            reader.setblocking(False)
            await _until(lambda: channel._writers)
            for _ in range(20):  # the first times, there is room in buffers
                with suppress(BlockingIOError):
                    while True:
                        reader.send(bytes(65536))
                await asyncio.sleep(0.01)
            with pytest.raises(BlockingIOError):
                reader.send(bytes(65536))
        await channel.close()

    asyncio.run(serve())


async def _until(what):
    deadline = time.monotonic() + 60.0
    while not what():
        assert time.monotonic() < deadline
        await asyncio.sleep(0.02)


def test_lines_also_go_to_a_file_and_by_udp(tmp_path):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listening:
        listening.bind(("127.0.0.1", 0))
        listening.settimeout(30.0)
        port = listening.getsockname()[1]
        where = ("--output-udp", f"127.0.0.1:{port}", "--output-file", tmp_path / "lines.jsonl")
        with running(tmp_path, "--camera", "synthetic", *where) as found:
            message = {}
            while not message.get("detections"):
                message = read_message(listening.recv(65536))
            found.process.send_signal(signal.SIGTERM)
            assert found.process.wait(30) == 0
    assert message["detections"][0]["class"] == "ball"
    kept = [read_message(line) for line in (tmp_path / "lines.jsonl").read_text().splitlines()]
    assert message in kept


@pytest.mark.long
def test_what_is_wrong_with_an_output_shows_in_the_state(tmp_path):
    with running(tmp_path, "--camera", "synthetic", "--output-file", "/dev/full") as found:
        found.wait_for_state("degraded")
        found.wait(lambda: "No space left" in read_message(ask(tmp_path / "control", "status"))["reason"])
        found.stop()


@pytest.mark.long
def test_a_named_pipe_needs_a_reader(tmp_path):
    pipe = tmp_path / "lines.fifo"
    os.mkfifo(pipe)
    with running(tmp_path, "--camera", "synthetic", "--output-file", pipe) as found:
        (event,) = found.wait(lambda: [each for each in found.events if each["event"] == "can't start"])
    assert "no program reads this pipe" in event["reason"]
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    with os.fdopen(reader, "rb") as lines, running(tmp_path, "--camera", "synthetic", "--output-file", pipe) as found:
        found.wait_for_state("ok")
        found.wait(lambda: len(found.frames) > 3)
        found.stop()
        assert read_message(lines.readline())["type"] == "state"


def test_datagrams_have_no_unix_socket():
    with pytest.raises(InputError, match=r"udp must be ADDRESS:PORT, as in .*, not 'unix:lines\.sock'"):
        OutputSettings(udp="127.0.0.1:5600,unix:lines.sock")


@pytest.mark.parametrize("port", ["0", "65536", "9" * 5000, "-1", "²", ""])
def test_a_port_is_a_number_to_65535(port):
    with pytest.raises(InputError, match=r"udp must be ADDRESS:PORT, as in .*, with a port of at most 65535, not"):
        OutputSettings(udp=f"127.0.0.1:{port}")


@pytest.mark.long
def test_a_file_that_was_moved_or_deleted_is_begun_anew(tmp_path):
    path = tmp_path / "lines.jsonl"
    with running(tmp_path, "--camera", "synthetic", "--output-file", path) as found:
        found.wait_for_state("ok")
        moved = path.rename(tmp_path / "lines.jsonl.1")
        found.wait(lambda: path.exists() and path.read_bytes().count(b"\n") > 3)
        path.unlink()
        found.wait(lambda: path.exists() and path.read_bytes().count(b"\n") > 3)
        path.unlink()
        path.mkdir()
        found.wait_for_state("degraded")
        reason = read_message(ask(tmp_path / "control", "status"))["reason"]
        path.rmdir()
        found.wait_for_state("ok")
        assert found.stop()[0] == 0
    assert reason == f"messages are lost: can't write {path}: Is a directory"
    for each in (moved, path):
        assert all(read_message(line) for line in each.read_text().splitlines())


def test_no_line_is_lost_when_a_file_is_moved(tmp_path):
    path, moved = tmp_path / "lines", tmp_path / "moved"
    channel = FileChannel(str(path), 1024)
    channel.send(b"1\n")
    while path.read_bytes() != b"1\n":
        time.sleep(0.01)
    path.rename(moved)
    channel.send(b"2\n")
    channel.send(b"3\n")
    asyncio.run(channel.close())
    assert (moved.read_bytes(), path.read_bytes(), channel.dropped, channel.failure) == (b"1\n", b"2\n3\n", 0, "")
