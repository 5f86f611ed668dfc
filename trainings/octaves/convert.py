"""Checkpoints of main (before branch one-look) in the format of one-look: mesh networks (model.pt) and looks (look.pt).

    PYTHONPATH=$PWD:$PWD/export python convert.py IN.pt OUT.pt [--max-proposals N]

--max-proposals: of a look (10 without it). Weights stay as they are. A look with a glance loses the glance.
"""

import argparse

import torch

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("source"), parser.add_argument("target")
parser.add_argument("--max-proposals", type=int, default=10)
options = parser.parse_args()
content = torch.load(options.source, weights_only=True, map_location="cpu")
if "contract" in content:
    contract = content["contract"]
    contract.pop("above", None), contract.pop("glance", None), content.pop("glance", None)
    contract.setdefault("mesh_weight", 0.0)
    contract["max_proposals"] = options.max_proposals
    content["format"] = "vm-embedded look 4"
else:
    manifest = content["manifest"]
    for name in ("layout", "look", "upright_looks"):
        manifest.pop(name, None)
    manifest |= {"looks": [], "format_version": 8}
    manifest.setdefault("peaks", [])
torch.save(content, options.target)
print(f"{options.target}: written")
