"""vm-train shards says how much it wrote."""

from vm_train.cli.shards import run_shards, shards_parser


def test_the_command_says_what_it_did(seven_pictures, tmp_path, capsys):
    options = shards_parser().parse_args([str(seven_pictures), str(tmp_path / "out"), "--size", "4"])
    assert run_shards(options) == 0
    assert capsys.readouterr().out == f"{tmp_path / 'out'}: 7 pictures in 2 shards\n"
    assert run_shards(options) == 0
    assert "7 pictures were there already" in capsys.readouterr().err
