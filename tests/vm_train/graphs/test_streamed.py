"""Trainings from streamed shards: repeatable, resumable, and every fault by name."""

import io
import json
import shutil
import tarfile
from dataclasses import replace
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread

import pytest

from tests.vm_train.commands import SMALL
from tests.vm_train.drawn import CLASSES, draw_set
from tests.vm_train.weights import same
from vm_embedded.config.sections import read_sections
from vm_embedded.errors import InputError
from vm_export.checkpoint import Checkpoint
from vm_train.cli.train import main
from vm_train.data.pictures import find_pictures
from vm_train.data.split import Split
from vm_train.formats.shards import write_shards
from vm_train.graphs.schedule import schedule
from vm_train.graphs.streamed import StreamedItem, StreamSource, assign_lanes
from vm_train.learning.configuration import TrainConfiguration
from vm_train.learning.hardware import Hardware, set_up_hardware
from vm_train.learning.rounds import train
from vm_train.learning.run_folder import begin_run, read_run
from vm_train.learning.training_data import TrainingData

EPOCH, SHARDS = 14, 5


@pytest.fixture(autouse=True)
def repeatable():
    """As vm-train computes."""
    with set_up_hardware("cpu", 0, 1):
        yield


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """data: pictures for validation. shards: of other pictures. train.toml."""
    made = tmp_path_factory.mktemp("streamed")
    draw_set(made / "data", 4)
    pictures = find_pictures(draw_set(made / "training", 20, seed=1))
    write_shards(pictures, made / "shards", 4, lambda: None)
    (made / "train.toml").write_text(CLASSES + SMALL.replace('"hard"', '"balanced"'))
    return made


@pytest.fixture
def shards(place, tmp_path):
    """Shards that a test may damage."""
    return sorted(shutil.copytree(place / "shards", tmp_path / "shards").glob("*.tar"))


def begun(place, folder, shards, workers=0, strict=False):
    configuration = read_sections(TrainConfiguration, place / "train.toml")
    split = Split((), tuple(each.number for each in find_pictures(place / "data")))
    source = StreamSource(tuple(map(str, shards)), EPOCH, 1, workers, strict)
    return begin_run(folder, TrainingData(place / "data", split, None, source), configuration)


def trained(training, stops=None):
    """Train with a stop after so many batches, if any, and then to the end."""
    here = Hardware("cpu", 0, 1, training.data.source.workers)
    if stops is not None:
        asked = iter(range(stops))
        assert not train(training, here, lambda: next(asked, None) is None).finished
        training = read_run(training.folder)
    assert train(training, here, lambda: False).finished
    return Checkpoint.load(training.model_path).network.state_dict()


def rewritten(path, change):
    """Write a shard again with other files, as change(name, content) has them; None leaves one out."""
    with tarfile.open(path) as tar:
        files = [(each.name, tar.extractfile(each).read()) for each in tar]
    with tarfile.open(path, "w") as tar:
        for name, content in files:
            made = change(name, content)
            if made is not None:
                entry = tarfile.TarInfo(name)
                entry.size = len(made)
                tar.addfile(entry, io.BytesIO(made))


@pytest.mark.parametrize(("processes", "workers"), [(1, 0), (1, 3), (2, 2)])
def test_each_worker_has_a_lane_of_its_own_and_misses_none_of_it(processes, workers):
    source = StreamSource(tuple("abcdef"), 22, processes, workers)
    batches = list(assign_lanes(schedule((0, 1), 2, 4, source.epoch, 9), (0, 1), source))
    places = {}
    for index, batch in enumerate(batches):
        for rank in range(processes):
            for item in batch.part(rank, processes).items:
                assert isinstance(item, StreamedItem) != batch.validates
                if not batch.validates:
                    assert item.lane == index % max(workers, 1) * processes + rank
                    places.setdefault((item.order, item.lane), []).append(item.place)
    assert len(places) == 2 * source.lanes
    assert all(each == list(range(len(each))) for each in places.values())
    assert sum(map(len, places.values())) == 2 * 22
    assert len({item.seed for batch in batches if not batch.validates for item in batch.items}) == 2 * 22


def test_an_item_is_the_same_picture_after_a_stop(place, tmp_path):
    training = begun(place, tmp_path / "run", sorted((place / "shards").glob("*.tar")), workers=2)
    items = [StreamedItem(0, None, (0, 1, 4, 0), 1, each) for each in range(25)]
    graphs = [training.scheduled_graphs()[each] for each in items[::6]]
    whole = training.scheduled_graphs()
    ordered = [whole[each] for each in items]
    assert all((one.points == other.points).all() for one, other in zip(graphs, ordered[::6], strict=True))
    # A lane of 2 or 3 shards has 8 or 12 pictures, and then begins again with those of others.
    assert len({each.points.tobytes() for each in ordered[:8]}) == 8
    other = training.scheduled_graphs()[replace(items[0], lane=0)]
    assert other.points.tobytes() not in {each.points.tobytes() for each in ordered[:8]}


