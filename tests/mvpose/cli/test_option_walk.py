"""Every option of every command changes what the command does, is refused, or says that it has no effect."""

import webbrowser
from dataclasses import replace

import numpy as np
import pytest
from lab_files import WALKERS, filmed, write_coco, write_openpose
from onnx_graphs import picture
from option_walk import Row, Walk, parameters
from scipy.spatial.transform import Rotation
from test_detect_command import SIZE, networks, write_folder  # noqa: F401

from mvpose import Rig
from mvpose.cli import video_detection
from mvpose.cli.app import app
from mvpose.formats.calibration import pose2sim, voxelpose

BASES = {
    "estimate": "{lab}/Calib.toml {lab}/openpose --out {out} --fps 25 --method fast --no-page --no-doctor",
    "calibrate": "{lab}/moving --intrinsics {lab}/Calib.toml --out {out}/new.toml --fps 10",
    "doctor": "{lab}/Calib.toml {lab}/openpose",
    "repair": "{lab}/Calib.toml {lab}/openpose --out {out}/new.toml --mend inverted@cam0",
    "detect": "{lab}/pictures/cam0 --out {out} --detector {detector} --pose {pose}",
    "run": "{lab}/Small.toml {lab}/pictures --out {out} --detector {detector} --pose {pose} --method fast --no-page "
    "--no-doctor --trust",
    "view": "{lab}/seen --no-browser",
    "batch": "{lab}/project.toml",
}
"""Words that come first."""

FILMED = "{lab}/Small.toml {lab}/small --out {out} --method fast --no-doctor"
READ = {
    "times": Row("--times {lab}/times.csv"),
    "size": Row("--size 1282x962", base="{lab}/unsized.json {lab}/openpose"),
    "cameras": Row("--cameras cam0,cam1,cam3"),
    "frames": Row("--frames 2:10"),
    "sync": Row("--sync"),
    "rates": Row("--rates 25,25,25,50"),
    "skeleton": Row("--skeleton body25b"),
    "unit": Row("--unit cm"),
    "up": Row("--up y"),
}
RESULTS = {
    "out": Row("--out {out}/further"),
    "method": Row("--method track-fast"),
    "formats": Row("--format csv"),
    "files_up": Row("--files-up z"),
    "together": Row("--together", "--format c3d"),
    "lag": Row("--lag 0", "--method track"),
    "page": Row("--page"),
    "films": Row("--no-films", "--page"),
    "doctor": Row("--doctor"),
    "max_error": Row("--max-error 0.004"),
    "max_speed": Row("--max-speed 0.5", "--method track-fast"),
    "filter": Row("--filter butterworth:3", "--method track-fast"),
    "min_frames": Row("--min-frames 12", "--method track-fast"),
}
ROWS = {
    "estimate": READ
    | RESULTS
    | {
        "times": Row(
            "--times {lab}/times.csv",
            base="{lab}/Calib.toml {lab}/openpose --out {out} --method fast --no-page --no-doctor",
        ),
        "size": Row("--size 1282x962", base="{lab}/unsized.json {lab}/openpose --out {out} --method fast --no-doctor"),
        "fps": Row("--fps 50"),
        "joints": Row("--joints all"),
        "pictures": Row("--pictures {lab}/pictures", "--no-films", FILMED),
        "films": Row("--no-films", "--pictures {lab}/pictures", FILMED),
        "trust": Row("--trust", base="{lab}/Calib.toml {lab}/openpose --out {out} --up y --no-page --no-doctor"),
    },
    "calibrate": {
        "intrinsics": Row("--intrinsics {lab}/Small.toml"),
        "out": Row("--out {out}/other.toml"),
        "stature": Row("--stature 1.8"),
        "distance": Row("--distance cam0,cam1,3.5"),
        "fps": Row("--fps 11"),
        "times": READ["times"],
        "size": Row("--size 1282x962"),
        "cameras": READ["cameras"],
        "frames": Row("--frames 2:55"),
        "skeleton": READ["skeleton"],
    },
    "doctor": READ | {"as_json": Row("--json"), "out": Row("--out {out}"), "fps": Row("--fps 50")},
    "repair": READ
    | {
        "size": Row("--size 1282x962"),
        "out": Row("--out {out}/other.toml"),
        "mend": Row("--mend unit:0.001"),
        "free": Row("--free focal"),
        "new_times": Row("--new-times {out}/times.csv"),
        "rig_size": Row("--rig-size people"),
        "fps": Row("--fps 50", "--new-times {out}/times.csv"),
        "times": Row("--times {lab}/times.csv", "--new-times {out}/times.csv"),
    },
    "detect": {
        "out": Row("--out {out}/further"),
        "detector": Row("--detector {lab}/Calib.toml"),
        "pose": Row("--pose {lab}/Calib.toml"),
        "detector_kind": Row("--detector-kind yolox"),
        "min_score": Row("--min-score 0.95"),
        "provider": Row("--provider cuda"),
    },
    "view": {"browser": Row("--browser")},
    "batch": {"out": Row("--out {out}")},
}
ROWS["run"] = (
    ROWS["detect"] | {key: READ[key] for key in ("cameras", "frames", "up", "sync", "rates")} | {"fps": Row("--fps 50")}
)
ROWS["run"] |= {"page": RESULTS["page"], "films": RESULTS["films"], "formats": RESULTS["formats"]}
"""Options by command and name of the parameter; ``threads`` and ``package`` have tests of their own."""

