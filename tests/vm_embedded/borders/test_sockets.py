"""Unix sockets: exactly one of several processes owns a path, and connections are accepted with pauses."""

import asyncio
import fcntl
import multiprocessing
import os
import random
import socket
import struct
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.programs import heed_permissions
from vm_embedded.borders import sockets
from vm_embedded.borders.sockets import Acceptor, UnixListener
from vm_embedded.errors import InputError, InUseError
from vm_embedded.live.configuration import StatusSettings
from vm_embedded.output.channels import OutputSettings
from vm_embedded.poses.settings import PoseSettings

SPAWN = multiprocessing.get_context("spawn")


def leave_behind(path):
    """Create a socket file on which no process listens."""
    with socket.socket(socket.AF_UNIX) as left:
        left.bind(str(path))


def listener_at(path):
    """The process that listens at a path; None if none does. Raises BlockingIOError if too many connections wait."""
    with socket.socket(socket.AF_UNIX) as connection:
        connection.setblocking(False)
        try:
            connection.connect(str(path))
        except (FileNotFoundError, ConnectionRefusedError):
            return None
        return struct.unpack("3i", connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, 12))[0]


def spawn(work, number, *arguments):
    """Processes that run a function, and for each the pipe whose other end the function gets."""
    pairs = [SPAWN.Pipe() for _ in range(number)]
    processes = [SPAWN.Process(target=work, args=(theirs, *arguments), daemon=True) for _, theirs in pairs]
    for each, (_, theirs) in zip(processes, pairs, strict=True):
        each.start()
        theirs.close()  # so that a process that dies ends the pipe
    return processes, [ours for ours, _ in pairs]


def join(processes):
    """Wait for the end of processes."""
    for each in processes:
        each.join(60.0)
    assert [each.exitcode for each in processes] == [0] * len(processes)


def spin_until(moment):
    """Wait for a time of the monotonic clock, and keep the processor, to start on time."""
    while time.monotonic() < moment:
        pass


def listen_when_told(pipe, path):
    """At each time that is received, listen at a path; send the kind of error, if any. Close it at the next message."""
    while moment := pipe.recv():
        spin_until(moment)
        listener, failure = None, ""
        try:
            listener = UnixListener(path, "--option")
        except InputError as error:
            failure = type(error).__name__
        pipe.send(failure)
        pipe.recv()
        if listener is not None:
            listener.close()
        pipe.send(None)


@pytest.mark.parametrize("rounds", [300, pytest.param(1500, marks=pytest.mark.long)])
def test_one_of_two_processes_that_start_at_once_beside_a_left_socket_owns_it(tmp_path, rounds):
    path, chance, wrong = tmp_path / "socket", random.Random(5), []
    processes, pipes = spawn(listen_when_told, 2, path)
    for _ in range(rounds):
        path.unlink(missing_ok=True)
        leave_behind(path)
        moment = time.monotonic() + 3e-3
        for each in pipes:
            each.send(moment + chance.uniform(0.0, 1e-4))
        failures = [each.recv() for each in pipes]
        owner = listener_at(path)
        if sorted(failures) != ["", "InUseError"] or processes[failures.index("")].pid != owner:
            wrong.append((failures, owner))
        for each in pipes:
            each.send(None)
            each.recv()
    for each in pipes:
        each.send(None)
    join(processes)
    assert wrong == []


def is_reached(listener):
    """Whether this process listens at the path of its listener."""
    while True:
        try:
            return listener_at(listener.path) == os.getpid()
        except BlockingIOError:
            listener.accept()[0].close()


def take_turns(pipe, path, turns):
    """Listen at a path for a moment, so many times. Tell how many times another process, or none, was reached there."""
    lost, chance = 0, random.Random(os.getpid())
    for _ in range(turns):
        while True:
            try:
                listener = UnixListener(path, "--option")
                break
            except InUseError:
                time.sleep(chance.uniform(0.0, 1e-3))
        lost += not is_reached(listener)
        spin_until(time.monotonic() + chance.uniform(0.0, 1e-4))
        lost += not is_reached(listener)
        listener.close()
    pipe.send(lost)


@pytest.mark.long
def test_a_listener_that_is_closed_removes_no_file_of_another(tmp_path):
    processes, pipes = spawn(take_turns, 3, tmp_path / "socket", 300)
    assert [each.recv() for each in pipes] == [0, 0, 0]
    join(processes)
    assert not list(tmp_path.iterdir())


def test_a_file_that_replaced_that_of_a_listener_stays(tmp_path):
    path = tmp_path / "socket"
    first = UnixListener(path, "--option")
    path.unlink()
    second = UnixListener(path, "--option")
    first.close()
    assert listener_at(path) == os.getpid()
    second.close()
    second.close()
    assert not list(tmp_path.iterdir())


def die_at_line(path, number):
    """Listen at a path in a forked process that ends at a line of the code. Return whether it got to that line."""
    if child := os.fork():
        return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 9
    remaining = number

    def trace(frame, event, _):
        nonlocal remaining
        if not Path(frame.f_code.co_filename).is_relative_to(Path(sockets.__file__).parent):
            return None
        remaining -= event == "line"
        if remaining < 0:
            os._exit(9)
        return trace

    sys.settrace(trace)
    UnixListener(path, "--option")
    os._exit(0)


