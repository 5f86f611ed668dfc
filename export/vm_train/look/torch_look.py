"""A look network in torch that takes the place of a CloseLook."""

from __future__ import annotations

import torch

from vm_embedded.arrays import Image, Singles
from vm_embedded.network.look_contract import LookContract
from vm_export.look_network import LookNetwork


class TorchLook:
    """A look network and its contract."""

    def __init__(self, network: LookNetwork, contract: LookContract) -> None:
        self._network, self.contract = network.eval(), contract

    def run(self, patches: Image) -> Singles:
        """Answers (n, C, 4) to patches (n, size, size, 3), as `CloseLook.run` gives them.

        It takes one thread, because another number changes the last digits.
        """
        threads = torch.get_num_threads()
        torch.set_num_threads(1)
        try:
            with torch.inference_mode():
                answers: Singles = self._network(torch.from_numpy(patches)).numpy()
        finally:
            torch.set_num_threads(threads)
        return answers
