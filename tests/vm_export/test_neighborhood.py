"""The gather of neighbors and its gradient are those of torch's own indexing."""

from __future__ import annotations

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from vm_export.neighborhood import Neighborhood


@given(seed=st.integers(0, 2**31 - 1), points=st.integers(1, 40), neighbors=st.integers(1, 8), width=st.integers(1, 9))
def test_gather_and_gradient_are_those_of_indexing(seed, points, neighbors, width):
    torch.manual_seed(seed)
    links = torch.randint(0, points, (points, neighbors))
    pull = torch.randn(points, neighbors + 1, width, dtype=torch.float64)
    values, gradients = [], []
    for own in (True, False):
        x = torch.linspace(-1, 1, points * width, dtype=torch.float64).reshape(points, width).requires_grad_()
        gathered = Neighborhood(links).gather(x) if own else torch.cat([x[:, None], x[links]], dim=1)
        (gathered.sin() * pull).sum().backward()
        values.append(gathered.detach())
        gradients.append(x.grad)
    assert torch.equal(*values)
    torch.testing.assert_close(*gradients, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("dtype", [torch.float32, torch.bfloat16])
def test_gradient_is_repeatable(dtype):
    torch.manual_seed(0)
    links = torch.randint(0, 500, (500, 6))
    pull = torch.randn(500, 7, 4, dtype=dtype)

    def gradient():
        x = torch.ones(500, 4, dtype=dtype, requires_grad=True)
        (Neighborhood(links).gather(x) * pull).sum().backward()
        return x.grad

    assert torch.equal(gradient(), gradient())
