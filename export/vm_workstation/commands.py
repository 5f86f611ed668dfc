"""Programs whose first argument is a command: vm-mesh and vm-calibrate."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping, Sequence

from vm_embedded.cli.program import EXIT_FAILED, EXIT_INTERRUPTED, EXIT_OK, Parser, is_completing
from vm_embedded.errors import VisualMeshError, not_installed, unknown

EXIT_USAGE = 2

Commands = Mapping[str, Callable[[argparse.Namespace], None]]
"""The functions of the commands, by name. They take the options."""


def run_command(
    prog: str,
    parsers: Mapping[str, argparse.ArgumentParser],
    load: Callable[[], Commands],
    extra: str,
    arguments: Sequence[str] | None,
) -> int:
    """Run a command of a program, and return the exit status.

    prog: name of the program. parsers: of its commands, by name. load: imports the commands; it is called last, because
    what they import takes long. extra: of pyproject.toml, with the packages that they need. arguments: of the program;
    None for those that it was called with.
    """
    given = list(sys.argv[1:] if arguments is None else arguments)
    if not given or given[0] in ("-h", "--help"):
        print(f"usage: {prog} COMMAND ...\n\ncommands ({prog} COMMAND --help lists their options):")
        print("\n".join(f"  {name:9s}{each.description}" for name, each in parsers.items()))
        return EXIT_OK if given else EXIT_USAGE
    if given[0] not in parsers and (given[0].startswith("-") or is_completing()):
        # Which prints the version or completions, or refuses the option, and ends the program.
        Parser(prog=prog, commands=tuple(parsers)).parse_args(given)
    if given[0] not in parsers:
        print(f"{prog}: {unknown('command', given[0], parsers)}", file=sys.stderr)
        return EXIT_USAGE
    options = parsers[given[0]].parse_args(given[1:])
    try:
        load()[given[0]](options)
    except ImportError as error:
        print(f"{prog}: {not_installed(error, extra)}", file=sys.stderr)
        return EXIT_FAILED
    except VisualMeshError as error:
        print(f"{prog}: {error}", file=sys.stderr)
        return EXIT_FAILED
    except KeyboardInterrupt:
        print(f"{prog}: interrupted", file=sys.stderr)
        return EXIT_INTERRUPTED
    return EXIT_OK
