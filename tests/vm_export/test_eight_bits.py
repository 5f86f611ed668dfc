"""Kernels as 8-bit integers with one step for each output."""

import numpy as np
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from vm_export.eight_bits import integers_of, round_kernels, rounded
from vm_export.look_network import LookNetwork, LookShape

# From the smallest normal number of single precision, far below any weight, to far above any weight.
weights = st.floats(-1e6, 1e6, width=32, allow_subnormal=False)
kernels = arrays.arrays(np.float32, st.sampled_from([(1, 1), (3, 7), (2, 1, 3, 9)]), elements=weights)


@given(kernels)
@settings(max_examples=200)
def test_a_weight_changes_by_half_a_step_at_most(kernel):
    integers, steps = integers_of(kernel)
    assert integers.dtype == np.int8
    assert steps.shape == (len(kernel),) + (1,) * (kernel.ndim - 1)
    # A step is rounded by 2^-11 of itself at most, so the largest of 127 steps is off by a sixteenth of a step.
    assert (np.abs(rounded(kernel) - kernel) <= 0.51 * steps + np.finfo(np.float32).tiny).all()


@given(kernels)
@settings(max_examples=200)
def test_a_rounded_kernel_stays_the_same(kernel):
    once = rounded(kernel)
    integers, steps = integers_of(once)
    assert once.dtype == np.float32
    assert np.array_equal(integers * steps, once)


@given(kernels, st.integers(0, 1))
@settings(max_examples=100)
def test_each_output_has_its_own_step(kernel, row):
    row %= len(kernel)
    assert np.array_equal(rounded(kernel)[row], rounded(kernel[row : row + 1])[0])


def test_an_output_without_weights_stays_without():
    kernel = np.array([[0.0, 0.0], [1.0, -0.5]], dtype=np.float32)
    assert np.array_equal(rounded(kernel)[0], [0.0, 0.0])
    assert integers_of(kernel)[0][1].tolist() == [127, -64]


def test_all_layers_but_the_answers_are_rounded():
    torch.manual_seed(0)
    network = LookNetwork(LookShape(16, (4, 6, 8)))
    before = {name: value.clone() for name, value in network.state_dict().items()}
    round_kernels(network)
    changed = {name for name, value in network.state_dict().items() if not torch.equal(value, before[name])}
    assert changed == {*(f"convolutions.{index}.weight" for index in range(6)), "hidden.weight"}
