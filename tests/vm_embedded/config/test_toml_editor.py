"""Entries are set in a vm.toml, and all else in it stays."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_embedded import InputError
from vm_embedded.config.toml_editor import check_editable, edit_section, write_entries
from vm_embedded.config.toml_reader import parse_toml


@pytest.mark.parametrize(
    "content", ["[detector", "detector = 3\n", 'detector = {threads = 2}\n"', "detector.threads = 2\n"]
)
def test_a_file_that_can_not_be_edited_is_left_as_it_is(content, tmp_path):
    path = tmp_path / "vm.toml"
    path.write_text(content)
    for edit in (
        lambda path: check_editable(path, "detector", ["threads"]),
        lambda path: write_entries(path, "detector", {"threads": 1}),
    ):
        with pytest.raises(InputError, match=r"can't be edited: write|can't read"):
            edit(path)
        assert path.read_text() == content


def test_a_binary_file_is_refused(tmp_path):
    path = tmp_path / "vm.toml"
    path.write_bytes(b"\xff\xd8")
    with pytest.raises(InputError, match=r"vm\.toml is not a text file"):
        check_editable(path, "detector", ["threads"])


def test_a_byte_order_mark_is_left_out(tmp_path):
    path = tmp_path / "vm.toml"
    path.write_text("[detector]\nthreads = 2\n", encoding="utf-8-sig")
    write_entries(path, "detector", {"threads": 1})
    assert path.read_bytes() == b"[detector]\nthreads = 1\n"


def test_line_endings_are_kept():
    text = "# a\u2028b\r\n[detector]\r\nthreads = 2\r\n"
    assert edit_section(text, "detector", {"threads": 1}) == text.replace("2\r", "1\r")


@given(
    before=st.dictionaries(st.sampled_from(["threads", "spinning", "cache_mib", "threshold"]), st.integers(1, 9)),
    after=st.dictionaries(st.sampled_from(["threads", "spinning", "pitch_step"]), st.integers(1, 9), min_size=1),
    others=st.booleans(),
)
def test_an_edit_changes_only_the_entries_that_it_names(before, after, others):
    text = "".join(f"{name} = {value}  # kept\n" for name, value in before.items())
    text = "[detector]\n" + text
    text = f"model = 'a.onnx'\n{text}[orientation]\nheight = 1.0\n" if others else text
    expected = parse_toml(text)
    expected["detector"] |= after
    edited = edit_section(text, "detector", after)
    assert parse_toml(edited) == expected
    assert edited.count("# kept") == len(before)
    assert edit_section(edited, "detector", after) == edited
