"""The two forms of the log, and events of several threads."""

import io
import json
import os
import sys
import threading

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_embedded.live.log import EventLog


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_text_leaves_out_empty_fields_and_json_keeps_them():
    fields = {"state": "ok", "was": "starting", "reason": "", "code": None, "frames": 0}
    terminal, file = Terminal(), io.StringIO()
    EventLog(terminal)("state", **fields)
    EventLog(file)("state", **fields)
    assert terminal.getvalue().endswith(" state: state ok, was starting, frames 0\n")
    assert fields.items() <= json.loads(file.getvalue()).items()


@given(st.text(), st.text())
def test_an_event_is_one_line_of_printable_text(event, text):
    terminal, file = Terminal(), io.StringIO()
    EventLog(terminal)(event, reason=text)
    EventLog(file)(event, reason=text)
    for written in (terminal.getvalue(), file.getvalue()):
        assert written[-1:] == "\n"
        assert written[:-1].isprintable()
    assert json.loads(file.getvalue())["reason"] == text


@pytest.fixture
def hasty():
    """Threads take turns after each few instructions."""
    usual = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(usual)


def test_events_of_several_threads_are_whole_lines(hasty, tmp_path):
    """Without a buffer, as with PYTHONUNBUFFERED: a line and its end could be two writes."""
    written = tmp_path / "log"
    with written.open("wb", buffering=0) as file, io.TextIOWrapper(file, write_through=True) as stream:
        log = EventLog(stream)

        def tell(thread):
            for number in range(400):
                log(f"thread {thread}, part {number // 40}", number=number)

        threads = [threading.Thread(target=tell, args=(number,)) for number in range(8)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    events = [json.loads(line) for line in written.read_text().splitlines()]
    assert sorted((each["event"], each["number"]) for each in events) == sorted(
        (f"thread {thread}, part {number // 40}", number) for thread in range(8) for number in range(400)
    )


def test_a_pipe_that_nobody_reads_does_not_stop_the_program():
    reading, writing = os.pipe()
    with os.fdopen(reading) as reader, os.fdopen(writing, "w") as stream:
        log = EventLog(stream)
        for number in range(3000):
            log(f"event {number}", text="x" * 100)
        log("lost")
        os.set_blocking(reading, False)
        assert len(os.read(reading, 2**20)) > 50_000
        log("lost")
        (line,) = reader.readlines()
    assert json.loads(line)["left_out"] == 1
