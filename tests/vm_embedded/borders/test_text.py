"""Names and texts that others wrote, and the messages that quote them."""

import json
import os
import re
import unicodedata

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from vm_embedded.borders.text import (
    MOST_NAME,
    MOST_REMARK,
    name_fault,
    printable,
    printable_lines,
    text_fault,
    to_json,
    utf8,
)
from vm_embedded.errors import InputError
from vm_embedded.files import write_file

from ..strategies import class_names
from ..strategies import printable as characters

BAD_NAMES = [
    "",
    " ball",
    "ball ",
    "ball\ncar",
    "ball\r",
    "a\tb",
    "\x1b[2J",
    "a\0b",
    "\x9b2J",
    "\x7f",
    "a\u2028b",
    "a\u2029b",
    "a\x85b",
    "a\u202eb",
    "\ud800",
    "\udcff",
    "\U000e0041",
    "x" * (MOST_NAME + 1),
    "\U0001f3c0" * 70_000,
]
GOOD_NAMES = [
    "ball",
    "b",
    "traffic light",
    "Bälle",
    "ボール",
    "мяч",
    "⚽",
    "\U0001f3c0",
    "<b>&amp;",
    "$x$",
    "x" * MOST_NAME,
]


@pytest.mark.parametrize("name", BAD_NAMES, ids=lambda name: ascii(name)[:20])
def test_a_bad_name_has_a_reason_that_can_be_printed(name):
    assert name_fault(name)
    assert name_fault(name).isprintable()


@pytest.mark.parametrize("name", GOOD_NAMES, ids=lambda name: ascii(name)[:20])
def test_a_name_in_any_language_is_good(name):
    assert name_fault(name) == ""


@given(class_names)
def test_printable_characters_make_good_names(name):
    assert name_fault(name) == ""
    assert printable(name) == name
    name.encode()


@pytest.mark.long
@given(st.text(max_size=2 * MOST_NAME))
def test_a_good_name_is_one_line_of_text_in_every_format(name):
    if not name_fault(name):
        assert name.splitlines() == [name] == [name.strip()]
        assert not {unicodedata.category(each) for each in name} & {"Cc", "Cs", "Cn", "Zl", "Zp"}
        assert name.encode().decode() == name
        assert len(name.encode()) <= 4 * MOST_NAME


@given(st.text(characters, max_size=MOST_REMARK + 10))
def test_a_text_of_printable_characters_is_limited_in_length_only(text):
    assert bool(text_fault(text)) == (len(text) > MOST_REMARK)


@given(st.text() | st.text(st.sampled_from("a\n\r\x1b\x9b\ud800\udc80\u2028é\\")))
@example("\ud800")
def test_whatever_is_made_printable_is_one_line_that_can_be_encoded(text):
    shown = printable(text)
    assert shown.isprintable()
    assert shown.encode().decode() == shown
    assert printable(shown) == shown
    assert printable_lines(text).split("\n") == [printable(each) for each in text.split("\n")]


@given(st.text(max_size=50) | st.text(max_size=5).map(lambda text: text * 3000))
def test_a_message_is_a_line_of_limited_length_that_keeps_its_ends(text):
    said = str(InputError(f"begin {text} end"))
    assert said.isprintable()
    assert said.startswith("begin ")
    assert said.endswith(" end")
    assert len(said) < 10 * 2100  # an escape has at most ten characters
    json.dumps(said, ensure_ascii=False).encode()


some_text = st.text(st.characters()) | st.text(st.sampled_from('aé\\\ud83d\udc80\ud800\U0001f3c0"\n'))
"""Text with half characters, too."""


@given(some_text)
@example("\\udce4 \udce4 \\\udce4")
@example("\ud83d\udc80 \udc80\ud83d")
def test_json_holds_the_same_text_without_half_characters(text):
    def whole(pair):
        return pair[0].encode("utf-16", "surrogatepass").decode("utf-16")

    shown = to_json({text: [text]})
    assert shown.isascii()
    expected = utf8(re.sub("[\ud800-\udbff][\udc00-\udfff]", whole, text))
    assert json.loads(shown) == {expected: [expected]}


@given(st.binary(min_size=1, max_size=30))
def test_bytes_of_a_name_that_are_not_utf_8_are_escaped_and_nothing_else_is(tmp_path_factory, name):
    text = os.fsdecode(name)
    expected = "".join(f"\\u{ord(each):04x}" if "\udc80" <= each <= "\udcff" else each for each in text)
    assert utf8(text) == expected
    path = tmp_path_factory.mktemp("text") / "file"
    write_file(path, text)
    assert path.read_bytes() == expected.encode()
