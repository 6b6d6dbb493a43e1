"""Readers of files, each with a small valid file to mutate.

Helpers of other tests write the formats that the package only reads; :mod:`.reader_fuzzing` adds their folders to the
path of modules.
"""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from fakes import made_up
from made_study import make_study
from onnx_graphs import Graph
from pair_of_cameras import RIG
from test_mocap_asf import AMC, ASF
from test_mocap_bvh import BVH
from test_people_readers import cells, tracks, write_c3d, write_mat, write_trc
from test_store import make_record

from mvpose.files.atomic_files import MANIFEST, atomic_folder, check_replaceable
from mvpose.formats.calibration import easymocap, opencv, panoptic, pose2sim, voxelpose
from mvpose.formats.calibration.calibration_formats import read_calibration
from mvpose.formats.detections.recorded_frames import read_frames
from mvpose.formats.people import FORMATS, PeopleFiles, write_people
from mvpose.networks import Session
from mvpose.recording import People
from mvpose.skeleton import PANOPTIC19
from simharness.detector.descriptors import DescriptorModel
from simharness.gate.baseline import KEPT, Measurement, read_baseline, write_baseline
from simharness.gate.trial_command import TrialKey
from simharness.reality.recording_file import read_keys
from simharness.scenario.load import load, load_study
from simharness.scenario.presets import read_profile
from simharness.scenario.sections.people_section import MocapSection, PeopleSection
from simharness.scenario.sections.scenario import Scenario
from simharness.study.study_folder import Tables, read_study, write_study
from simharness.study.trial_store import Entry, Store
from simharness.trial.run_folder import read_run, write_run
from simharness.world.motion.mocap import load_people
from simharness.world.motion.mocap.asf import read_amc, read_asf
from simharness.world.motion.mocap.bvh import read_bvh

TESTS = Path(__file__).parents[2]
IDENTITY = "ab" * 16
_ROOT = TESTS.parent
_REID = _ROOT / "mvpose" / "networks" / "data"


@dataclass(frozen=True)
class ReaderCase:
    """A reader and a valid file.

    Attributes:
        file: the file that is mutated, within a folder.
        make: writer of this file, and of those that the reader takes beside it, into an empty folder.
        read: the reader, given the folder.
    """

    file: str
    make: Callable[[Path], object]
    read: Callable[[Path], object]


def results(folder):
    """A folder of results of the command "fuzz", with its manifest."""
    with atomic_folder(folder, "fuzz") as partial:
        (partial / "poses.json").write_text("{}")


def calibration(file, write):
    return ReaderCase(file, write, lambda folder: read_calibration(folder / file, size=(640, 480)))


def write_detections(folder, kind):
    person = np.c_[np.arange(25.0), np.arange(25.0), np.full(25, 0.5)].ravel().tolist()
    for camera in ("a", "b"):
        if kind == "mmpose":
            instance = {"keypoints": np.ones((17, 2)).tolist(), "keypoint_scores": [0.5] * 17, "bbox": [[1, 2, 30, 40]]}
            frames = [{"frame_id": 0, "instances": [instance, instance]}]
            (folder / f"{camera}.json").write_text(json.dumps(frames))
        elif kind == "rtmlib":
            np.savez(folder / f"{camera}.npz", keypoints=np.ones((2, 3, 17, 2)), scores=np.full((2, 3, 17), 0.5))
        elif kind == "openpose":
            (folder / camera).mkdir()
            (folder / camera / "0.json").write_text(
                json.dumps({"version": 1.3, "people": [{"pose_keypoints_2d": person}] * 2})
            )
        else:
            entry = {"image_id": 0, "keypoints": person[:51], "score": 0.5, "bbox": [1.0, 2.0, 30.0, 40.0]}
            (folder / f"{camera}.json").write_text(json.dumps([entry, entry]))


def detections(file, kind):
    return ReaderCase(
        file,
        lambda folder: write_detections(folder, kind),
        lambda folder: read_frames(("a", "b"), folder, np.array([0])),
    )


def joints(kind, file, write):
    path = "." if kind == "panoptic" else file
    return ReaderCase(file, write, lambda folder: FORMATS[kind].read(PeopleFiles((folder / path,), rate=25.0)))


