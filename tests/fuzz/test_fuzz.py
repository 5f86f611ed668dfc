"""No input of the corpora, and none of some thousands made from them, does what must not happen."""

import gc
import importlib
import subprocess
import sys

import pytest

from .inputs import Watch
from .run import CHECKOUT, CORPORA, TARGETS, fuzz

RUNS = {"model": 3000, "mjpeg": 1000, "checkpoint": 1500, "bundle": 12, "names": 200, "shards": 4000, "boxes": 500}
"""Inputs of the slower targets, so that each takes about ten seconds."""


@pytest.mark.parametrize("target", TARGETS)
def test_the_corpus_is_read_or_refused_in_a_line(target):
    run = importlib.import_module(f"tests.fuzz.{target}").run
    paths = sorted((CORPORA / target).iterdir())
    watch = Watch(run)
    assert paths
    assert {path.name: found for path in paths if (found := watch.finding(path.read_bytes()))} == {}


@pytest.mark.long
@pytest.mark.parametrize("target", TARGETS)
def test_inputs_made_from_the_corpus_are_read_or_refused_in_a_line(target, tmp_path):
    pytest.importorskip("atheris", reason="needs atheris, of the extra fuzz")
    runs = RUNS.get(target, 8000)
    report = fuzz(target, tmp_path, runs=runs)
    assert [path.with_suffix(".txt").read_text() for path in report.findings] == []
    assert report.inputs >= runs


@pytest.mark.long
def test_requests_to_the_page_leave_nothing_behind():
    """The fuzzed process can't show it: there, atheris keeps something for each request."""
    run = importlib.import_module("tests.fuzz.web").run
    # A stream notices only after a while that nobody reads it.
    inputs = [each for path in (CORPORA / "web").iterdir() if b"/stream" not in (each := path.read_bytes())]

    def blocks_after(rounds):
        for _ in range(rounds):
            for data in inputs:
                run(data)
        gc.collect()
        return sys.getallocatedblocks()

    before = blocks_after(3)
    assert blocks_after(20) - before < 2 * 20 * len(inputs)  # the log and counters keep something; atheris 15 a request


@pytest.mark.parametrize(
    ("data", "text"),
    [
        (b"refuse", ""),
        (b"raise", "KeyError: 'another error'"),
        pytest.param(b"print", "printed b'a line", marks=pytest.mark.long),
        pytest.param(b"hang", "has not ended after", marks=pytest.mark.long),
        pytest.param(b"grow", "MiB more memory", marks=pytest.mark.long),
    ],
)
def test_what_must_not_happen_is_found_and_saved(data, text, tmp_path):
    pytest.importorskip("atheris", reason="needs atheris, of the extra fuzz")
    corpus = tmp_path / "corpus"
    corpus.mkdir()
    (corpus / "1").write_bytes(b"harmless")
    given = tmp_path / "out" / "corpus"
    given.mkdir(parents=True)
    (given / "2").write_bytes(data)
    report = fuzz("misbehaving", tmp_path / "out", runs=4, corpus=corpus)
    assert [path.read_bytes() for path in report.findings] == ([data] if text else [])
    assert all(text in path.with_suffix(".txt").read_text() for path in report.findings)


def test_an_unknown_target_is_named():
    done = subprocess.run(
        [sys.executable, "-m", "tests.fuzz.run", "lenses"], cwd=CHECKOUT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert "unknown target 'lenses' (allowed: model, lens" in done.stderr


def test_the_corpora_stay_small():
    assert sum(path.stat().st_size for path in CORPORA.rglob("*") if path.is_file()) < 200_000
