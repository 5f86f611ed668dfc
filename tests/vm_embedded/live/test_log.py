"""The two forms of the log."""

import io
import json

from vm_embedded.live.log import EventLog


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_text_leaves_out_empty_fields_and_json_keeps_them():
    fields = {"state": "ok", "was": "starting", "reason": "", "code": None, "frames": 0}
    terminal, file = Terminal(), io.StringIO()
    EventLog("vm-detect", terminal)("state", **fields)
    EventLog("vm-detect", file)("state", **fields)
    assert terminal.getvalue().endswith(" state: state ok, was starting, frames 0\n")
    assert fields.items() <= json.loads(file.getvalue()).items()
