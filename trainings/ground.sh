#!/bin/sh
# Point 6 of issue 55: run in the root of a clean checkout of the merged tree. It moves files and rewrites imports, and
# stages everything; lines "by hand" on standard output need a look. Then: mypy, tests/test_layers.py, tests/test_docs.py; commit.
set -e
python=${PYTHON:-python3}
"$python" "$(dirname "$0")/ground.py"
"$python" -m ruff check --quiet --fix . || true
"$python" -m ruff format --quiet .
"$python" -m ruff check .
git add -A
git grep -nE 'vm_embedded[./]borders|\brooms?\b' -- tests docs/design.md .github vm_embedded export | grep -vE 'vm_synth|docs/(own-object|synth)' | head -40 || true