def write_panoptic_people(folder):
    joints = np.random.default_rng(0).normal(size=(1, 2, 19, 3))
    (file,) = write_people(People([0.0], [0, 1], joints, skeleton=PANOPTIC19), folder, formats=["panoptic"])
    file.rename(folder / file.name)


def write_standing(folder):
    from_person = np.zeros((3, 1, 17, 3))
    from_person[..., 5, :], from_person[..., 6, :] = (0, 0.2, 1.4), (0, -0.2, 1.4)
    from_person[..., 11, :], from_person[..., 12, :] = (0, 0.1, 0.9), (0, -0.1, 0.9)
    write_people(People(np.arange(3) / 25.0, [0], from_person), folder, formats=("npz", "json", "csv", "parquet"))


def write_acclaim(folder):
    (folder / "a.asf").write_text(ASF)
    (folder / "a.amc").write_text(AMC)


def read_acclaim(folder):
    return read_amc(folder / "a.amc", read_asf(folder / "a.asf")).pose()


def written(file, text, read):
    return ReaderCase(file, lambda folder: (folder / file).write_text(text), lambda folder: read(folder / file))


def baseline(folder):
    scores = {
        TrialKey("a", seed, variant): dict.fromkeys(KEPT, 1.5) for seed in range(3) for variant in ("full", "fast")
    }
    write_baseline(Measurement("ci", "0123456789", "0.2.0", "x86", scores), folder / "ci.json")


def store(folder):
    opened = Store(folder / "store")
    opened.write(IDENTITY, Entry(IDENTITY, "full", made_up(Scenario(name="x"), "full"), 1.5, b"estimates"))
    opened.write_detections(IDENTITY, b"detections")
    opened.write_failure(IDENTITY, {"error": "no room"})


def read_store(folder):
    opened = Store(folder / "store")
    return opened.state(IDENTITY), opened.read_detections(IDENTITY), opened.failure(IDENTITY), list(opened)


def stored(file):
    return ReaderCase(f"store/{file}", store, read_store)


def study(folder):
    made = make_study(folder)
    write_study(folder, made.info, Tables(made.trials, made.frames, made.people, made.failures), "name = 'x'\n")


def read_trials(folder):
    results = read_study(folder)
    return results.scenario_of(results.trials["trial"][0])


def network(folder, card="{}"):
    graph = Graph([None, 3, 8, 4])
    graph.add("GlobalAveragePool")
    graph.add("Flatten")
    graph.output("descriptor", [None, 3])
    graph.save(folder / "net.onnx")
    if card:
        (folder / "net.json").write_text(card)


def measured_network(folder):
    network(folder, json.dumps({"distances": json.loads((_REID / "reid.json").read_text())["distances"]}))


def described(folder):
    return DescriptorModel.of_network(folder / "net.onnx")


SCENARIO = (_ROOT / "scenarios" / "shelf.toml").read_text()
STUDY = (_ROOT / "scenarios" / "views.toml").read_text().replace(
    "quickstart", "base"
) + "\n[cases.a]\n[cases.b]\npeople.count = 3\n"
PROFILE = (_ROOT / "scenarios" / "detectors" / "poor.toml").read_text()
RIG_FILE = (_ROOT / "scenarios" / "rigs" / "ring5.toml").read_text()
RECORDING = (_ROOT / "scenarios" / "recordings" / "shelf.toml").read_text()


def write_study_file(folder):
    (folder / "base.toml").write_text((_ROOT / "scenarios" / "quickstart.toml").read_text())
    (folder / "x.toml").write_text(STUDY)


def write_rig(folder):
    (folder / "mine.toml").write_text(RIG_FILE)
    (folder / "x.toml").write_text('name = "x"\n[cameras]\nrig = "mine.toml"\n')


