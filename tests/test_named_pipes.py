"""A named pipe in place of any file that is read: programs say so, and never wait for a writer."""

import os

import pytest

from tests.drawn_scenes import IMAGES
from tests.preloaded import LEARNING, run_preloaded
from tests.programs import BIN
from tests.vm_label.made import make_folder
from tests.vm_train.boxes.written import write_coco, write_voc, write_yolo
from tests.vm_train.data.test_pictures import write_pictures
from vm_embedded.network.bundled import model_path
from vm_label.answers import AnswerFile
from vm_label.box_folder import read_box_folder

BALL = ("ball", 20.0, 30.0, 40.0, 50.0)

READ = """\
pictures/image0000001.jpg   vm-train check pictures
pictures/mask0000001.png    vm-train check pictures
pictures/lens0000001.yaml   vm-train check pictures
pictures/mask0000001.png    vm-train preview pictures -o out.png
pictures/image0000001.jpg   vm-train pictures --strict -o run
pictures/mask0000001.png    vm-evaluate ball pictures --strict -o out
pictures/scene0000001.json  vm-evaluate ball pictures --strict -o out
list.txt                    vm-evaluate ball pictures --list list.txt -o out
train.toml                  vm-train pictures --config train.toml -o run
run/run.json                vm-train resume run
a.tar                       vm-train import a.tar out
a.tfrecord                  vm-train import a.tfrecord out
yolo/a.jpg                  vm-train check yolo --boxes
yolo/a.txt                  vm-train check yolo --boxes
yolo/classes.txt            vm-train check yolo --boxes
yolo/a.txt                  vm-train import-boxes yolo out
yolo/classes.txt            vm-train tune yolo --from ball -o new
yolo/a.yaml                 vm-train check yolo --boxes
voc/a.xml                   vm-train check voc --boxes
coco/coco.json              vm-train check coco --boxes
labels/image0000.txt        vm-label labels --write new
labels/classes.txt          vm-label labels --write new
labels/candidates.jsonl     vm-label labels --write new
labels/answers.jsonl        vm-label labels --write new
labels/answers.jsonl        vm-label labels --no-browser --port 0
frames/image0.jpg           vm-detect frames/image0.jpg
frames/image0.jpg           vm-detect frames
frames/image0.jpg           vm-detect frames/image0.jpg frames/image1.jpg
frames/image0.jpg           vm-detect frames --save-boxes new_boxes
frames/lens0.yaml           vm-detect frames/image0.jpg
video.avi                   vm-detect video.avi --height 1 --fov 90deg
bag.mcap                    vm-detect bag.mcap
bag/bag.mcap                vm-detect bag
model.onnx                  vm-detect frames/image0.jpg --model model.onnx
lens.yaml                   vm-detect frames/image0.jpg --lens lens.yaml
vm.toml                     vm-detect --config vm.toml
vm.toml                     vm-detect frames/image0.jpg --config vm.toml
model.onnx                  vm-export model.onnx --no-look
model.pt                    vm-export model.pt
model.yaml                  vm-export model.yaml
frames/image0.jpg           vm-export model.onnx --canary frames/image0.jpg frames/lens0.yaml -o new.onnx
frames/lens0.yaml           vm-export model.onnx --canary frames/image0.jpg frames/lens0.yaml -o new.onnx
look.pt                     vm-export model.onnx --look look.pt -o new.onnx
labels/image0000.jpg        vm-label labels --write new_labels
balls.json                  vm-calibrate pose --lens frames/lens0.yaml --balls balls.json --size 640x512 -o new.yaml
kalibr.yaml                 vm-calibrate kalibr kalibr.yaml --camera cam0 -o new.yaml
set/set.json                vm-synth check set
frames/image0.jpg           vm-bench --image frames/image0.jpg
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("files")
    for name in ("pictures", "frames", "run", "set", "bag"):
        (made / name).mkdir()
    write_pictures(made / "pictures")
    for write, name in ((write_yolo, "yolo"), (write_voc, "voc"), (write_coco, "coco")):
        write(made / name, {"a": [BALL], "b": [BALL]})
    make_folder(made / "labels", 2)
    with AnswerFile(made / "labels") as file:
        for crop in read_box_folder(made / "labels").crops:
            file.append(crop, "yes")
    for number, image in enumerate(IMAGES[:2]):
        (made / "frames" / f"image{number}.jpg").symlink_to(image)
        lens = image.with_name(f"lens{image.stem.removeprefix('image')}.yaml")
        (made / "frames" / f"lens{number}.yaml").symlink_to(lens)
    (made / "bag" / "metadata.yaml").touch()
    (made / "model.onnx").symlink_to(model_path("ball"))
    return made


@pytest.mark.long
@pytest.mark.parametrize("row", READ.splitlines(), ids=lambda row: " ".join(row.split()))
def test_a_named_pipe_in_place_of_a_file_is_named_and_not_waited_for(row, folder):
    name, command = row.split(maxsplit=1)
    path, kept = folder / name, folder / "kept"
    if path.exists():
        path.rename(kept)
    os.mkfifo(path)
    try:
        program, *arguments = command.split()
        done = run_preloaded([BIN / program, *arguments], LEARNING, cwd=folder, timeout=60)
        assert path.name in done.stderr
        assert "not a regular file" in done.stderr
        assert "Traceback" not in done.stderr
    finally:
        path.unlink()
        if kept.exists():
            kept.rename(path)
