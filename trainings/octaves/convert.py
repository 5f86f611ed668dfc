"""Rewrite a checkpoint of manifest format 7 as format 8 (no looks yet). convert.py OLD.pt NEW.pt"""
import json, sys, torch
old = torch.load(sys.argv[1], weights_only=True)
print({k: (type(v).__name__) for k, v in old.items()})
m = dict(old["manifest"])
print(m["format_version"], sorted(m))
from dataclasses import fields
from vm_embedded.network.manifest import Manifest
known = {f.name for f in fields(Manifest)}
m = {k: v for k, v in m.items() if k in known} | {"format_version": 8, "looks": []}
old["manifest"] = m
torch.save(old, sys.argv[2])
