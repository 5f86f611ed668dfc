"""The texts that are made from the programs, so that both stay the same.

site_pages are pages of the web site only (site/outside_pages.py adds them): the command line, from the parsers and from
the usage texts of the robot's scripts, and the API reference, from the docstrings (api_page.py). pages are files of the
repository that describe messages (message_pages.py): messages.schema.json, and the parts of use.md, daemon.md and
deploy/cpp/vm_detect.hpp between markers. `python docs/help_pages.py` writes them, and a test checks that they are
current.
"""

from __future__ import annotations

import argparse
import json
import re
from pathlib import Path

import api_page
import message_pages

from vm_calibrate import cli as calibrate
from vm_embedded.cli import bench, detect, doctor
from vm_embedded.cli.program import PrintAllHelp, PrintCompletion
from vm_export import cli as export
from vm_label import cli as label
from vm_mesh import cli as mesh
from vm_ros import cli as ros
from vm_synth import cli as synth
from vm_train.cli import evaluate, train

_ABOUT = (argparse._HelpAction, argparse._VersionAction, PrintAllHelp, PrintCompletion)
"""Options that all programs have."""

DOCS = Path(__file__).parent
SCRIPTS = DOCS.parent / "deploy" / "robot"


def pages() -> dict[Path, str]:
    """All files that this script writes, with their texts."""
    return {
        DOCS / "messages.schema.json": json.dumps(message_pages.schema(), indent=1) + "\n",
        **message_pages.pages(DOCS.parent),
    }


def site_pages() -> dict[str, str]:
    """The pages that only the web site has: their names and texts."""
    return {"command-line.md": command_line(), "api.md": api_page.page()}


def parsers() -> dict[str, argparse.ArgumentParser]:
    """All programs, and commands of programs ("vm-train check"), with their parsers, in the order of the page."""
    robot = (detect.parser(), doctor.parser(), bench.parser(), ros.parser(), export.parser())
    programs = (calibrate, synth, train, evaluate, mesh)
    workstation = (each for program in programs for each in program.parsers().values())
    return {each.prog: each for each in (*robot, *workstation, label.parser())}


def command_line() -> str:
    """The page of the command line."""
    made = (
        "Made from the help texts of the programs by `make site`. `--help` prints the usual options, `--help-all` all, "
        "`--version` the version, "
        "and `--completion` the script that completes options in bash."
    )
    parts = [f"# Command line\n\n{made}\n"]
    shown: dict[tuple[str, str], str] = {}  # the first program with a group of options, by its title and its table
    for parser in parsers().values():
        parts.append(f"## {parser.prog}\n\n{parser.description}\n")
        for group in parser._action_groups:
            rows = "\n".join(_row(action) for action in group._group_actions if not isinstance(action, _ABOUT))
            if not rows:
                continue
            title = f"**{(group.title or '').capitalize()}**"
            note = f" ({group.description})" if group.description else ""
            first = shown.setdefault((title, rows), parser.prog)
            # A table of one or two options is as short as the reference to it.
            if first == parser.prog or rows.count("\n") < 2:
                parts.append(f"{title}{note}\n\n| option | meaning |\n| --- | --- |\n{rows}\n")
            else:
                parts.append(f"{title}{note}: as for [{first}](#{first.replace(' ', '-')}).\n")
        if parser.epilog:
            parts.append(f"{parser.epilog}\n")
    parts.append("## Scripts on the robot\n\n[On a robot](../deploy/README.md) describes when to use them.\n")
    parts += [f"```text\n{_usage(SCRIPTS / name)}\n```\n" for name in ("install.sh", "vm-deploy", "uninstall.sh")]
    return "\n".join(parts)


def _usage(script: Path) -> str:
    """The usage text of a shell script, from its function `usage`."""
    text = script.read_text()
    found = re.search(r"^usage\(\) \{\n    cat <<END\n(.*?)\nEND$", text, re.MULTILINE | re.DOTALL)
    prefix = re.search(r"^PREFIX=(/.*)$", text, re.MULTILINE)
    assert found is not None, f"{script.name} has no usage text"
    return found[1].replace("$PREFIX", prefix[1]) if prefix else found[1]


def _row(action: argparse.Action) -> str:
    names = ", ".join(f"`{name}`" for name in action.option_strings) or f"`{action.dest}`"
    if action.choices:
        names += " " + " \\| ".join(f"`{choice}`" for choice in action.choices)
    elif action.option_strings and action.nargs != 0:
        values = action.metavar if isinstance(action.metavar, tuple) else (action.metavar or action.dest.upper(),)
        names += f" `{' '.join(values)}`"
    return f"| {names} | {(action.help or '') % vars(action)} |"


if __name__ == "__main__":
    for path, text in pages().items():
        path.write_text(text)
