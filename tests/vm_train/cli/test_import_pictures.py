"""vm-train import names the records that it skipped, and fails if it imported nothing."""

import pytest

from vm_embedded.errors import InputError
from vm_train.cli.import_pictures import import_parser, run_import

from ..formats.test_picture_example import reference_example, written
from ..formats.test_shards import tar_of


def test_the_command_imports_and_names_what_it_skipped(tmp_path, capsys):
    example = reference_example()
    example["theirs"] = example.pop("lens/fov")
    path = written(tmp_path / "a", example, reference_example(mask=None))
    out = str(tmp_path / "out")
    assert run_import(import_parser().parse_args([str(path), out, "--key", "lens/fov=theirs"])) == 0
    said = capsys.readouterr()
    assert said.out == f"{out}: 1 pictures imported, 1 skipped\n"
    assert said.err.startswith(f"vm-train: skipped {path}: record 1: lacks mask, lens/fov (as 'theirs'); it has 'Hoc'")


def test_the_command_shows_the_first_faults_only_and_fails_if_nothing_was_imported(tmp_path, capsys):
    path = written(tmp_path / "a", *[reference_example(mask=None)] * 23)
    with pytest.raises(InputError, match="found no usable picture"):
        run_import(import_parser().parse_args([str(path), str(tmp_path / "out")]))
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 21
    assert said[-1] == "vm-train: skipped 3 more"


def test_names_in_an_archive_do_not_control_the_terminal(tmp_path, capsys):
    archive = tar_of(tmp_path / "a.tar", [("\x1b[2J.jpg", b""), ("\x1b[2J", b"")])
    with pytest.raises(InputError, match="found no usable picture"):
        run_import(import_parser().parse_args([str(archive), str(tmp_path / "out")]))
    said = capsys.readouterr().err
    assert "lacks its mask and lens" in said
    assert "\x1b" not in said


@pytest.mark.parametrize(
    ("key", "said"),
    [
        ("lens/fov", "OURS=THEIRS"),
        ("lens/fov=", "OURS=THEIRS"),
        ("fov=x", "unknown key 'fov'; did you mean 'lens/fov'?"),
    ],
)
def test_a_renaming_that_is_none_is_wrong_usage(key, said, capsys):
    with pytest.raises(SystemExit):
        import_parser().parse_args(["a", "out", "--key", key])
    assert said in capsys.readouterr().err
