"""The layers of a network against their formulas."""

import numpy as np
import torch

from vm_export.neighborhood import Neighborhood
from vm_export.network import GraphConvolution


def test_graph_convolution_is_the_matrix_product_of_the_convention():
    torch.manual_seed(1)
    layer = GraphConvolution(inputs=2, outputs=3, neighbors=4)
    x, neighbors = torch.randn(6, 2), torch.randint(0, 6, (6, 4))
    expected = np.empty((6, 3))
    for i in range(6):
        row = np.concatenate([x[i].numpy(), *(x[j].numpy() for j in neighbors[i])])
        expected[i] = row @ layer.linear.weight.detach().numpy().T + layer.linear.bias.detach().numpy()
    np.testing.assert_allclose(layer(x, Neighborhood(neighbors)).detach().numpy(), expected, atol=1e-5)
