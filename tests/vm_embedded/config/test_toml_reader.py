"""TOML that was made to break its reader: every program that reads a file of it says so in one line."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.vm_embedded.cli.commands import one_complaint, run
from tests.vm_embedded.live.running import DEMO
from vm_embedded.config.toml_reader import parse_toml
from vm_embedded.errors import InputError

HOSTILE = {
    "2000 brackets": "a = " + "[" * 2000 + "]" * 2000,
    "2000 braces": "a = " + "{a = " * 2000 + "1" + "}" * 2000,
    "2000 names in a key": "[camera]\nsource." + "a." * 2000 + "a = 1",
    "2000 names in a section": "[" + "a." * 2000 + "a]",
    "100 brackets": "a = " + "[" * 100 + "]" * 100,
    "5000 digits": "a = " + "9" * 5000,
}


@pytest.mark.parametrize("text", HOSTILE.values(), ids=HOSTILE)
def test_attack_8_toml_that_is_nested_too_deeply_is_refused(text):
    with pytest.raises(InputError, match=r"levels deep|digits") as caught:
        parse_toml(text)
    assert len(str(caught.value)) < 300


@given(st.integers(1, 60), st.sampled_from(["list", "table"]))
def test_thirty_two_levels_are_allowed(levels, kind):
    inner, opening, closing = ("", "[", "]") if kind == "list" else ("b = 1", "{a = ", "}")
    text = f"a = {opening * (levels - 1)}{'{' + inner + '}' if inner else '[]'}{closing * (levels - 1)}"
    if levels < 32:  # the file itself is the first level
        assert parse_toml(text)
    else:
        with pytest.raises(InputError, match="32 levels"):
            parse_toml(text)


@pytest.mark.parametrize(
    ("arguments", "status"),
    [
        (["--config", "{file}", "--check-config"], 1),
        (["--config", "{file}", "--camera", "synthetic"], 78),
        (["--camera", str(DEMO / "image0000002.jpg"), "--lens", "{file}", "--height", "1"], 1),
    ],
    ids=["check", "live", "lens"],
)
def test_attack_8_vm_detect_refuses_such_a_file_in_one_line(arguments, status, tmp_path):
    path = tmp_path / "deep.toml"
    path.write_text(HOSTILE["2000 brackets"])
    done = run(*(each.replace("{file}", str(path)) for each in arguments), code=status)
    one_complaint(done, str(path), "levels deep")
