"""vm-label: judge boxes in the browser, and write them as training data."""

from __future__ import annotations

import argparse
import os
import sys
import threading
import webbrowser
from collections.abc import Sequence
from contextlib import suppress
from ipaddress import IPv4Address
from pathlib import Path

from vm_embedded.cli.program import EXIT_FAILED, EXIT_INTERRUPTED, EXIT_OK, Parser, program
from vm_embedded.errors import InputError, VisualMeshError
from vm_embedded.output.box_files import CLASSES
from vm_workstation.stopping import stoppable

from .answers import AnswerFile, read_answers
from .box_folder import BoxFolder, read_box_folder, with_drawn
from .labeling import Labeling
from .server import LabelServer
from .training_boxes import Written, write_training_boxes


def parser() -> argparse.ArgumentParser:
    """The command line of vm-label."""
    parser = Parser(
        prog="vm-label",
        description="Judge boxes on a page in the browser: is this the object? yes, no or skip. Draw the boxes of "
        "missed objects there. Each answer is saved at once in DIR/answers.jsonl. Ctrl-C ends the program; the next "
        "start continues.",
        epilog="Exit status: 0 done, or the page was ended by Ctrl-C; 1 not done (standard error says why); 2 wrong "
        "usage; 130 interrupted while writing.",
    )
    parser.add_argument(
        "folder",
        type=Path,
        metavar="DIR",
        help="folder of boxes, with all folders in it: from vm-detect --save-boxes, or images with NAME.txt in YOLO "
        "format from another tool",
    )
    parser.add_argument(
        "--class",
        dest="classes",
        action="append",
        default=[],
        metavar="NAME",
        help="judge and write only this class, by its name in the table of names (classes.txt), or by its number "
        "without a table; repeatable; default all",
    )
    page = parser.add_argument_group("page")
    page.add_argument("--port", type=_port, default=8090, metavar="N", help="port; 0: any free one; default 8090")
    page.add_argument(
        "--host",
        type=_address,
        default="127.0.0.1",
        metavar="ADDRESS",
        help="IPv4 address to listen at; default 127.0.0.1, which only this machine can reach. With another address, "
        "everybody in that network can see the images and answer",
    )
    page.add_argument("--no-browser", action="store_true", help="do not open a browser; only print the address")
    write = parser.add_argument_group("training data")
    write.add_argument(
        "--write",
        type=Path,
        metavar="OUT",
        help="write the judged images and the accepted boxes in YOLO format to the new folder OUT, and exit. An image "
        "with a skipped or unanswered crop is left out, because a training takes places without a box as background",
    )
    write.add_argument(
        "--empty",
        action="store_true",
        help="with --write: also write images without any crop and without an answer, as background",
    )
    return parser


def _port(text: str) -> int:
    if not text.isdecimal() or int(text) > 65535:
        raise argparse.ArgumentTypeError(f"{text!r} is not a port, from 0 to 65535")
    return int(text)


def _address(text: str) -> str:
    try:
        return str(IPv4Address(text))
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"{text!r} is not an IPv4 address, such as 127.0.0.1 or 0.0.0.0") from error


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Run vm-label and return its exit status."""
    options = parser().parse_args(arguments)
    try:
        with stoppable():
            if options.empty and options.write is None:
                raise InputError("--empty needs --write")
            folder = read_box_folder(options.folder.resolve(), options.classes)
            _complain(folder.problems)
            if options.write is None:
                _serve(options, folder)
            else:
                folder, answers = _judged(folder, options)
                print(_report(options.write, write_training_boxes(folder, answers, options.write, options.empty)))
            return EXIT_OK
    except VisualMeshError as error:
        print(f"vm-label: {error}", file=sys.stderr)
        return EXIT_FAILED
    except KeyboardInterrupt:
        return EXIT_INTERRUPTED


def _complain(problems: Sequence[str]) -> None:
    for problem in problems:
        print(f"vm-label: {problem}", file=sys.stderr)


def _judged(folder: BoxFolder, options: argparse.Namespace) -> tuple[BoxFolder, dict[str, str]]:
    """The folder with the drawn boxes, and the answers so far. It reports lines that it can't use."""
    answers, drawn, faults = read_answers(folder.path)
    judged = with_drawn(folder, drawn, options.classes)
    _complain([*faults, *judged.problems[len(folder.problems) :]])
    return judged, answers


def _serve(options: argparse.Namespace, folder: BoxFolder) -> None:
    """Serve the page until Ctrl-C. Raises InputError."""
    if not folder.classes:
        raise InputError(
            f"no boxes to judge in {folder.path}, and no classes to draw: vm-detect --save-boxes makes boxes; those of "
            "another tool must be in YOLO format (NAME.txt). To draw all of them, write the names of the classes to "
            f"{folder.path / CLASSES}, one in a line"
        )
    with AnswerFile(folder.path) as file:
        folder, answers = _judged(folder, options)
        session = Labeling(folder, answers, file)
        with LabelServer(session, options.host, options.port) as server:
            without = len(folder.images) - len({crop.image for crop in folder.crops})
            print(
                f"{len(session)} crops of {len(folder.images)} images, {without} of them without a crop; "
                f"{session.answered} crops answered: {server.url}",
                flush=True,
            )
            if not options.no_browser and ("DISPLAY" in os.environ or "WAYLAND_DISPLAY" in os.environ):
                threading.Thread(target=webbrowser.open, args=(server.url,), daemon=True).start()
            with suppress(KeyboardInterrupt):
                server.serve_forever()
        print(f"{session.answered} of {len(session)} crops answered; vm-label {options.folder} --write OUT writes them")


def _report(target: Path, written: Written) -> str:
    """What was written, and what was left out and why."""
    boxes = ", ".join(f"{count} {name}" for name, count in written.boxes.items()) or "none"
    left = [
        (written.open, "with unanswered crops"),
        (written.skipped, "with skipped crops"),
        (written.empty, "without any crop or answer (--empty writes them)"),
        (written.faulty, "with boxes that can't be read"),
    ]
    lines = [f"{target}: {written.images} images, {written.background} of them background; boxes: {boxes}"]
    lines += [f"left out: {count} image{'s' * (count != 1)} {reason}" for count, reason in left if count]
    start = "ball" if set(written.boxes) <= {"ball"} else "MODEL"
    lines.append(f"next: vm-train tune {target} --from {start} -o tuned")
    return "\n".join(lines)
