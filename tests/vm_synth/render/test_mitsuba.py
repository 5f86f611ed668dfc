"""Which LLVM library Mitsuba uses."""

import os
import re

import pytest

from vm_embedded.errors import InputError
from vm_synth.render import mitsuba as llvm
from vm_synth.render.mitsuba import find_llvm


@pytest.fixture
def system(monkeypatch, tmp_path):
    """A file tree of its own where libraries are looked for; called with the files to put there."""
    monkeypatch.delenv("DRJIT_LIBLLVM_PATH", raising=False)
    root = tmp_path / "system"
    monkeypatch.setattr(llvm, "_PLACES", tuple(f"{root}{pattern}" for pattern in llvm._PLACES))

    def installed(*files):
        for file in files:
            path = root / file
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(b"")
        return root

    return installed


DEBIAN = "usr/lib/x86_64-linux-gnu/"


@pytest.mark.parametrize(
    "file",
    [
        f"{DEBIAN}libLLVM-17.so",
        f"{DEBIAN}libLLVM-17.so.1",
        f"{DEBIAN}libLLVM.so.17.0",
        "usr/lib/aarch64-linux-gnu/libLLVM.so.17.0",
        "usr/lib/llvm-17/lib/libLLVM-17.so.1",
        "usr/lib/llvm-17/lib/libLLVM.so.17.0",
        "usr/lib64/libLLVM-17.so",
        "usr/lib64/libLLVM.so.17.0",
        "usr/local/lib/libLLVM.so.17.0",
    ],
)
def test_a_library_is_found_where_systems_put_it(system, file):
    root = system(file)
    assert find_llvm() == root / file


@pytest.mark.parametrize(
    ("versions", "best"),
    [
        ((15, 19), 19),
        ((14, 15, 16, 17, 18, 19, 20, 21), 19),
        ((16, 20), 20),
        ((18, 16, 17), 18),
        ((14, 15, 16), 16),
    ],
)
def test_the_best_tried_version_is_taken(system, versions, best):
    root = system(*(f"{DEBIAN}libLLVM-{version}.so.1" for version in versions))
    assert find_llvm() == root / f"{DEBIAN}libLLVM-{best}.so.1"


def test_versions_are_told_apart_in_any_place(system):
    root = system("usr/lib/llvm-15/lib/libLLVM.so.15", "usr/local/lib/libLLVM.so.19.1", f"{DEBIAN}libLLVM-14.so.1")
    assert find_llvm() == root / "usr/local/lib/libLLVM.so.19.1"


def test_a_link_that_leads_nowhere_is_passed_over(system):
    root = system(f"{DEBIAN}libLLVM-18.so.1")
    (root / DEBIAN / "libLLVM-19.so.1").symlink_to(root / "gone.so")
    assert find_llvm() == root / f"{DEBIAN}libLLVM-18.so.1"


def test_if_none_is_installed_it_is_said_how_to_get_one(system):
    system("usr/lib/x86_64-linux-gnu/libLLVMnothing.so")
    with pytest.raises(InputError, match=r"found none.*apt install libllvm19.*DRJIT_LIBLLVM_PATH"):
        find_llvm()


def test_versions_that_do_not_work_are_named(system):
    system(f"{DEBIAN}libLLVM-14.so.1", f"{DEBIAN}libLLVM-15.so.1")
    with pytest.raises(InputError, match=r"LLVM 16 to 20 \(found only LLVM 14, 15\); install .*libllvm19"):
        find_llvm()


def test_the_library_that_is_named_is_taken_before_all_others(system, monkeypatch, tmp_path):
    system(f"{DEBIAN}libLLVM-19.so.1")
    own = tmp_path / "libLLVM.so"
    own.write_bytes(b"")
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", str(own))
    assert find_llvm() == own


@pytest.mark.parametrize("what", ["none.so", "."])
def test_a_named_library_that_is_no_file_is_refused(system, monkeypatch, tmp_path, what):
    system(f"{DEBIAN}libLLVM-19.so.1")
    named = f"{tmp_path}/{what}"
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", named)
    with pytest.raises(InputError, match=rf"DRJIT_LIBLLVM_PATH is {re.escape(named)}, but there is no such file"):
        find_llvm()


def test_an_empty_name_is_no_name(system, monkeypatch):
    root = system(f"{DEBIAN}libLLVM-19.so.1")
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", "")
    assert find_llvm() == root / f"{DEBIAN}libLLVM-19.so.1"
    assert os.environ["DRJIT_LIBLLVM_PATH"] == ""
