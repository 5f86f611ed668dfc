"""Scripts of faults that are refused."""

import pytest

from vm_embedded.cameras.fault import FaultScript
from vm_embedded.errors import InputError


def test_a_script_that_is_none_is_refused(tmp_path):
    for text, says in (
        ('source = "fault:x"', "another camera"),
        ("faults = 3", "must be a list"),
        ('faults = [{ kind = "hnag", at = 1, seconds = 1 }]', "'hang'"),
        ('faults = [{ kind = "hang", at = 1 }]', "write a fault like"),
        ('faults = [{ kind = "hang", at = -1, seconds = 1 }]', "from 0 s to 1e6 s"),
        ("[random]\ncuont = 3", "line 2.*'count'"),
    ):
        (tmp_path / "script.toml").write_text(text)
        with pytest.raises(InputError, match=says):
            FaultScript.read(tmp_path / "script.toml")