CASES = {
    "Panoptic calibration": calibration("c.json", lambda folder: panoptic.write_calibration(folder / "c.json", RIG)),
    "VoxelPose calibration": calibration("c.json", lambda folder: voxelpose.write_calibration(folder / "c.json", RIG)),
    "EasyMocap intri.yml": calibration("intri.yml", lambda folder: easymocap.write_calibration(folder, RIG)),
    "EasyMocap extri.yml": ReaderCase(
        "extri.yml",
        lambda folder: easymocap.write_calibration(folder, RIG),
        lambda folder: read_calibration(folder / "intri.yml", size=(640, 480)),
    ),
    "OpenCV YAML": calibration("c.yml", lambda folder: opencv.write_calibration(folder / "c.yml", RIG)),
    "OpenCV XML": calibration("c.xml", lambda folder: opencv.write_calibration(folder / "c.xml", RIG)),
    "Pose2Sim TOML": calibration("c.toml", lambda folder: pose2sim.write_calibration(folder / "c.toml", RIG)),
    "OpenPose people": detections("b/0.json", "openpose"),
    "COCO results": detections("b.json", "coco"),
    "MMPose predictions": detections("b.json", "mmpose"),
    "RTMLib arrays": detections("b.npz", "rtmlib"),
    "MATLAB truth": joints(
        "actors-mat",
        "gt.mat",
        lambda folder: write_mat(folder / "gt.mat", *(cells(*tracks(4, 2, 14)[:, actor]) for actor in range(2))),
    ),
    "Panoptic people": joints("panoptic", "body3DScene_00000000.json", write_panoptic_people),
    "TRC markers": joints("trc", "a.trc", lambda folder: write_trc(folder / "a.trc", tracks()[:, 0])),
    "C3D markers": joints("c3d", "a.c3d", lambda folder: write_c3d(folder / "a.c3d", tracks()[:, 0])),
    "NumPy people": joints("npz", "people.npz", write_standing),
    "JSON people": joints("json", "people.json", write_standing),
    "CSV people": joints("csv", "poses.csv", write_standing),
    "Parquet people": joints("parquet", "poses.parquet", write_standing),
    "people to re-enact": ReaderCase(
        "people.npz",
        write_standing,
        lambda folder: load_people(PeopleSection(count=1, motion=MocapSection(file=str(folder / "people.npz")))),
    ),
    "BVH motion": written("a.bvh", BVH, lambda path: read_bvh(path).pose()),
    "AMC motion": ReaderCase("a.amc", write_acclaim, read_acclaim),
    "ASF skeleton": ReaderCase("a.asf", write_acclaim, read_acclaim),
    "scenario": written("x.toml", SCENARIO, load),
    "study": ReaderCase("x.toml", write_study_file, lambda folder: load_study(folder / "x.toml")),
    "detector profile": written("x.toml", PROFILE, lambda path: read_profile(str(path))),
    "rig": ReaderCase("mine.toml", write_rig, lambda folder: load(folder / "x.toml")),
    "recording": written("x.toml", RECORDING, read_keys),
    "baseline": ReaderCase("ci.json", baseline, lambda folder: read_baseline(folder / "ci.json")),
    "store": stored("store.json"),
    "store entry": stored(f"{IDENTITY[:2]}/{IDENTITY}.trial"),
    "store detections": stored(f"{IDENTITY[:2]}/{IDENTITY}.detections"),
    "store failure": stored(f"{IDENTITY[:2]}/{IDENTITY}.failed.json"),
    "study.json": ReaderCase("study.json", study, read_trials),
    "study table": ReaderCase("trials.parquet", study, read_trials),
    "run summary": ReaderCase("summary.json", lambda folder: write_run(make_record(people=2), folder), read_run),
    "run estimates": ReaderCase("estimates.npz", lambda folder: write_run(make_record(people=2), folder), read_run),
    "run timings": ReaderCase("timings.parquet", lambda folder: write_run(make_record(people=2), folder), read_run),
    "manifest of results": ReaderCase(MANIFEST, results, lambda folder: check_replaceable(folder, "fuzz")),
    "network card": ReaderCase("net.json", network, lambda folder: Session(folder / "net.onnx")),
    "network distances": ReaderCase("net.json", measured_network, described),
    "ONNX network": ReaderCase(
        "net.onnx", lambda folder: network(folder, ""), lambda folder: Session(folder / "net.onnx")
    ),
}
"""Readers by name."""
