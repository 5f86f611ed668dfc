import math
import re
from dataclasses import asdict

import pytest

from vm_embedded.config.toml_reader import parse_toml
from vm_embedded.detection.settings import Settings
from vm_embedded.errors import InputError
from vm_embedded.geometry.lens_files import format_lens_file
from vm_embedded.geometry.orientation import Orientation
from vm_embedded.geometry.radial_lenses import Equisolid, Rectilinear
from vm_embedded.live.configuration import Configuration, read_configuration
from vm_embedded.live.top_level_entries import commented_model
from vm_embedded.network.bundled import DEFAULT, model_path

FULL = """\
model = "models/ball.onnx"

[lens]
projection = "equisolid"
focal_length = 420
fov = 1.8
center = [1.5, -2]
distortion = [1e-7, 0]
size = [640, 480]

[orientation]
height = 0.8
pitch = "20deg"
roll = -0.05

[detector]
threads = 2
spinning = true
format = "bayer_rggb"
height_tolerance = 0
pitch_step = 0.02
roll_step = 0.03
cache_mib = 32
object_radius = 0.11
max_distance = 7.5
threshold = 0.6
min_confidence = 0.8
min_inside = 0.7
max_around = 0.3
max_widths = 3
min_visible = 0.2
field_features = false
"""


@pytest.fixture
def write(tmp_path):
    def written(text):
        path = tmp_path / "vm.toml"
        path.write_text(text, encoding="utf-8")
        return path

    return written


def test_a_full_configuration_is_read(write):
    path = write(FULL)
    found = read_configuration(path)
    assert found.model == str(path.parent / "models" / "ball.onnx")
    assert found.lens.lens == Equisolid(
        focal_length=420.0, fov=1.8, center=(1.5, -2.0), distortion=(1e-7, 0.0), size=(640, 480)
    )
    assert (found.orientation.height, found.orientation.roll) == (0.8, -0.05)
    assert found.orientation.pitch == pytest.approx(math.radians(20.0), rel=1e-15)
    assert asdict(found.detector) == {
        "threads": 2,
        "spinning": True,
        "format": "bayer_rggb",
        "height_tolerance": 0,
        "pitch_step": 0.02,
        "roll_step": 0.03,
        "cache_mib": 32,
        "object_radius": 0.11,
        "max_distance": 7.5,
        "threshold": 0.6,
        "min_confidence": 0.8,
        "min_inside": 0.7,
        "max_around": 0.3,
        "max_widths": 3,
        "min_visible": 0.2,
        "field_features": False,
    }


def test_the_full_configuration_of_this_test_has_every_setting(write):
    settings = asdict(read_configuration(write(FULL)).detector)
    assert all(value != settings[name] for name, value in asdict(Settings()).items())


@pytest.mark.parametrize("text", ["", "# nothing\n", "[detector]\n[orientation]\n"])
def test_everything_may_be_left_out(write, text):
    path = write(text)
    assert read_configuration(path) == Configuration(model=str(model_path(DEFAULT)))


def test_paths_count_from_the_file_s_own_folder(write, tmp_path):
    (tmp_path / "front").mkdir()
    (tmp_path / "front" / "lens.yaml").write_text("projection: RECTILINEAR\nfocal_length: 500\nfov: 1.5\n")
    found = read_configuration(write('model = "ball.onnx"\nlens = "front/lens.yaml"\n'))
    assert found.model == str(tmp_path / "ball.onnx")
    assert found.lens.lens == Rectilinear(focal_length=500.0, fov=1.5)


def test_a_model_file_may_have_a_name_without_a_suffix(write, tmp_path):
    (tmp_path / "network").write_text("")
    assert read_configuration(write('model = "network"\n')).model == str(tmp_path / "network")
    with pytest.raises(InputError, match="unknown network 'netwrk'"):
        read_configuration(write('model = "netwrk"\n'))


def test_absolute_paths_stay_as_they_are(write, tmp_path):
    elsewhere = tmp_path / "elsewhere" / "ball.onnx"
    assert read_configuration(write(f"model = '{elsewhere}'\n")).model == str(elsewhere)


UNKNOWN = {
    "top level": ('modle = "a.onnx"\n', "line 1.*'modle'.*'model'"),
    "a setting at the top level": ("orientations = 1\n", "'orientations'.*'orientation'"),
    "a table": ("[detecter]\nthreads = 1\n", "'detecter'.*'detector'"),
    "orientation": ("[orientation]\npich = 0.1\n", r"line 2.*\[orientation\] 'pich'.*'pitch'"),
    "detector": ("[detector]\ntreshold = 0.5\n", r"line 2.*\[detector\] 'treshold'.*'threshold'"),
    "lens": (FULL.replace("focal_length", "focal_lenght"), "'focal_lenght'.*'focal_length'"),
    "nothing like it": ("zzz = 1\n", "'zzz'.*allowed: model, lens, fov, orientation, detector"),
}


@pytest.mark.parametrize(("text", "says"), UNKNOWN.values(), ids=UNKNOWN)
def test_an_unknown_key_names_itself_and_the_nearest_known_one(write, text, says):
    with pytest.raises(InputError, match=rf"vm\.toml.*{says}"):
        read_configuration(write(text))


