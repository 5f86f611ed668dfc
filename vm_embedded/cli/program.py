"""What all programs share: --version, errors of usage as one line, and a quiet end when their reader leaves."""

from __future__ import annotations

import argparse
import errno
import os
import sys
from collections.abc import Callable, Sequence
from difflib import get_close_matches
from functools import wraps
from typing import Any, NoReturn, ParamSpec

EXIT_OK, EXIT_FAILED = 0, 1

P = ParamSpec("P")


class Parser(argparse.ArgumentParser):
    """A parser of a program's options, or of one of its commands ("vm-train check").

    An error of usage is one line, which names the nearest option, and not the whole usage. Exit status 2.
    """

    def __init__(self, **more: Any) -> None:
        super().__init__(**more)
        self._given: Sequence[str] = ()
        self.add_argument("--version", action="version", version=version(self.prog), help="show the version and exit")

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """As argparse does; it remembers the arguments for an error message."""
        self._given = sys.argv[1:] if args is None else args
        return super().parse_known_args(args, namespace)

    def error(self, message: str) -> NoReturn:
        """Print what is wrong as one line, and exit with status 2."""
        message = self._unknown_option() or message
        self.exit(2, f"{self.prog}: {' '.join(message.split())}; {self.prog} --help lists the options\n")

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
        return None


def version(program: str) -> str:
    """The line that --version prints: the program without its command, and the version of the package."""
    # Rooms do not import the package above them, but it is always loaded.
    return f"{program.split()[0]} {sys.modules['vm_embedded'].__version__}"


def program(main: Callable[P, int]) -> Callable[P, int]:
    """A main function that ends quietly if nothing reads its output any more, such as head in a pipe.

    A full disk is one line on standard error, and exit status 1.
    """

    @wraps(main)
    def run(*arguments: P.args, **more: P.kwargs) -> int:
        try:
            try:
                return main(*arguments, **more)
            finally:
                if sys.stdout is not None:
                    sys.stdout.flush()  # here, because at exit the interpreter would print a traceback
        except BrokenPipeError:
            discard_output()
            return EXIT_OK
        except OSError as error:
            if error.errno != errno.ENOSPC:
                raise
            discard_output()
            print(f"can't write {error.filename or 'standard output'}: {error.strerror}", file=sys.stderr)
            return EXIT_FAILED

    return run


def discard_output() -> None:
    """Send standard output to nowhere once it can't be written; else the interpreter complains when it flushes."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
