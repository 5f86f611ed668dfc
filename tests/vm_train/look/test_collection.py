"""Patches are the same whoever collects them, and whatever interrupts it."""

import shutil

import numpy as np
import pytest

from tests.other_model import OTHER
from vm_embedded.config.sections import read_sections
from vm_embedded.errors import InputError
from vm_embedded.network.bundled import model_path
from vm_train.data.pictures import find_pictures
from vm_train.data.split import split_by_seed
from vm_train.look import collection
from vm_train.look.configuration import LookConfiguration
from vm_train.look.labels import NOTHING, OBJECT
from vm_train.look.patch_set import PatchChunk
from vm_train.look.run import begin_look_run, read_look_run
from vm_train.runs.run import kind_of


@pytest.fixture(autouse=True)
def _small_chunks(monkeypatch):
    monkeypatch.setattr(collection, "CHUNK", 6)


@pytest.fixture
def begin(drawn, tiny, tmp_path):
    """Begins a run on the drawn pictures, or those of another folder."""

    def begin_one(name="run", data=drawn, strict=False, changes=None, mesh="ball"):
        split = split_by_seed([each.number for each in find_pictures(data)], 0.25, 0.0, 0)
        configuration = read_sections(LookConfiguration, tiny, changes)
        return begin_look_run(tmp_path / name, data, split, configuration, model_path(mesh), mesh, strict=strict)

    return begin_one


@pytest.fixture
def damaged(drawn, tmp_path):
    """The drawn pictures, of which one has no lens file."""
    folder = tmp_path / "damaged"
    folder.mkdir()
    for path in drawn.iterdir():
        (folder / path.name).symlink_to(path)
    (folder / "lens0007.yaml").unlink()
    return folder


def collect_patches(run, workers, report=lambda done: None):
    return [PatchChunk.load(path) for path in collection.collect_patches(run, workers, report)]


def content(run):
    return {path.name: path.read_bytes() for path in sorted(run.patches.iterdir())}


def test_patches_have_labels_and_validation_counts_the_objects(begin):
    run = begin()
    done = []
    chunks = collect_patches(run, 1, done.append)
    assert done == list(range(21))
    assert sorted(content(run)) == [f"{number:05d}.npz" for number in range(4)]
    for chunk in chunks:
        patches = chunk.patches
        assert patches.patches.shape == (len(patches), 16, 16, 3)
        assert set(patches.labels.tolist()) <= {OBJECT, NOTHING}
        assert not patches.targets[patches.labels == NOTHING].any()
        assert not patches.kinds.any()
    ((objects, proposed),) = sum(each.truths for each in chunks).tolist()
    assert 3 <= proposed <= objects <= len(run.split.validation)


def test_each_class_has_patches_and_truths_of_its_own(begin, field):
    """On the field, two posts and a robot are visible, and a ball."""
    run = begin(data=field, mesh="soccer", changes={"patches": {"max_proposals": 24}})
    assert run.classes == ("ball", "goal", "robot")
    found = PatchChunk.joined(collect_patches(run, 1))
    assert not found.faults
    visible, proposed = found.truths.T
    assert visible.tolist() == [len(run.split.validation) * each for each in (1, 2, 1)]
    assert (proposed <= visible).all()
    assert (proposed > 0).all()
    validates = np.isin(np.array(run.numbers)[found.patches.pictures], run.split.validation)
    for kind in range(3):
        of = [found.patches.part((found.patches.kinds == kind) & (validates == part)) for part in (False, True)]
        assert all(0 < each.objects < len(each) for each in of)
        assert len(of[1]) <= 24 * len(run.split.validation)


def test_a_picture_that_cannot_be_used_has_no_truths_of_any_class(begin, field, tmp_path):
    folder = shutil.copytree(field, tmp_path / "field")
    for path in folder.glob("lens*"):
        path.unlink()
    found = PatchChunk.joined(collect_patches(begin(data=folder, mesh="soccer"), 1))
    assert (len(found.patches), found.truths.tolist()) == (0, [[0, 0]] * 3)
    assert len(found.faults) == 8


