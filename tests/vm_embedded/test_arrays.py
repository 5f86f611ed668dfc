import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_embedded.arrays import number_or_nan, numbers_or_nan


@given(st.integers(-(2**60), 2**60) | st.floats(allow_nan=False))
def test_a_number_stays_one(value):
    assert number_or_nan(value) == float(value)
    np.testing.assert_array_equal(numbers_or_nan([value]), [float(value)])


@pytest.mark.parametrize("value", [True, False, "1", None, [1.0], {}, 10**400, -(10**400), math.nan])
def test_what_is_no_number_is_nan(value):
    assert math.isnan(number_or_nan(value))


@pytest.mark.parametrize("value", ["1m", None, {}, [1.0, "x"], [[1.0], [2.0, 3.0]], [10**400]])
def test_what_is_no_array_of_numbers_is_one_nan(value):
    found = numbers_or_nan(value)
    assert (found.shape, np.isnan(found)) == ((), True)
