"""Lengths, angles and sizes from numbers and text."""

import math
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_embedded.config.units import parse_angle, parse_length, parse_size
from vm_embedded.errors import InputError


@given(st.floats(-1e6, 1e6), st.sampled_from(["{}deg", "{} deg", " {}deg ", "{}  deg"]))
def test_an_angle_in_degrees_is_made_radians(degrees, form):
    assert parse_angle(form.format(degrees), "pitch") == math.radians(degrees)


@given(st.floats(-6.28, 6.28))
def test_an_angle_without_a_unit_is_in_radians(radians):
    assert parse_angle(radians, "pitch") == radians
    assert parse_angle(repr(radians), "pitch") == radians


@given(st.floats(6.29, 1000.0), st.sampled_from([1, -1]))
def test_more_than_a_turn_of_radians_was_meant_in_degrees(number, sign):
    with pytest.raises(InputError, match=r"pitch of .*deg"):
        parse_angle(sign * number, "pitch")


@pytest.mark.parametrize(
    "value",
    ["", "deg", "20 degrees", "20°", "1.2.3deg", "--5deg", "infdeg", "1e999deg", "nan", None, True, [1.0], "0.3rad"],
)
def test_what_is_no_angle_is_refused_by_value(value):
    with pytest.raises(InputError, match=rf"pitch must be an angle.*20deg, not {re.escape(repr(value))}"):
        parse_angle(value, "pitch")


@given(st.floats(-1e6, 1e6))
def test_a_length_is_a_number_or_its_text(meters):
    assert parse_length(meters, "height") == meters
    assert parse_length(repr(meters), "height") == meters


@pytest.mark.parametrize(
    "value", ["", "0.8m", "tall", "inf", None, False, {}, math.nan, 10**400], ids=lambda each: str(each)[:8]
)
def test_what_is_no_length_is_refused_by_value(value):
    with pytest.raises(InputError, match=rf"height must be .*0\.8, not {re.escape(repr(value)[:20])}"):
        parse_length(value, "height")


@given(st.integers(2, 20000), st.integers(2, 20000), st.sampled_from("xX"))
def test_a_size_is_width_and_height(width, height, cross):
    assert parse_size(f"{width}{cross}{height}") == (width, height)


@pytest.mark.parametrize("text", ["", "x", "640", "640x", "640x-2", "640 x 512", "640x512x3", "²x³", f"{'9' * 5000}x2"])
def test_what_is_no_size_is_refused_by_value(text):
    with pytest.raises(
        InputError, match=rf"size must be WIDTHxHEIGHT in pixels, as 640x512, not {re.escape(repr(text)[:1000])}"
    ):
        parse_size(text)


@pytest.mark.parametrize("text", ["1x512", "640x0", "640x20001"])
def test_a_size_that_no_image_has_is_refused(text):
    with pytest.raises(InputError, match=rf"width and height must be from 2 to 20000 px, not '{text}'"):
        parse_size(text)
