"""What all programs share: --version, completion, errors of usage as one line, and a quiet end after Ctrl-C."""

from __future__ import annotations

import argparse
import errno
import os
import re
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from difflib import get_close_matches
from functools import wraps
from importlib import metadata
from pathlib import Path
from typing import Any, NoReturn, ParamSpec

from ..borders.credentials import without_credentials
from ..errors import VisualMeshError, unknown
from ..files import there
from .terminal import lost_output, open_streams, printable_output

EXIT_OK, EXIT_FAILED, EXIT_INTERRUPTED = 0, 1, 130

_COMPLETING = "_VM_COMPLETE"
"""Environment variable with which the shell asks a program for completions of the words so far."""

_BASH = """\
_vm_complete() {{
    mapfile -t COMPREPLY < <({variable}=1 "$1" "${{COMP_WORDS[@]:1:COMP_CWORD}}" 2>/dev/null)
}}
complete -o default -F _vm_complete {programs}
"""

_LOST = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EBADF)
"""Errors that concern standard output, unless they name a file: it takes no more text."""

P = ParamSpec("P")


class Parser(argparse.ArgumentParser):
    """A parser of a program's options, or of one of its commands ("vm-train check").

    commands: names of the program's commands, for completion. An error of usage is one line, which names the nearest
    option or command, and not the whole usage. Exit status 2.
    """

    def __init__(self, commands: Sequence[str] = (), **more: Any) -> None:
        super().__init__(**more)
        for kind, read in ((Path, _path), (int, _whole_number), (float, _number)):
            self.register("type", kind, read)
        self._negative_number_matcher = re.compile(r"-\.?\d")  # "-5deg", too, is a value and no option
        self.color = False  # Python 3.14 would print control sequences, which terminal.py escapes
        self._given: Sequence[str] = ()
        self._commands = commands
        self._rare: list[argparse.Action] = []
        self.add_argument("--version", action="version", version=version(self.prog), help="show the version and exit")
        if " " not in self.prog:
            self.add_argument(
                "--completion",
                action=PrintCompletion,
                nargs=0,
                help='bash completion: eval "$(vm-detect --completion)"',
            )

    def hide(self, option: argparse.Action) -> None:
        """Leave an option out of --help. --help-all, which this adds, shows it."""
        if not self._rare:
            self.add_argument("--help-all", action=PrintAllHelp, nargs=0, help="show the rarely used options, too")
        self._rare.append(option)

    def format_usage(self) -> str:
        """As argparse does, without hidden options."""
        with self._only_usual():
            return super().format_usage()

    def format_help(self) -> str:
        """As argparse does, without hidden options."""
        with self._only_usual():
            return super().format_help()

    def format_all_help(self) -> str:
        """The text of --help-all."""
        return super().format_help()

    @contextmanager
    def _only_usual(self) -> Iterator[None]:
        helps = [each.help for each in self._rare]
        for each in self._rare:
            each.help = argparse.SUPPRESS
        try:
            yield
        finally:
            for each, help in zip(self._rare, helps, strict=True):
                each.help = help

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """As argparse does; it remembers the arguments for an error message."""
        self._given = sys.argv[1:] if args is None else args
        if is_completing():
            print("\n".join(self.completions([word for word in self._given if word != "="])))
            self.exit()
        return super().parse_known_args(args, namespace)

    def error(self, message: str) -> NoReturn:
        """Print what is wrong as one line, and exit with status 2."""
        message = without_credentials(self._unknown_option() or self._unknown_command(message) or message)
        self.exit(2, f"{self.prog}: {' '.join(message.split())}; {self.prog} --help lists the options\n")

    def _print_message(self, message: str, file: Any = None) -> None:
        """As argparse does, but an error of writing the help or the version is not ignored."""
        if file is not None and file is sys.stdout:
            file.write(message)
        else:
            super()._print_message(message, file)

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        """As argparse does; the message names the nearest allowed value, too."""
        if action.choices is not None and value not in action.choices:
            raise argparse.ArgumentError(action, unknown("value", value, map(str, action.choices)))

    def completions(self, words: Sequence[str]) -> list[str]:
        """What the last of the words may become: values of an option, options, or commands."""
        last = words[-1] if words else ""
        before = self._option_string_actions.get(words[-2]) if len(words) > 1 else None
        if before is not None and before.nargs != 0:
            candidates = [str(each) for each in before.choices or ()]
        elif last.startswith("-"):
            candidates = [name for name in self._option_string_actions if name.startswith("--")]
        else:
            candidates = list(self._commands) if len(words) < 2 else []
        return [each for each in candidates if each.startswith(last)]

    def _unknown_command(self, message: str) -> str | None:
        """What is wrong with a first argument that resembles a command and is no file; None for other arguments.

        message: what is wrong if the argument is no command. Missing or surplus arguments speak for a command.
        """
        first = self._given[0] if self._given else ""
        near = get_close_matches(first, self._commands, n=1, cutoff=0.75)
        if not near or first in self._commands or "." in first or os.path.lexists(first):
            return None
        if "are required" not in message and "unrecognized" not in message:
            return None
        return f"unknown command {first}: did you mean {near[0]}?"

    def _unknown_option(self) -> str | None:
        """What is wrong with the first argument that looks like an option but is none; None if all are options."""
        options = [name for name in self._option_string_actions if name.startswith("--")]
        for word in self._given:
            if word == "--":
                return None
            name = word.partition("=")[0]
            if name.startswith("--") and not any(option.startswith(name) for option in options):
                near = get_close_matches(name, options, n=1)
                return f"unknown option {name}" + (f": did you mean {near[0]}?" if near else "")
            if name.startswith("-") and f"-{name}" in options:
                return f"unknown option {name}: did you mean -{name}?"
        return None