PLAIN = f"estimate {BASES['estimate']}"
NO_EFFECT = [
    (PLAIN, "--lag inf"),
    (PLAIN, "--max-speed 3"),
    (PLAIN, "--min-frames 7"),
    (PLAIN, "--filter spline"),
    (f"estimate {FILMED} --no-page", "--pictures {lab}/pictures"),
    (PLAIN, "--no-films"),
    (f"estimate {FILMED}", "--no-films"),
    (f"{PLAIN} --format trc", "--together"),
    (f"{PLAIN} --format csv,lengths", "--files-up z"),
    (PLAIN, "--size 1280x960"),
    (PLAIN, "--trust"),
    (PLAIN.replace("openpose", "coco"), "--joints all"),
    (f"repair {BASES['repair']}", "--up y"),
    (f"repair {BASES['repair']}", "--frames 2:10"),
]
"""Combinations in which an option has nothing to act on."""


@pytest.fixture(scope="module")
def walk(tmp_path_factory, networks):  # noqa: F811
    """Two people in 12 frames, one of them in the first six, as files of all kinds."""
    lab = tmp_path_factory.mktemp("walk")
    rig, _, pixels = filmed()
    pixels[6:, :, 1] = np.nan
    names = [camera.name for camera in rig]
    pose2sim.write_calibration(lab / "Calib.toml", rig)
    voxelpose.write_calibration(lab / "unsized.json", rig)
    write_openpose(lab / "openpose", names, pixels)
    turns = Rotation.from_rotvec(np.linspace(0.0, 6.0, 60)[:, None] * [0.0, 0.0, 1.0]).as_matrix()
    around = rig.project(WALKERS[None] @ turns[:, None]).swapaxes(0, 1)
    write_openpose(lab / "moving", names, around + np.random.default_rng(1).standard_normal(around.shape))
    write_openpose(lab / "small", names, 0.25 * pixels[:6])
    write_coco(lab / "coco", names, filmed()[2])
    (lab / "times.csv").write_text("".join(f"{k / 30 + (0.004 if k % 2 else 0.0)}\n" for k in range(12)))
    quarter = np.array([[0.25, 1, 0.25], [1, 0.25, 0.25], [1, 1, 1]])
    small = Rig([replace(camera, K=camera.K * quarter, size=SIZE) for camera in rig])
    pose2sim.write_calibration(lab / "Small.toml", small)
    for camera in small:
        seen = [camera.project(np.array([0.1 * k, 0.0, 1.0])) for k in range(6)]
        write_folder(lab / "pictures" / camera.name, [picture(SIZE, (*each, 4.0, (220, 220, 220))) for each in seen])
    project = 'calibration = "Calib.toml"\nmethod = "fast"\npage = false\ndoctor = false\nout = "first"\n'
    (lab / "project.toml").write_text(project + '[trials.walk]\ndetections = "openpose"\n')
    (lab / "seen").mkdir()
    (lab / "seen" / "recording.html").write_text("<html></html>")
    detector, pose = networks
    return Walk(app, lab / "results", {"lab": lab, "detector": detector, "pose": pose})


def test_every_option_of_every_command_has_a_row():
    known = {command: set(rows) for command, rows in ROWS.items()}
    for command in ("detect", "run"):
        known[command].add("threads")
    known |= {"networks get": {"package"}, "networks list": set(), "networks show": set()}
    found = {command: set(options) for command, options in parameters(app).items()}
    known["run"] |= found["run"] & set(ROWS["estimate"])  # one function takes them from both
    assert found == known


@pytest.mark.parametrize(
    ("command", "name"),
    [
        pytest.param(command, name, marks=[pytest.mark.slow] if command == "calibrate" and name != "stature" else [])
        for command, rows in ROWS.items()
        for name in rows
    ],
)
def test_an_option_changes_the_result_or_is_refused(walk, command, name, monkeypatch):
    opened = []
    monkeypatch.setattr(webbrowser, "open", lambda url: print(f"opened {opened.append(url)}"))
    row = ROWS[command][name]
    base = f"{command} {row.base or BASES[command]} {row.beside}".strip()
    assert walk.run(base).code == (2 if name == "trust" else 0), walk.run(base).told
    assert walk.effect(base, row.words) in ("changes", "refused", "says"), walk.run(f"{base} {row.words}")


@pytest.mark.slow
@pytest.mark.parametrize(("base", "option"), NO_EFFECT)
def test_an_option_without_effect_says_so(walk, base, option):
    assert walk.effect(base, option) == "says"
    assert f"{option.split()[0]} has no effect: " in walk.run(f"{base} {option}").told
    assert walk.run(base).files == walk.run(f"{base} {option}").files


def test_threads_are_those_of_the_detection(walk, monkeypatch):
    counts = []
    real = video_detection.detect_videos

    def recorded(*words, workers, **options):
        counts.append(workers)
        return real(*words, workers=workers, **options)

    monkeypatch.setattr(video_detection, "detect_videos", recorded)
    assert walk.run(f"detect {BASES['detect']} --threads 3").code == 0
    assert counts == [3]


def test_a_package_that_is_none_is_refused(walk, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    refused = walk.run("networks get movenet --package {lab}/Calib.toml")
    assert refused.code in (2, 3)
    assert "Calib.toml" in refused.told