WRONG = {
    "model that is no path": ("model = 5\n", "model must be a path, not 5"),
    "lens that is neither path nor table": ("lens = 5\n", r"lens must be a path or a table, \[lens\], not 5"),
    "lens file that is missing": ('lens = "none.yaml"\n', r"none\.yaml.*No such file"),
    "lens that lacks a key": ("[lens]\nprojection = 'equisolid'\nfov = 1\n", "needs focal_length"),
    "lens out of range": (FULL.replace("fov = 1.8", "fov = 103"), "fov .*103"),
    "orientation that is no table": ("orientation = 0.8\n", r"\[orientation\], not 0\.8"),
    "entry without section": ("threads = 1\n", r"unknown key 'threads': it belongs in \[detector\]"),
    "entry of two sections": ("height = 0.8\n", r"it belongs in \[orientation\] or \[camera\]"),
    "detector that is no table": ('detector = "fast"\n', r"\[detector\], not 'fast'"),
    "list of tables": ("[[detector]]\nthreads = 1\n", r"\[detector\]"),
    "height in words": (
        "[orientation]\nheight = 'tall'\n",
        r"\[orientation\] height must be a number of meters, as in 0\.8, not 'tall'",
    ),
    "infinite height": ("[orientation]\nheight = inf\n", "height must be a number of meters.*not inf"),
    "height of many digits": (f"[orientation]\nheight = {'9' * 400}\n", "height must be a number of meters.*not 999"),
    "true height": ("[orientation]\nheight = true\n", "height must be a number of meters.*not True"),
    "pitch in words": ("[orientation]\npitch = 'down'\n", "pitch must be an angle.*20deg.*rad, not 'down'"),
    "pitch that is NaN": ("[orientation]\npitch = nan\n", "pitch must be an angle.*not nan"),
    "threads out of range": ("[detector]\nthreads = 0\n", "threads .*from 1 to 256.*not 0"),
    "half a thread": ("[detector]\nthreads = 1.5\n", "threads .*whole number.*not 1.5"),
    "threads of many digits": (f"[detector]\nthreads = {'9' * 400}\n", "threads .*from 1 to 256"),
    "threshold out of range": ("[detector]\nthreshold = 1.5\n", "threshold .*from 0 to 1, not 1.5"),
    "step out of range": ("[detector]\npitch_step = 0\n", "pitch_step .*from 0.001 to 1 rad, not 0"),
    "number for a word": ("[detector]\nformat = 1\n", "format 1 .*bgr, rgb"),
    "word for a switch": ("[detector]\nspinning = 'yes'\n", "spinning must be true or false, not 'yes'"),
    "unknown format": ("[detector]\nformat = 'grey'\n", "format 'grey'.*'gray'"),
    "not TOML": ("model = ball.onnx\n", "line 1"),
    "not TOML further down": ("model = 'a'\n\n[detector\n", "line 3"),
    "key twice": ("model = 'a'\nmodel = 'b'\n", "line 2"),
}


@pytest.mark.parametrize(("text", "says"), WRONG.values(), ids=WRONG)
def test_what_is_wrong_is_said(write, text, says):
    with pytest.raises(InputError, match=rf"vm\.toml.*{says}"):
        read_configuration(write(text))


def test_a_lens_file_is_no_configuration(tmp_path):
    path = tmp_path / "lens.yaml"
    path.write_text(format_lens_file(Rectilinear(focal_length=400.0, fov=1.5), None))
    with pytest.raises(InputError, match=r"lens\.yaml: it must be TOML, not YAML: .*line 1"):
        read_configuration(path)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(InputError, match=r"none\.toml.*No such file"):
        read_configuration(tmp_path / "none.toml")


def test_a_folder_is_no_configuration(tmp_path):
    with pytest.raises(InputError, match=re.escape(tmp_path.name)):
        read_configuration(tmp_path)


def test_a_binary_file_is_refused(tmp_path):
    path = tmp_path / "vm.toml"
    path.write_bytes(bytes(range(256)))
    with pytest.raises(InputError, match=r"vm\.toml"):
        read_configuration(path)


KEY = "ssh-ed25519 AAAAC3NzaC1lZDI1NTE5AAAAIHUIVGyk+Y3q5gJGRmdb2XkJYJEv1vZ3l5Y5sQ4c1a9k"


@pytest.mark.parametrize(
    ("given", "kept"), [("", ""), (KEY, KEY), (f"{KEY} somebody@somewhere", KEY), (f"  {KEY}\t", KEY)]
)
def test_a_signer_is_a_key_without_its_comment(write, given, kept):
    assert read_configuration(write(f'[deploy]\nsigner = "{given.strip()}"\n')).deploy.signer == kept


@pytest.mark.parametrize("given", ["ssh-rsa AAAA", "ssh-ed25519", KEY[:-4], KEY[:-1] + "*", "AAAA"])
def test_a_signer_that_is_no_key_is_refused(write, given):
    with pytest.raises(InputError, match=r"line 2.*signer must be an Ed25519 public key"):
        read_configuration(write(f'[deploy]\nsigner = "{given}"\n'))


def test_the_orientation_comes_from_the_lens_file_unless_a_height_is_given(write, tmp_path):
    camera = Orientation.from_roll_pitch(0.7, roll=0.1, pitch=0.3)
    (tmp_path / "lens.yaml").write_text(format_lens_file(Equisolid(focal_length=420.0, fov=1.8), camera))
    lens = 'lens = "lens.yaml"\n'
    assert read_configuration(write(lens)).fixed_orientation().height == 0.7
    assert read_configuration(write(lens + "[orientation]\nheight = 0.9\n")).fixed_orientation().pitch == 0.0
    assert read_configuration(write("")).fixed_orientation() is None
    with pytest.raises(InputError, match="pitch and roll need a height"):
        read_configuration(write(lens + "[orientation]\npitch = 0.1\n")).fixed_orientation()


def test_a_printed_model_has_the_name_that_it_was_given():
    name = "/home/\N{ROBOT FACE}/model.onnx"
    assert parse_toml(commented_model(name)) == {"model": name}
