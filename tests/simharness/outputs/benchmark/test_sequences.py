"""Benchmarks of many sequences: each is that of its seed, finished ones are kept, the description is of all of them."""

import hashlib
import json
import shutil
from functools import partial

import cv2
import numpy as np
import pytest
from trials import simulated

from simharness.outputs.benchmark.panoptic_sequence import ExportPlan, export_sequence
from simharness.outputs.benchmark.sequences import SPLITS, export_benchmark
from simharness.scenario.load import load
from simharness.types.views import Visibility

pytestmark = pytest.mark.slow

TINY = (
    *("people.count=2", "cameras.count=3", "duration=0.2", "clutter.shelves=0", "clutter.boxes=1"),
    *("cameras.size=[160, 120]", "room.walls=false"),
)
PLAN = partial(ExportPlan, also=frozenset({"depth", "ids", "coco"}))
BARE = partial(ExportPlan, pictures=False)


@pytest.fixture(scope="module")
def scenario():
    return load("quickstart", overrides=TINY)


@pytest.fixture(scope="module")
def benchmark(scenario, tmp_path_factory):
    folder = tmp_path_factory.mktemp("benchmark") / "made"
    done = export_benchmark(scenario, folder, PLAN, sequences=2, workers=2, command="simharness export")
    assert (done.made, done.kept, done.impossible) == (2, 0, {})
    return folder


def described(folder):
    return json.loads((folder / "benchmark.json").read_text())


def contents(folder):
    """Return the files of a sequence, without what says when and by which command it was written."""
    skipped = ("manifest.json", ".written")
    files = (each for each in folder.rglob("*") if each.is_file() and each.name not in skipped)
    return {each.relative_to(folder).as_posix(): each.read_bytes() for each in files}


def test_a_sequence_is_that_of_its_seed_alone(benchmark, scenario, tmp_path):
    alone = export_sequence(scenario.model_copy(update={"seed": 8}), PLAN(tmp_path / "alone"))
    assert contents(alone) == contents(benchmark / "quickstart_0008")
    assert contents(alone) != contents(benchmark / "quickstart_0007")


def test_the_description_counts_what_is_there(benchmark):
    about = described(benchmark)
    assert [each["seed"] for each in about["sequences"]] == [7, 8]
    assert [each["split"] for each in about["sequences"]] == [SPLITS[7], SPLITS[8]] == ["train", "test"]
    for each in about["sequences"]:
        assert len(list((benchmark / each["name"] / "hdImgs" / "00_00").iterdir())) == each["frames"] == 2
        assert (each["cameras"], each["people"]) == (3, 2)
    readme = (benchmark / "README.md").read_text()
    assert "| train | 1 | 2 |" in readme
    assert about["truth_sha256"] in readme


def test_all_files_have_their_checksums(benchmark):
    lines = (benchmark / "SHA256SUMS").read_text().splitlines()
    sums = {name: digest for digest, name in (line.split("  ") for line in lines)}
    files = [each for each in benchmark.rglob("*") if each.is_file() and each.name != ".written"]
    assert {each.relative_to(benchmark).as_posix() for each in files} == {*sums, "SHA256SUMS"}
    for name, digest in sums.items():
        assert hashlib.sha256((benchmark / name).read_bytes()).hexdigest() == digest
    (described_file,) = json.loads((benchmark / "croissant.json").read_text())["distribution"]
    assert described_file["sha256"] == sums[described_file["contentUrl"]]


@pytest.mark.slow
def test_what_is_there_is_kept_and_what_is_not_is_made(scenario, tmp_path):
    folder = tmp_path / "grows"
    export_benchmark(scenario, folder, BARE, sequences=1)
    first = folder / "quickstart_0007" / "manifest.json"
    before, digest = first.read_bytes(), described(folder)["truth_sha256"]
    done = export_benchmark(scenario, folder, BARE, sequences=2)
    assert (done.made, done.kept) == (1, 1)
    assert first.read_bytes() == before
    shutil.rmtree(folder / "quickstart_0008")
    assert export_benchmark(scenario, folder, BARE, sequences=2).made == 1
    both = described(folder)["truth_sha256"]
    assert both != digest
    parts = tmp_path / "parts"
    for seed in (8, 7):  # as two machines would
        export_benchmark(scenario.model_copy(update={"seed": seed}), parts, BARE, sequences=1)
    assert described(parts)["truth_sha256"] == both
    assert export_benchmark(scenario, folder, partial(BARE, every=2), sequences=2).made == 2  # other contents


def test_scenes_that_cannot_be_built_are_left_out(scenario, tmp_path):
    crowd = load("quickstart", overrides=[*TINY, "people.count=40", "room.size=[3, 3, 3]"])
    with pytest.raises(ValueError, match="no scene of 2 seeds can be built; seed 7: "):
        export_benchmark(crowd, tmp_path / "crowd", BARE, sequences=2)
    assert not (tmp_path / "crowd" / "benchmark.json").exists()


def test_coco_keypoints_are_the_truth_in_the_pictures(benchmark, scenario):
    _, frames = simulated(scenario)
    for view in range(3):
        file = json.loads((benchmark / f"quickstart_0007/coco/00_0{view}.json").read_text())
        assert [each["id"] for each in file["images"]] == [0, 1]
        shown = {(each["image_id"], each["track_id"]): each for each in file["annotations"]}
        assert len(shown) == len(file["annotations"]) > 0
        for frame, truth in enumerate(each.truth for each in frames):
            for person in range(2):
                area = truth.boxes[view, person, 2:].prod()
                assert ((frame, person) in shown) == (area >= 1)
                if area < 1:
                    continue
                entry = shown[frame, person]
                points = np.array(entry["keypoints"]).reshape(17, 3)
                seen = truth.visibility[view, person]
                inside = seen != Visibility.OUTSIDE
                np.testing.assert_array_equal(points[:, 2] == 2, seen == Visibility.VISIBLE)
                np.testing.assert_array_equal(points[:, 2] == 0, ~inside)
                np.testing.assert_allclose(points[inside, :2], truth.pixels[view, person, inside], atol=0.006)
                assert not points[~inside].any()
                assert entry["num_keypoints"] == inside.sum()
                np.testing.assert_allclose(entry["bbox"], truth.boxes[view, person], atol=0.006)


def test_channels_show_who_is_where(benchmark):
    file = json.loads((benchmark / "quickstart_0007/coco/00_00.json").read_text())
    for entry in file["annotations"]:
        name = f"00_00/00_00_{entry['image_id']:08d}.png"
        ids, depth = (
            cv2.imread(str(benchmark / "quickstart_0007" / channel / name), cv2.IMREAD_UNCHANGED)
            for channel in ("ids", "depth")
        )
        rows, columns = np.nonzero(ids == entry["track_id"] + 1)
        assert len(rows) > 20
        x, y, width, height = entry["bbox"]
        assert x - 1 <= columns.min() <= columns.max() <= x + width + 1
        assert y - 1 <= rows.min() <= rows.max() <= y + height + 1
        assert (depth[rows, columns] > 500).all()


def test_a_sequence_is_no_benchmark(benchmark, scenario):
    with pytest.raises(ValueError, match="quickstart_0007: is a sequence, not a benchmark of several"):
        export_benchmark(scenario, benchmark / "quickstart_0007", BARE, sequences=1)
    with pytest.raises(ValueError, match="made"):
        BARE(benchmark)


def test_unknown_files_are_refused(tmp_path):
    with pytest.raises(ValueError, match="--also: unknown heat; expected any of depth, ids, parts, coco"):
        ExportPlan(tmp_path / "x", also=frozenset({"heat"}))