def _path(text: str) -> Path:
    """The path in an argument. Raises ArgumentTypeError for an empty one, which Path takes for the current folder."""
    if not text:
        raise argparse.ArgumentTypeError("the path is empty")
    return there(Path(text))


def _whole_number(text: str) -> int:
    """The whole number in an argument. Raises ArgumentTypeError for another text."""
    try:
        return int(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"must be a whole number, not {text!r}") from error


def _number(text: str) -> float:
    """The number in an argument. Raises ArgumentTypeError for another text."""
    try:
        return float(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"must be a number, not {text!r}") from error


def is_completing() -> bool:
    """Whether the shell asks for completions, instead of a user for a result."""
    return _COMPLETING in os.environ


class PrintAllHelp(argparse.Action):
    """The option --help-all."""

    def __call__(self, parser: argparse.ArgumentParser, *_: Any, **__: Any) -> None:
        """Print the help with all options, and exit."""
        assert isinstance(parser, Parser)
        print(parser.format_all_help(), end="")
        parser.exit()


class PrintCompletion(argparse.Action):
    """The option --completion: prints a script for bash, which asks the programs themselves for completions."""

    def __call__(self, parser: argparse.ArgumentParser, *_: Any, **__: Any) -> None:
        """Print it for all programs that are installed, and exit."""
        try:
            scripts = metadata.distribution("vm-embedded").entry_points
            programs = sorted(each.name for each in scripts if each.group == "console_scripts")
        except metadata.PackageNotFoundError:
            programs = [parser.prog]
        print(_BASH.format(variable=_COMPLETING, programs=" ".join(programs)), end="")
        parser.exit()


def version(program: str) -> str:
    """The line that --version prints: the program without its command, and the version of the package."""
    # Rooms do not import the package above them, but it is always loaded.
    return f"{program.split()[0]} {sys.modules['vm_embedded'].__version__}"


def program(main: Callable[P, int]) -> Callable[P, int]:
    """A main function that ends quietly after Ctrl-C, and if nothing reads its output any more, such as head in a pipe.

    Output that is lost, because the disk is full or standard output is closed, and a path that the system refuses, are
    one line on standard error, and exit status 1. What it prints is printable: see terminal.py.
    """

    @wraps(main)
    def run(*arguments: P.args, **more: P.kwargs) -> int:
        open_streams()
        try:
            with printable_output():
                status = run_quietly(*arguments, **more)
        except SystemExit as end:  # of --help and the like
            if end.code or not lost_output():
                raise
            status = EXIT_OK
        if status == EXIT_OK and lost_output():
            print("can't write standard output: it is closed", file=sys.stderr)
            return EXIT_FAILED
        return status

    def run_quietly(*arguments: P.args, **more: P.kwargs) -> int:
        try:
            try:
                return main(*arguments, **more)
            finally:
                sys.stdout.flush()  # here, because at exit the interpreter would print a traceback
        except KeyboardInterrupt:
            return EXIT_INTERRUPTED
        except BrokenPipeError:
            discard_output()
            return EXIT_OK
        except OSError as error:
            if error.filename is None and error.errno not in _LOST:
                raise
            _discard_lost(error)
            print(system_error(error), file=sys.stderr)
            return EXIT_FAILED

    return run


def run_or_complain(prog: str, run: Callable[[], int]) -> int:
    """Run a program and return its exit status; if it fails, say why in one line. prog: name of the program."""
    try:
        return run()
    except VisualMeshError as error:
        complain(prog, str(error))
    except BrokenPipeError:
        raise
    except OSError as error:  # for example a full disk behind standard output
        _discard_lost(error)
        complain(prog, system_error(error))
    return EXIT_FAILED


def complain(prog: str, message: str) -> None:
    """Print an error as one line on standard error. prog: name of the program."""
    print(f"{prog}: {' '.join(message.split())}", file=sys.stderr)


def system_error(error: OSError) -> str:
    """The message for an error of the system that nothing else explains; without a path, it is of standard output."""
    doing = "use" if error.filename is not None and error.errno != errno.ENOSPC else "write"
    return f"can't {doing} {without_credentials(str(error.filename or 'standard output'))}: {error.strerror or error}"


def _discard_lost(error: OSError) -> None:
    """Forget text that could not be written, so that the error is not raised and reported again."""
    if error.errno == errno.ENOSPC or (error.filename is None and error.errno in _LOST):
        discard_output()


def discard_output() -> None:
    """Send standard output to nowhere once it can't be written; else the interpreter complains when it flushes."""
    with suppress(OSError):  # it was closed before
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
