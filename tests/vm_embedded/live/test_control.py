"""The control socket of a real vm-detect."""

import asyncio
import os
import re
import socket
import stat
import subprocess

import pytest

from tests.messages import read_message
from tests.preloaded import run_preloaded
from tests.vm_embedded.live.running import COMMAND, arguments, running
from vm_embedded.borders.sockets import MOST_CONNECTIONS, private_folder
from vm_embedded.errors import InputError
from vm_embedded.live.control import ControlServer, ask, control_path


@pytest.mark.long
def test_a_socket_that_was_left_behind_is_replaced_and_one_in_use_is_not(tmp_path):
    left = socket.socket(socket.AF_UNIX)
    left.bind(str(tmp_path / "control"))
    left.close()
    with running(tmp_path, "--camera", "synthetic") as found:
        found.wait_for_state("ok")
        other = subprocess.run(
            arguments(tmp_path, "--camera", "synthetic"), capture_output=True, text=True, timeout=60, check=False
        )
        assert other.returncode == 78
        assert "another process already does; stop the other vm-detect, or give another path" in other.stderr
        (option,) = re.findall(r"give another path with (--[a-z-]+)", other.stderr)
        with running(tmp_path, "--camera", "synthetic", option, tmp_path / "second") as second:
            second.wait_for_state("ok")
            second.stop()
        assert read_message(ask(tmp_path / "control", "status"))["state"] == "ok"
        found.stop()


@pytest.mark.long
def test_a_client_that_says_nothing_is_let_go_of_at_the_end(tmp_path):
    with running(tmp_path, "--camera", "synthetic") as found:
        found.wait_for_state("ok")
        with socket.socket(socket.AF_UNIX) as silent:
            silent.connect(str(tmp_path / "control"))
            assert found.stop()[0] == 0


def test_a_command_that_fails_leaves_no_connection(tmp_path):
    async def ask_often():
        server = ControlServer(tmp_path / "control", {"fail": lambda: {}["status"], "status": lambda: "fine"})
        asyncio.get_running_loop().set_exception_handler(lambda loop, context: None)
        await server.open()
        for _ in range(MOST_CONNECTIONS + 1):
            assert await asyncio.to_thread(ask, tmp_path / "control", "fail") == ""
        reply = await asyncio.to_thread(ask, tmp_path / "control", "status")
        await server.close()
        return reply

    assert asyncio.run(ask_often()) == "fine"


@pytest.mark.long
def test_asking_what_is_no_detector_ends(tmp_path):
    path = tmp_path / "other"
    with socket.socket(socket.AF_UNIX) as other:
        other.bind(str(path))
        other.listen()
        command = [COMMAND, "--status", "--status-socket", path]
        done = run_preloaded(command)
    assert done.returncode == 1
    assert "no detector replies" in done.stderr


def test_attack_12_the_default_socket_is_in_a_folder_that_only_its_user_may_open(tmp_path):
    folder = private_folder(tmp_path / "mine")
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert private_folder(folder) == folder


@pytest.mark.parametrize("occupy", ["open", "link", "file", "socket"])
def test_attack_12_a_default_folder_that_somebody_else_made_is_refused(tmp_path, occupy):
    path = tmp_path / "theirs"
    if occupy == "open":
        path.mkdir()
        path.chmod(0o777)
    elif occupy == "link":
        (tmp_path / "other").mkdir(mode=0o700)
        path.symlink_to(tmp_path / "other")
    elif occupy == "file":
        path.write_text("")
    else:
        socket.socket(socket.AF_UNIX).bind(str(path))
    with pytest.raises(InputError, match="only this user may open"):
        private_folder(path)


def test_attack_12_the_folder_of_another_user_is_refused(tmp_path):
    if os.geteuid() != 0:
        pytest.skip("only root can give a folder to another user")
    path = tmp_path / "theirs"
    path.mkdir(mode=0o700)
    os.chown(path, 65534, 65534)
    with pytest.raises(InputError, match="only this user may open"):
        private_folder(path)


def test_without_a_runtime_folder_the_default_is_private(monkeypatch):
    for name in ("RUNTIME_DIRECTORY", "XDG_RUNTIME_DIR"):
        monkeypatch.delenv(name, raising=False)
    path = control_path("")
    assert path.parent.stat().st_uid == os.getuid()
    assert stat.S_IMODE(path.parent.stat().st_mode) == 0o700
    monkeypatch.setenv("XDG_RUNTIME_DIR", "/run/user/7")
    assert str(control_path("")) == "/run/user/7/vm-detect.sock"
