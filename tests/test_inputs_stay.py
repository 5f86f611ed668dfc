"""No program replaces one of its own inputs: it says so before it works, and all files stay as they were."""

import json
import shutil
from pathlib import Path

import pytest

from tests.drawn_scenes import IMAGES
from tests.folders import contents
from tests.programs import run_program
from tests.vm_calibrate.test_kalibr import CAMCHAIN
from tests.vm_embedded.cameras.ros.rolling_ball import Scene
from tests.vm_synth.sets import write_set
from tests.vm_train.boxes.written import write_coco
from tests.vm_train.drawn import draw_set
from vm_embedded.network.bundled import model_path

OUTLINES = {"image0.jpg": [{"cx": 100.0 * index, "cy": 400.0, "r_px": 20.0, "radius": 0.1} for index in range(4)]}

COMMANDS = """\
vm-detect bag --save-mcap bag/bag.mcap
vm-detect bag/bag.mcap --save-mcap link.mcap
vm-bench --image frames/image0.jpg --json frames/image0.jpg
vm-export model.onnx --no-look -o model.onnx
vm-export model.onnx --no-look
vm-calibrate kalibr kalibr.yaml --camera cam0 -o kalibr.yaml
vm-calibrate pose --lens lens.yaml --balls outlines.json --size 640x512 -o outlines.json
vm-calibrate pose --lens lens.yaml --balls frames --radius 0.1 -o frames/image0.txt
vm-calibrate pose --lens lens.yaml --balls frames --radius 0.1 -o data.yaml
vm-calibrate pose --lens lens.yaml frames --board 8x5 --square 0.08 -o frames/image0.jpg
vm-calibrate lens frames --board 8x5 -o frames/image0.jpg
vm-calibrate lens frames/image*.jpg --board 8x5 -o frames/image0.jpg
vm-mesh show --lens lens.yaml --image picture.png -o picture.png
vm-mesh quality --network model.onnx --json model.onnx
vm-mesh compare --lens lens.yaml --size 640x512 --json lens.yaml
vm-synth preview set --output set/image0000000.jpg
vm-synth check set --json set/set.json
vm-synth check set --plots set/mask0000001.png
vm-train check data --json data/lens0001.yaml
vm-train check data --config train.toml --json train.toml
vm-train check boxes --boxes --json boxes/instances.json
vm-train check boxes --boxes --sheet boxes/a.jpg
vm-train check frames --boxes --json data.yaml
vm-train preview data -o data/image0000.jpg
vm-train rate data --plot data/mask0000.png
vm-evaluate ball data --list report/field.csv -o report
vm-evaluate calibrate model.onnx data -o model.onnx
""".splitlines()


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A small file or folder of each kind of input."""
    made = tmp_path_factory.mktemp("inputs")
    frames = made / "frames"
    frames.mkdir()
    shutil.copy(IMAGES[0], frames / "image0.jpg")
    (frames / "image0.txt").write_text("0 0.5 0.5 0.1 0.1\n")
    lens = IMAGES[0].with_name(IMAGES[0].name.replace("image", "lens")).with_suffix(".yaml")
    shutil.copy(lens, made / "lens.yaml")
    shutil.copy(lens, frames / "lens0.yaml")
    shutil.copy(model_path("ball"), made / "model.onnx")
    (made / "kalibr.yaml").write_text(CAMCHAIN)
    (made / "outlines.json").write_text(json.dumps(OUTLINES))
    Scene(count=1).write_frames(made / "scene")
    shutil.copy(made / "scene" / "image000.png", made / "picture.png")
    Scene(count=1).write_bag(made / "bag")
    (made / "link.mcap").symlink_to(made / "bag" / "bag.mcap")
    write_set(made / "set", range(2))
    draw_set(made / "data", 2)
    (made / "train.toml").write_text("")
    (made / "vm.toml").write_text("")
    (made / "lens.toml").write_text('projection = "equisolid"\nfocal_length = 280.0\nfov = 2.4\n')
    write_coco(made / "boxes", {"a": []})
    (made / "data.yaml").write_text("names: [ball]\n")
    (made / "report").mkdir()
    (made / "report" / "field.csv").write_text("0000\n")
    return made


@pytest.mark.long
@pytest.mark.parametrize("command", COMMANDS)
def test_a_program_does_not_replace_its_input(command, folder):
    before = contents(folder)
    program, *arguments = command.split()
    arguments = [str(next(folder.glob(each))) if "*" in each else each for each in arguments]
    done = run_program(program, *arguments, code=1, cwd=folder)
    (line,) = done.stderr.splitlines()
    assert line.startswith(f"{program}: ")
    assert "would be overwritten; give another output" in line or "write to another folder" in line
    assert Path(line.split()[1]).name in command
    assert contents(folder) == before


@pytest.mark.parametrize(
    "command",
    [
        "vm-synth preview set",
        "vm-synth check set --quick --json set/found.json",
        "vm-train check data --json data/a.json",
    ],
)
def test_a_program_may_replace_what_it_wrote_beside_its_inputs(command, folder, tmp_path):
    shutil.copytree(folder, tmp_path / "inputs")
    program, *arguments = command.split()
    for _ in range(2):
        run_program(program, *arguments, cwd=tmp_path / "inputs")