@pytest.fixture(scope="module")
def whole(place, tmp_path_factory):
    """Weights of a training that nobody disturbs."""
    shards = sorted((place / "shards").glob("*.tar"))
    return trained(begun(place, tmp_path_factory.mktemp("whole") / "run", shards))


@pytest.mark.parametrize("stops", [0, 2, 5])
def test_what_is_stopped_ends_with_the_same_weights(stops, place, whole, tmp_path):
    training = begun(place, tmp_path / "run", sorted((place / "shards").glob("*.tar")))
    assert same(trained(training, stops), whole)


@pytest.mark.long
def test_so_it_does_with_two_workers(place, whole, tmp_path):
    shards = sorted((place / "shards").glob("*.tar"))
    undisturbed = trained(begun(place, tmp_path / "one", shards, workers=2))
    assert same(trained(begun(place, tmp_path / "two", shards, workers=2), 4), undisturbed)
    assert not same(undisturbed, whole)


@pytest.fixture
def address(place):
    handler = partial(SimpleHTTPRequestHandler, directory=str(place / "shards"))
    handler.func.log_message = lambda *_: None
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}/pictures-{{000000..000004}}.tar"
        server.shutdown()


def test_a_user_streams_from_a_server(place, address, tmp_path, capsys):
    command = [str(place / "data"), "-o", str(tmp_path / "run"), "--config", str(place / "train.toml")]
    command += ["--stream", address, "--epoch-pictures", str(EPOCH), "--workers", "0", "--threads", "1"]
    assert main(command) == 0
    out = capsys.readouterr().out
    assert f"{EPOCH} an epoch of {SHARDS} shards for training, 4 for validation, 0 for test" in out
    assert "vm-evaluate" not in out
    provenance = Checkpoint.load(tmp_path / "run" / "model.pt").manifest.provenance
    assert provenance["training_pictures"] == f"{EPOCH} an epoch, streamed"
    kept = json.loads((tmp_path / "run" / "run.json").read_text())["source"]
    assert (kept["workers"], len(kept["shards"])) == (0, SHARDS)
    assert main(["resume", str(tmp_path / "run"), "--workers", "1"]) == 0
    assert "0 workers read the stream, as run.json says" in capsys.readouterr().err


def test_pictures_at_fault_are_named_and_skipped(place, shards, tmp_path, capfd):
    """Each is named once by a reader, and the others keep their places."""
    damaged = {"0001.jpg": b"none", "0003.lens.yaml": b"lens: 1", "0004.mask.png": None}
    for shard in shards[:2]:
        rewritten(shard, lambda name, content: damaged.get(name, content))
    training = begun(place, tmp_path / "run", shards)
    trained(training)
    said = capfd.readouterr().err
    assert "skipped: picture 0001 of the stream: image: can't be decoded as an image" in said
    assert "skipped: picture 0003 of the stream: lens: " in said
    assert "pictures-000001.tar: picture 0004 lacks its mask" in said


def test_strict_ends_at_a_fault_and_goes_on_when_it_is_mended(place, shards, whole, tmp_path):
    training = begun(place, tmp_path / "run", shards, strict=True)
    before = [shard.read_bytes() for shard in shards]
    for shard in shards:
        rewritten(shard, lambda name, content: b"none" if name.endswith(".jpg") else content)
    with pytest.raises(
        InputError,
        match=r"picture \d+ of the stream: image: .*with --strict, a damaged picture ends the training; "
        "continue with vm-train resume ",
    ):
        trained(training)
    for shard, content in zip(shards, before, strict=True):
        shard.write_bytes(content)
    assert same(trained(read_run(training.folder)), whole)


def test_a_cut_shard_is_named_with_its_byte_and_the_training_goes_on_when_it_is_whole(place, shards, whole, tmp_path):
    training = begun(place, tmp_path / "run", shards)
    here = Hardware("cpu", 0, 1, 0)
    asked = iter(range(1))
    assert not train(training, here, lambda: next(asked, None) is None).finished
    before = [shard.read_bytes() for shard in shards]
    for shard in shards:
        shard.write_bytes(shard.read_bytes()[:5000])
    said = r"pictures-00000\d\.tar: can't be read after .*, at byte 5000: .*continue with vm-train resume "
    with pytest.raises(InputError, match=said):
        train(read_run(training.folder), here, lambda: False)
    for shard, content in zip(shards, before, strict=True):
        shard.write_bytes(content)
    assert same(trained(read_run(training.folder)), whole)


def test_shards_without_a_picture_are_named(place, tmp_path):
    with tarfile.open(tmp_path / "empty.tar", "w"):
        pass
    with pytest.raises(InputError, match=r"no complete picture in .*empty\.tar"):
        begun(place, tmp_path / "run", [tmp_path / "empty.tar"])


def test_there_are_no_more_readers_than_shards():
    with pytest.raises(InputError, match="4 reading processes need at least 4 shards, not 3"):
        StreamSource(("a", "b", "c"), 9, 2, 2)
