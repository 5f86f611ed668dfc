"""Ranges and lists of names in a configuration, and what is drawn from them."""

import math
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_embedded.config.entries import check_entries, number, one_of, share
from vm_embedded.errors import InputError
from vm_workstation.ranges import log_uniform, range_of, some_of, uniform


@dataclass(frozen=True)
class Section:
    span: tuple[float, float] = range_of(1.0, 2.0, "a range")
    part: float = share(0.5, "a share")
    count: int = number(3, "a number of things")
    some: tuple[str, ...] = some_of(("a", "b"), "names", ("b",))
    one: str = one_of(("a", "b"), "a", "a name")
    plain: int = 5

    def __post_init__(self):
        check_entries(self)


def test_a_section_makes_ranges_and_names_tuples_and_numbers_floats():
    made = Section(span=[1, 2], part=1, count=4, some=["b", "a"], one="b", plain="anything")
    assert made == Section((1.0, 2.0), 1.0, 4, ("b", "a"), "b", "anything")
    assert [type(each) for each in (*made.span, made.part, made.count)] == [float, float, float, int]
    assert Section().some == ("b",)


@pytest.mark.parametrize(("value", "says"), [(-1.0, "of at least 0"), (math.nan, "of at least 0"), (None, "not None")])
def test_an_entry_without_an_upper_limit_says_the_lower_one(value, says):
    with pytest.raises(InputError, match=f"span must be a number .*{says}"):
        Section(span=(value, 2.0))


@pytest.mark.parametrize("value", [math.inf, 10**400], ids=["infinite", "of many digits"])
def test_without_an_upper_limit_numbers_are_still_finite(value):
    with pytest.raises(InputError, match="span must be a number of at least 0"):
        Section(span=(1.0, value))


@given(st.floats(0.0, 1e6), st.floats(0.0, 1e6), st.integers(0, 2**32 - 1))
def test_draws_stay_in_their_range(one, other, seed):
    low, high = sorted((one, other))
    random = np.random.default_rng(seed)
    assert all(low <= uniform(random, (low, high)) <= high for _ in range(5))
    low, high = low + 1e-3, high + 1e-3
    drawn = [log_uniform(random, (low, high)) for _ in range(5)]
    assert all(low * (1 - 1e-12) <= each <= high * (1 + 1e-12) for each in drawn)


def test_draws_are_spread_evenly_and_by_factors():
    random = np.random.default_rng(0)
    assert np.mean([uniform(random, (2.0, 4.0)) < 2.5 for _ in range(4000)]) == pytest.approx(0.25, abs=0.03)
    assert np.mean([log_uniform(random, (0.1, 10.0)) < 1.0 for _ in range(4000)]) == pytest.approx(0.5, abs=0.03)