def test_pictures_for_training_have_patches_at_all_kinds_of_places_and_those_for_validation_at_proposals(begin):
    def count(jittered, random):
        """Numbers of patches for training and for validation."""
        run = begin(f"{jittered} {random}", changes={"patches": {"jittered": jittered, "random": random}})
        pictures = np.concatenate([each.patches.pictures for each in collect_patches(run, 1)])
        validates = np.isin(np.array(run.numbers)[pictures], run.split.validation)
        return (~validates).sum(), validates.sum()

    (proposed, validation), (beside, second), (anywhere, third) = count(0, 0), count(2, 0), count(0, 2)
    assert 0 < proposed < min(beside, anywhere)
    assert 0 < validation == second == third


@pytest.mark.long
def test_two_workers_write_the_same_files_as_one(begin):
    one, two = begin("one"), begin("two")
    collect_patches(one, 1)
    collect_patches(two, 2)
    assert content(one) == content(two)


def test_an_interrupted_collection_keeps_its_chunks_and_ends_with_the_same_files(begin):
    whole, run = begin("whole"), begin()
    collect_patches(whole, 1)

    def interrupt(done):
        if done == 15:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        collect_patches(run, 1, interrupt)
    assert len(content(run)) == 2
    (run.patches / "00001.npz").unlink()
    done = []
    collect_patches(read_look_run(run.folder), 1, done.append)
    assert done == list(range(6, 21))
    assert content(run) == content(whole)


def test_a_picture_that_cannot_be_used_is_left_out_and_named(begin, damaged):
    whole, run = begin("whole"), begin(data=damaged)
    chunks, others = collect_patches(run, 1), collect_patches(whole, 1)
    assert [each.faults for each in chunks] == [(), ("picture 0007: lens0007.yaml: is missing",), (), ()]
    assert set(chunks[1].patches.pictures) == {6, 8, 9, 10, 11}
    assert chunks[2].patches.sha256() == others[2].patches.sha256()


def test_a_strict_run_ends_with_the_picture_and_goes_on_when_it_is_repaired(begin, damaged, drawn):
    run = begin(data=damaged, strict=True)
    with pytest.raises(InputError, match=r"picture 0007: lens0007.yaml: is missing; repair it and continue with"):
        collect_patches(run, 1)
    (damaged / "lens0007.yaml").symlink_to(drawn / "lens0007.yaml")
    assert not any(each.faults for each in collect_patches(read_look_run(run.folder), 1))


def test_a_picture_that_has_left_the_folder_is_named(begin, damaged):
    run = begin(data=damaged)
    (damaged / "image0003.jpg").unlink()
    with pytest.raises(InputError, match=r"lacks picture 0003, which the training began with; .* --data"):
        collect_patches(run, 1)


def test_a_damaged_chunk_is_named(begin):
    run = begin()
    (run.patches / "00002.npz").write_bytes(b"PK")
    with pytest.raises(InputError, match=r"00002.npz: .*; remove it and resume"):
        collect_patches(run, 1)


def test_files_that_were_changed_since_the_beginning_are_refused(begin):
    run = begin()
    assert kind_of(run.folder) == "look"
    mesh, toml = run.mesh.read_bytes(), (run.folder / "look.toml").read_text()
    run.mesh.write_bytes(OTHER.read_bytes())
    with pytest.raises(InputError, match=r"mesh\.onnx was changed"):
        read_look_run(run.folder)
    run.mesh.write_bytes(mesh)
    (run.folder / "look.toml").write_text(toml.replace("epochs = 4", "epochs = 5"))
    with pytest.raises(InputError, match=r"look.toml was changed"):
        read_look_run(run.folder)
    (run.folder / "run.json").write_text("{}")
    with pytest.raises(InputError, match="is damaged"):
        read_look_run(run.folder)
