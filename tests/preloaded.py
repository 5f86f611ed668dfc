"""Programs in processes of their own that need not import their packages again: forks of one process that has them.

Most of the time of a short command goes into imports. tests/vm_embedded/cli/test_program.py starts each program alone.
"""

import atexit
import importlib
import json
import os
import runpy
import select
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import traceback
from functools import cache
from pathlib import Path

RUNTIME = ("cv2", "onnxruntime", "vm_embedded.cli.detect", "vm_embedded.detection.detector")
LEARNING = (
    *RUNTIME,
    "torch._dynamo",  # two seconds, which the first optimizer of a process takes otherwise
    "matplotlib.figure",
    "vm_export.export",
    "vm_train.cli.train",
    "vm_train.cli.evaluate",
)


def run_preloaded(command, imports=RUNTIME, cwd=None, env=None, timeout=240.0):
    """Run a program, [its path, arguments...] or ["-m", its package, arguments...], as subprocess.run does.

    `imports` names the modules that it may find imported.
    """
    command = [str(each) for each in command]
    request = {"command": command, "imports": imports, "cwd": str(cwd or Path.cwd()), "env": dict(env or os.environ)}
    with Path(os.devnull).open() as nothing, tempfile.TemporaryFile() as output, tempfile.TemporaryFile() as errors:
        status = _starter().run(request, [each.fileno() for each in (nothing, output, errors)], timeout)
        texts = []
        for each in (output, errors):
            each.seek(0)
            texts.append(each.read().decode())
    return subprocess.CompletedProcess(command, status, *texts)


class _Starter:
    """The process that has the packages, and forks."""

    def __init__(self):
        self._here, there = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with there:
            command = [sys.executable, __file__, str(there.fileno())]
            # A thread of ONNX Runtime, which reports to its makers, would be missing in the forks.
            environment = {**os.environ, "ORT_DISABLE_TELEMETRY": "1"}
            nothing = {"stdin": subprocess.DEVNULL, "stdout": subprocess.DEVNULL}
            self._process = subprocess.Popen(command, pass_fds=[there.fileno()], env=environment, **nothing)

    def run(self, request, files, timeout):
        """The exit status of a program with these files as its standard streams."""
        socket.send_fds(self._here, [json.dumps(request).encode()], files)
        process = self._answer(120.0)
        try:
            return self._answer(timeout)
        except TimeoutError:
            os.kill(process, signal.SIGKILL)
            self._answer(60.0)
            raise subprocess.TimeoutExpired(request["command"], timeout) from None

    def _answer(self, timeout):
        if not select.select([self._here], [], [], timeout)[0]:
            raise TimeoutError
        return int(self._here.recv(64))


_starter = cache(_Starter)


def _wait_for_requests(connection):
    """Fork for each request; returns it in the forked process."""
    while True:
        message, files, _, _ = socket.recv_fds(connection, 1 << 20, 3)
        if not message:
            sys.exit()
        request = json.loads(message)
        for each in request["imports"]:
            importlib.import_module(each)
        process = os.fork()
        if not process:
            connection.close()
            for number, file in enumerate(files):
                os.dup2(file, number)
                os.close(file)
            return request
        for file in files:
            os.close(file)
        connection.send(str(process).encode())
        connection.send(str(os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])).encode())


def _become(command, cwd, env, imports):
    """Run a program in this process, as Python would that had just started, and end it."""
    os.chdir(cwd)
    os.environ.clear()
    os.environ.update(env)
    status = 1
    try:
        if command[0] == "-m":
            sys.argv = command[1:]
            runpy.run_module(command[1], run_name="__main__", alter_sys=True)
        else:
            sys.argv = command
            runpy.run_path(command[0], run_name="__main__")
        status = 0
    except SystemExit as ending:
        status = ending.code or 0
    finally:
        if sys.exc_info()[0]:
            traceback.print_exc()
        _end(status)


def _end(status):
    """End without Python's own end, which frees each object of the packages and takes longer than most commands."""
    threading._shutdown()
    atexit._run_exitfuncs()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)


if __name__ == "__main__":
    del sys.path[0]  # the folder of this file, which no program has
    _become(**_wait_for_requests(socket.socket(fileno=int(sys.argv[1]))))
