"""Commands that the pages of the documentation may have, and what makes each cheap to run."""

from __future__ import annotations

# What each simharness command gets in addition, to be cheap; the last of an option given twice counts.
SMALL_SCENE = "--set people.count=2 --set duration=0.4 --set rate=5"
# Most of the time of a picture goes into the light of its room: there is less outside of one.
FASTEST = (
    "--set duration=0.4 --set rate=5 --set cameras.size=[160,120] --set rendering.renderer=rays --set room.walls=false"
)
ONE_WORKER = f"{FASTEST} --workers 1"
RAYS = f"{FASTEST} --set people.count=2 --set cameras.count=3"
PICTURES = f"{SMALL_SCENE} --set cameras.count=2 --set cameras.size=[160,120] --set clutter.shelves=0"
LAB = f"{RAYS} --set sweep.cameras.height=[1.7] --set sweep.people.count=[2] --variant fast --workers 1"
ALONE = {
    "simharness blame quickstart --seeds 10 --workers 2": f"{RAYS} --seeds 1 --workers 1 --cause swaps --cause noise",
    "simharness run quickstart": RAYS,
    "simharness run quickstart --set detector.skeleton=halpe26": RAYS,
    "simharness run quickstart --set people.count=6 --set cameras.count=3 --seed 1 --workers 2": ONE_WORKER,
    "simharness export gathering benchmark": f"{PICTURES} --every 2",
    "simharness export gathering many --sequences 20 --workers 2 --also depth,ids,coco": (
        f"{PICTURES} --every 2 --sequences 2 --workers 1"
    ),
    "simharness render gathering --video --overlay truth,detections,estimates": PICTURES,
    "simharness render gathering --set sensor.profile=webcam --set sensor.jpeg=60": PICTURES,
    "simharness run passage": RAYS,
    "simharness mjcf quickstart": SMALL_SCENE,
    "simharness shrink quickstart --set people.count=6 --set detector.profile=crowded --seed 3": f"{FASTEST} --frame 0",
    "simharness scenarios": "",
    "simharness schema": "",
    "simharness show FILE": "",
    "simharness show passage": "",
    "simharness show quickstart": "",
}
# Commands that read a file of the user, which the test makes.
USER_FILES = {
    "clip.bvh": ("simharness run quickstart --set 'people.activities=[\"mocap\"]' --set people.motion.file=clip.bvh"),
    "calibration.json": (
        "simharness run quickstart --set cameras.layout=file --set cameras.file=calibration.json "
        "--set 'cameras.size=[1032,776]'"
    ),
    "night.toml": "simharness run quickstart --set detector.profile=night.toml",
}
NAMES = (  # mentioned
    "simharness blame",
    "simharness check",
    "simharness check FOLDER",  # tests/simharness/hunt/test_shipped_failures.py
    "simharness export",
    "simharness fit-detector",
    "simharness score",
    "simharness hunt my-room.toml --budget 30m",  # tests/simharness/hunt/test_hunt_run.py
    "simharness shrink results/failures/NAME.toml",  # tests/simharness/hunt/test_kept_failure.py
)
CHECKS = ("simharness check ci --workers 2", "simharness check ci --workers 2 --junit junit.xml --summary summary.md")
CHECK_OF_TRACKING = "simharness check ci_tracking --workers 2"
CHECK_OF_REPAIR = "simharness check ci_repair --workers 2"
SHELF = (
    "simharness evaluate shelf FOLDER",
    "simharness fit-detector shelf FOLDER --out fitted.toml",
    "simharness validate shelf FOLDER",
    "simharness validate shelf FOLDER --rival results/validation/OTHER/validation.json",
)
OWN_RECORDING = "simharness evaluate hall.toml"
FROM_PICTURES = (  # run by tests/benchmarks/pictures and tests/simharness/reality/test_people_evaluation.py
    "cd benchmark/gathering",
    "mvpose run calibration_believed_gathering.json hdImgs --fps 10 --out people",
    "simharness evaluate poses . people",
    "simharness evaluate poses RECORDING RESULTS",
)
OWN_STUDY = {
    "simharness study my-lab.toml --workers 2": f"{LAB} --seeds 1",
    "simharness study my-lab.toml --seeds 40": f"{LAB} --seeds 2",
}
FIGURES = "simharness report STUDY --figures FOLDER"  # tests/simharness/test_cli_outputs.py
OWN_GATE = (
    "simharness check my-ci.toml --baseline my-ci.json --update-baseline",
    "simharness check my-ci.toml --baseline my-ci.json",
)
IN_PARTS = {
    "simharness study my-lab.toml --shard 1/3 --store part1": f"{LAB} --seeds 2",
    "simharness merge part1 part2 part3 --into results/studies/store": "",
    "simharness study my-lab.toml": f"{LAB} --seeds 2",
}
READ_BY_A_NETWORK = {
    "simharness run pixels": "--set duration=0.4 --set rate=5 --set cameras.count=3",
    "simharness study sensor": "--set duration=0.2 --set rate=5 --set cameras.count=2 --set cameras.size=[320,240] "
    "--set 'sweep={one_at_a_time=true, sensor={jpeg=[92,5]}}' --seeds 1 --variant fast --workers 1",
}
REHEARSE = (  # run by tests/simharness/planning
    "simharness rehearse",
    "simharness rehearse ring5 --volume 6x6 --people 4",
    "simharness rehearse my-rig.toml --room my-room.toml --people 6 --subsets",
)
PLAN = (  # run by tests/simharness/planning
    "simharness plan",
    "simharness plan lab --cameras 5",
    "simharness plan lab --preview",
    "simharness plan my-room.toml --cameras 6 --lens wide --failing 1 --workers 2",
    "simharness rehearse results/plans/lab/planned.toml --room lab",
)
MAKE = (
    "make demo",
    "make test",
    "make test-slow",
    "make docs",
    "make lint",
    "make lint docs",
    "make results",
    "make wheels",
)
CI = ".ci/run"
PYTEST = ('pytest -m "not slow"', "pytest tests/simharness/detector")
MVPOSE = (  # run by tests/mvpose/cli
    "mvpose estimate CALIBRATION DETECTIONS --out people",
    "mvpose estimate CALIBRATION DETECTIONS --sync --out people",
    "mvpose estimate CALIBRATION DETECTIONS --format trc,opensim,mot,angles --out people",
    "opensim-cmd run-tool person_3_scale.xml",  # tests/mvpose/formats/test_opensim_files.py
    "opensim-cmd run-tool person_3_ik.xml",
    "mvpose doctor CALIBRATION DETECTIONS",
    "mvpose calibrate DETECTIONS --intrinsics FILE --out CALIBRATION",
    "mvpose repair CALIBRATION DETECTIONS --out NEW",
    "mvpose repair CALIBRATION DETECTIONS --mend inverted --mend unit:0.001@cam2 --free extrinsics "
    "--out mended/Calib.toml",
    "mvpose networks get movenet",
    "mvpose run CALIBRATION VIDEO... --out people",
    "mvpose run CALIBRATION VIDEO... --detector det.onnx --pose pose.onnx --out people",
    "mvpose batch PROJECT",
    "mvpose view people",
)
SHELL = (". .venv/bin/activate",)
MODULES = tuple(
    f"python -m {name}"
    for name in (
        "benchmarks.doctor",
        "benchmarks.doctor.breaks",
        "benchmarks.expected_error",
        "benchmarks.hunt",
        "benchmarks.method",
        "benchmarks.pictures",
        "benchmarks.simulator",
        "benchmarks.starts",
        "benchmarks.tracking",
        "benchmarks.tracking.reappearance",
        "benchmarks.planted_bugs",
        "benchmarks.mutation",
        "benchmarks.whole_body",
        "tools.page_pictures",
        "tools.reid",
    )
)
PROFILE = "python -m tools.network_profile movenet"  # tests/tools/network_profile
PROFILE_CHECK = "python -m benchmarks.network_profile movenet FOLDER"  # half an hour; tests/benchmarks/network_profile
FORECASTS = "python -m benchmarks.planning.blind_forecasts FOLDER --shelf SHELF"  # half an hour; data of Shelf
ON_SHELF = "python -m benchmarks.tracking --shelf FOLDER"  # tests/benchmarks/tracking/test_shelf_losses.py
COVERAGE = (  # tests/benchmarks/test_coverage_bins.py
    "python -m benchmarks.hunt.coverage ci --seeds 2 --recording shelf --files FOLDER"
)
POWER = "python -m benchmarks.validation FOLDER"  # half an hour, and the data of Shelf; test_wrong_twins.py
CALIBRATED = "python -m benchmarks.from_people --peer PROGRAM"  # tests/benchmarks/test_from_people_benchmark.py
LOOP = "python -m benchmarks.fit FOLDER"  # half an hour; tests/benchmarks/fit/test_closed_loop.py
OUT_OF_SAMPLE = "python -m benchmarks.fit FOLDER --out-of-sample"  # tests/benchmarks/fit/test_closed_loop.py
# tests/simharness/outputs/benchmark/test_submission.py
SCORED = ("simharness score SUBMISSION many/gathering", "simharness score FILE benchmark/gathering")
SEED_SCORES = "python -m tools.paper_tables.seed_scores"  # tests/tools/test_seed_scores.py
LEADERBOARD = (
    "python -m benchmarks.leaderboard FOLDER --shelf SHELF"  # a quarter of an hour; tests/benchmarks/leaderboard
)
DIGEST = "python -m tools.study_digest STUDY FOLDER"  # tests/tools/test_study_digest.py
GALLERY = "python -m tools.gallery results/gallery"  # tests/tools/test_gallery.py; minutes of rendering
# Without arguments these begin to bake the body.
BAKE = ("python -m tools.body.bake", "python -m tools.body.hands_and_feet")
KNOWN = {
    FIGURES,
    *ALONE,
    *USER_FILES.values(),
    *NAMES,
    *REHEARSE,
    *PLAN,
    *CHECKS,
    CHECK_OF_TRACKING,
    CHECK_OF_REPAIR,
    *SHELF,
    OWN_RECORDING,
    *FROM_PICTURES,
    *READ_BY_A_NETWORK,
    *OWN_STUDY,
    *OWN_GATE,
    *IN_PARTS,
    *MAKE,
    *MODULES,
    FORECASTS,
    PROFILE,
    PROFILE_CHECK,
    ON_SHELF,
    COVERAGE,
    POWER,
    CALIBRATED,
    LOOP,
    OUT_OF_SAMPLE,
    LEADERBOARD,
    *BAKE,
    DIGEST,
    GALLERY,
    SEED_SCORES,
    *SCORED,
    CI,
    *PYTEST,
    *SHELL,
    *MVPOSE,
}
