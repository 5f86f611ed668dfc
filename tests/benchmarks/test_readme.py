"""The README of benchmarks/ names every program."""

from pathlib import Path

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


def test_every_program_is_named():
    text = (BENCHMARKS / "README.md").read_text()
    names = {path.name for path in BENCHMARKS.glob("*.py")} - {"__init__.py"}
    assert {name for name in names if f"`{name}`" not in text} == set()