def die_at_each_line(pipe, path):
    """Tell how many lines there are to die at, and how many deaths left a path at which nobody can listen."""
    number, unusable = 0, 0
    leave_behind(path)
    while die_at_line(path, number):
        number += 1
        try:
            UnixListener(path, "--option").close()
        except InputError:
            unusable += 1
        leave_behind(path)
    pipe.send((number, unusable))


def test_after_a_death_at_any_line_the_next_process_listens(tmp_path):
    processes, (pipe,) = spawn(die_at_each_line, 1, tmp_path / "socket")
    lines, unusable = pipe.recv()
    join(processes)
    assert lines > 20
    assert unusable == 0
    assert [each.name for each in tmp_path.iterdir()] == ["socket"]


def test_a_folder_that_another_program_locks_for_long_is_an_error(tmp_path, monkeypatch):
    monkeypatch.setattr(sockets, "_PATIENCE", 0.02)
    folder = os.open(tmp_path, os.O_RDONLY)
    fcntl.flock(folder, fcntl.LOCK_SH)
    with pytest.raises(InUseError) as caught:
        UnixListener(tmp_path / "socket", "--option")
    assert str(tmp_path / "socket") in str(caught.value)
    assert "--option" in str(caught.value)
    os.close(folder)
    UnixListener(tmp_path / "socket", "--option").close()
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("mode", [0o300, 0o500])
def test_a_folder_that_this_user_may_not_read_or_write_is_an_error(tmp_path, mode):
    path = tmp_path / "closed" / "socket"
    path.parent.mkdir(mode=mode)
    code = f"from vm_embedded.borders.sockets import UnixListener; UnixListener({str(path)!r}, '--option')"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, preexec_fn=heed_permissions, check=False
    )
    last = done.stderr.splitlines()[-1]
    assert last.startswith(f"vm_embedded.errors.InputError: can't listen at {path}: Permission denied")


def test_a_link_to_a_folder_has_the_lock_of_the_folder(tmp_path):
    (tmp_path / "folder").mkdir()
    (tmp_path / "link").symlink_to("folder")
    listener = UnixListener(tmp_path / "link" / "socket", "--option")
    with pytest.raises(InUseError):
        UnixListener(tmp_path / "folder" / "socket", "--option")
    listener.close()
    assert not list((tmp_path / "folder").iterdir())


@pytest.mark.parametrize(
    "settings",
    [
        lambda: StatusSettings(page="unix:/tmp/zero\0byte"),
        lambda: StatusSettings(page="127.0.0.1\0:80"),
        lambda: PoseSettings(source="unix:/tmp/zero\0byte"),
        lambda: PoseSettings(source="udp:zero\0byte:80"),
        lambda: OutputSettings(udp="127.0.0.1:80,zero\0byte:80"),
    ],
)
def test_an_address_with_a_zero_byte_is_refused_with_its_entry(settings):
    with pytest.raises(InputError) as caught:
        settings()
    assert any(name in str(caught.value) for name in ("page", "source", "udp"))
    assert r"\x00" in str(caught.value)


def test_connections_of_a_flood_are_accepted_with_pauses(tmp_path, monkeypatch):
    """Without pauses, they would take the processor from the frames."""
    monkeypatch.setattr(sockets, "_PAUSE", 3600.0)
    served = []

    async def serve(reader, writer):
        served.append(await reader.readline())
        writer.close()

    async def flood():
        listener = UnixListener(tmp_path / "socket", "--option")
        clients = [socket.socket(socket.AF_UNIX) for _ in range(10)]
        for each in clients:
            each.connect(str(listener.path))
            each.sendall(b"x\n")
        acceptor = Acceptor(listener, serve, 1024)
        while len(served) < 4:
            await asyncio.sleep(0.01)
        await asyncio.sleep(0.1)
        acceptor.close()
        for each in clients:
            each.close()

    asyncio.run(flood())
    assert served == 4 * [b"x\n"]
    assert not list(tmp_path.iterdir())


def test_the_number_of_a_listener_that_closes_is_free_for_a_new_connection(tmp_path):
    async def close_and_connect():
        errors = []
        loop = asyncio.get_running_loop()
        loop.set_exception_handler(lambda _, context: errors.append(context))
        listener = UnixListener(tmp_path / "socket", "--option")
        number = listener.fileno()
        acceptor = Acceptor(listener, lambda reader, writer: None, 1024)
        await asyncio.sleep(0.01)
        acceptor.close()
        near, far = socket.socketpair()
        assert near.fileno() == number
        reader, writer = await asyncio.open_connection(sock=near)
        far.sendall(b"x\n")
        line = await asyncio.wait_for(reader.readline(), 10.0)
        writer.close()
        far.close()
        return line, errors

    assert asyncio.run(close_and_connect()) == (b"x\n", [])
