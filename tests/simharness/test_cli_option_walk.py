"""Every option of every command of ``simharness`` changes what the command does, is refused, or says so.

Commands that simulate for minutes run up to the function that does it, which prints what it is called with.
"""

import importlib
import pkgutil
import re
import sys
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import typer
from option_walk import Row, Walk, parameters

sys.path.append(str(Path(__file__).parent / "outputs"))
sys.path.append(str(Path(__file__).parent / "reality"))
from described_recording import describe
from made_study import make_study
from turning_people import joints_of, walkers

import simharness
from mvpose.formats.calibration.voxelpose import write_calibration
from mvpose.formats.people.people_formats import write_people
from mvpose.recording import People
from simharness.capture.rendering import room_light
from simharness.cli import app
from simharness.gate.baseline import Measurement
from simharness.gate.compare import Comparison, GateResult
from simharness.gate.trial_command import TrialKey
from simharness.outputs.benchmark.submission import Submission
from simharness.reality.validation.validation import SimulatedTwins
from simharness.scenario.sections.gate_section import GateSection
from simharness.scoring.catalogue import SCORES
from simharness.statistics.intervals import mean_interval
from simharness.study.causes.cause_shares import Blame
from simharness.study.study_folder import Tables, read_study, write_study
from simharness.study.trial_store import Store

TINY = """
extends = "quickstart"
name = "tiny"
duration = 0.2
rate = 10.0
variants = ["fast"]
room.walls = false
[people]
count = 1
[rendering]
renderer = "rays"
[cameras]
count = 3
size = [96, 72]
[clutter]
boxes = 0
shelves = 0
"""
RESULT = {"set": Row("--set people.count=2"), "seed": Row("--seed 3"), "out": Row("--out {out}/other")}
OVERRIDES = {"overrides": RESULT["set"], "seed": RESULT["seed"]}
RUN = OVERRIDES | {"out": RESULT["out"]}
JSON = {"json_file": Row("--json {out}/all.json")}
WORKERS = {"workers": Row("--workers 3")}

BASES = {
    "run": "{lab}/tiny.toml --out {out}",
    "render": "{lab}/tiny.toml --out {out}",
    "export": "{lab}/tiny.toml {out}",
    "show": "{lab}/tiny.toml",
    "schema": "",
    "mjcf": "{lab}/tiny.toml --out {out}",
    "check": "ci --baseline {lab}/base.json",
    "blame": "{lab}/tiny.toml",
    "hunt": "{lab}/tiny.toml --out {out}",
    "shrink": "{lab}/wrong.toml --out {out}",
    "report": "{lab}/study",
    "study": "{lab}/tiny.toml --out {out}",
    "merge": "{lab}/store --into {out}",
    "fit-detector": "{lab}/hall.toml",
    "validate": "{lab}/hall.toml --out {out}",
    "rehearse": "ring5 --out {out}",
    "plan": "lab --out {out}",
    "evaluate recording": "{lab}/hall.toml",
    "evaluate poses": "{lab}/hall.toml {lab}/people",
    "score": "{lab}/people {lab}/benchmark",
}
"""Words that come first."""

PREVIEW = "--preview"
ROWS = {
    "run": RUN | WORKERS | {"blame": Row("--blame 2")},
    "render": RUN
    | {
        "video": Row("--video"),
        "overlay": Row("--overlay truth"),
        "also": Row("--also depth"),
        "every": Row("--every 2"),
    },
    "export": OVERRIDES
    | {
        "every": Row("--every 2", "--no-pictures"),
        "pictures": Row("--no-pictures"),
        "also": Row("--also depth,coco,visibility,heatmaps", "--no-pictures"),
        "sequences": Row("--sequences 2", "--no-pictures"),
        "workers": Row("--workers 2", "--sequences 2 --no-pictures"),
    },
    "show": OVERRIDES,
    "schema": {"out": Row("--out {out}/schema.json")},
    "mjcf": RUN,
    "check": WORKERS
    | {
        "baseline": Row("--baseline {lab}/other.json", base="ci --baseline {lab}/base.json"),
        "junit": Row("--junit {out}/report.xml"),
        "summary": Row("--summary {out}/report.md"),
        "update_baseline": Row("--update-baseline"),
        "accept_better": Row("--accept-better"),
    },
    "blame": OVERRIDES
    | WORKERS
    | JSON
    | {
        "seeds": Row("--seeds 3"),
        "variant": Row("--variant full"),
        "score": Row("--score recall"),
        "cause": Row("--cause noise"),
    },
    "hunt": WORKERS
    | {
        "overrides": RESULT["set"],
        "variant": Row("--variant no-3dps"),
        "property": Row("--property mirrored"),
        "rival": Row("--rival full --property disagree"),
        "trials": Row("--trials 3"),
        "budget": Row("--budget 1h"),
        "seed": Row("--seed 3"),
        "most": Row("--keep 3"),
        "out": RESULT["out"],
    },
    "shrink": RUN
    | {
        "frame": Row("--frame 1"),
        "variant": Row("--variant no-3dps"),
        "property": Row("--property mirrored"),
        "rival": Row("--rival full --property disagree"),
    },
    "report": {
        "out": Row("--out {out}/page.html"),
        "threshold": Row("--threshold pcp=80"),
        "blame": Row("--blame 2"),
        "figures": Row("--figures {out}/figures"),
    },
    "study": WORKERS
    | {
        "overrides": RESULT["set"],
        "seeds": Row("--seeds 3"),
        "variant": Row("--variant full"),
        "blame": Row("--blame 2"),
        "yes": Row("--yes", "--seeds 10001"),
        "scheduler": Row("--scheduler tcp://127.0.0.1:1"),
        "shard": Row("--shard 1/2"),
        "store": Row("--store {out}/elsewhere"),
        "out": RESULT["out"],
    },
    "merge": {"into": Row("--into {out}/other")},
    "fit-detector": JSON
    | {"out": Row("--out {out}/profile.toml"), "figure": Row("--figure {out}/errors.png")}
    | {"halves": Row("--halves")},
    "validate": WORKERS
    | JSON
    | {
        "twins": Row("--twins 3"),
        "quick": Row("--quick"),
        "fit_on": Row("--fit-on {lab}/other.toml"),
        "rival": Row("--rival {lab}/validation.json"),
        "split_half": Row("--split-half"),
        "out": RESULT["out"],
    },
    "rehearse": WORKERS
    | {
        "room": Row("--room lab"),
        "volume": Row("--volume 2x2"),
        "people": Row("--people 3"),
        "detector": Row("--detector poor"),
        "size": Row("--size 1033x776", base="{lab}/unsized.json --size 1032x776 --out {out}"),
        "subsets": Row("--subsets"),
        "scenes": Row("--scenes 3"),
        "seed": Row("--seed 3"),
        "out": RESULT["out"],
    },
    "plan": WORKERS
    | {
        "cameras": Row("--cameras 4"),
        "lens": Row("--lens wide"),
        "people": Row("--people 3"),
        "detector": Row("--detector poor"),
        "objective": Row("--objective worst"),
        "failing": Row("--failing 1"),
        "budget": Row("--budget 1800"),
        "scenes": Row("--scenes 2"),
        "seed": Row("--seed 3"),
        "preview": Row(PREVIEW),
        "out": RESULT["out"],
    },
    "evaluate recording": JSON
    | {"head": Row("--head 2019"), "method": Row("--method fast"), "lag": Row("--lag 0", "--method track-fast")},
    "evaluate poses": JSON | {"head": Row("--head 2019"), "first": Row("--first 1")},
    "score": JSON | {"split": Row("--split test")},
}
"""Options by command and name of the parameter."""

ROOM = f"plan {BASES['plan']} {PREVIEW}"
COMBINATIONS = [
    (f"rehearse {BASES['rehearse']} --room lab", "--people 3"),
    (f"rehearse {BASES['rehearse']} --room lab", "--detector poor"),
    (f"rehearse {BASES['rehearse']} --room lab", "--volume 2x2"),
    (f"validate {BASES['validate']} --quick", "--twins 3"),
    (f"render {BASES['render']} --video", "--overlay truth"),
    (f"render {BASES['render']} --video", "--also depth"),
    (f"study {BASES['study']} --blame 2", "--workers 3"),
    (f"study {BASES['study']} --shard 1/2", "--variant full"),
    (f"check {BASES['check']} --update-baseline", "--workers 3"),
    *(
        (ROOM, words)
        for words in ("--people 3", "--detector poor", "--objective worst", "--failing 1", "--budget 1800")
    ),
    *(
        (f"{command} {BASES[command]} --seed 3", "--set seed=1")
        for command in ("run", "render", "export", "show", "mjcf", "blame")
    ),
    (f"study {BASES['study']} --seeds 3", "--set seeds=2"),
    (f"study {BASES['study']} --variant fast", "--set method.variants=['full']"),
    (f"run {BASES['run']} --set people.count=3", "--set people.count=1"),
]
"""Combinations in which one option might be ignored."""

NO_EFFECT = [
    (f"study {BASES['study']}", "--yes"),
    (f"report {BASES['report'].replace('study', 'single')}", "--threshold pcp=80"),
    ("rehearse {lab}/three.toml --out {out}", "--subsets"),
    (f"plan {BASES['plan']} --scenes 0", "--workers 3"),
]
"""Combinations in which an option has nothing to act on."""


def _shown(value) -> str:
    return re.sub(r" at 0x[0-9a-f]+", "", repr(value))


def _stand_in(name: str, result):
    """Return a function that prints what it is called with, and returns ``result``; ends the command if it is None."""

    def called(*arguments, reporter=None, progress=None, **options):
        print(name, *map(_shown, arguments), _shown(options))
        if result is None:
            raise typer.Exit
        return result

    return called


def _stand_ins(study):
    """Return what stands in for the functions that take long, by module."""
    interval = mean_interval([1.0], unit="%")
    blame = Blame("tiny", "", "fast", "pcp", (0,), interval, interval, interval, (), None, ())
    key = TrialKey("", 0, "full")
    checked = GateResult("ci", ("full",), GateSection(), Comparison((), ()), (), 1, key, "simharness run", 1.0)
    validated = _Validated()
    rehearsed = SimpleNamespace(sentences=(), to_json=dict)
    scores = Measurement("ci", "", "", "", {TrialKey("base", 0, "full"): {}})
    measured = SimpleNamespace(failed=(), measurement=lambda suite: scores)
    figures = SimpleNamespace(summary=dict)
    fitted = SimpleNamespace(real=figures, calibrated=figures, annotation=figures)
    printed = ("plot_comparison", "print_agreement", "print_annotation", "print_measurement", "print_priors")
    submission = Submission({"a": dict.fromkeys(SCORES, 1.0)}, {"a": "test"})
    return {
        "simharness.outputs.run.result_folder": {"run": None},
        "simharness.hunt.hunt_run": {"run_hunt": None},
        "simharness.gate.suite": {"baseline_of": (), "check": checked, "run_suite": measured},
        "simharness.gate.baseline": {"write_baseline": ()},
        "simharness.study.causes.cause_shares": {"blame": blame},
        "simharness.outputs.study.curves": {"blame_study": blame},
        "simharness.study.causes.blame_text": {"write_blame": ()},
        "simharness.study.study_run": {"run_study": study, "run_shard": None},
        "simharness.outputs.study.page": {"write_report": "report.html"},
        "simharness.reality.detector_fit.fit": {"fit": fitted, "write_profile": ()},
        "simharness.reality.detector_fit.fit_table": dict.fromkeys(printed, ()),
        "simharness.reality.detector_fit.half_check": {"check_halves": figures},
        "simharness.outputs.benchmark.submission": {"score_submission": submission},
        "simharness.reality.twin": {"TwinModel.of_fit": (), "simulate_twins": ((),)},
        "simharness.reality.validation.validation": {
            "simulate_predictions": SimulatedTwins([], None), "validate": validated, "predict_halves": []
        },
        "simharness.outputs.validation.tables": {"distance_sentence": "", "cancelling_parts": []},
        "simharness.reality.validation.validation_summary": {"summarize_validation": {}, "summarize_halves": {}},
        "simharness.outputs.validation.page": {"render_validation": "<!doctype html>"},
        "simharness.planning.rehearse_rig": {"rehearse_rig": rehearsed},
        "simharness.outputs.planning.rehearsal_page": {"render_rehearsal": "<!doctype html>"},
        "simharness.planning.plan_rig": {"plan_rig": None},
        "simharness.trial.stages.networks": {"people_finder": ()},
    }  # fmt: skip


@dataclass(frozen=True)
class _Validated:
    """Validation without verdicts."""

    distance: None = None
    corrections: None = None
    verdicts: tuple = ()
    skills: tuple = ()
    failed: tuple = ()


@pytest.fixture(scope="session")
def lab(tmp_path_factory):
    """Scenario, studies, recordings, rigs and people that the commands read."""
    lab = tmp_path_factory.mktemp("walk")
    (lab / "tiny.toml").write_text(TINY)
    (lab / "wrong.toml").write_text(TINY + "[detector.keypoints]\ninversion = 0.6\n")
    recording = walkers(frames=3, cameras=3, noise=3.0)
    describe(recording, lab, name="hall")
    describe(recording, lab, name="other")
    (lab / "validation.json").write_text('{"dose": {}, "subsets": {}}')
    (lab / "three.toml").write_text("layout = 'ring'\ncount = 3\n")
    write_calibration(lab / "unsized.json", recording.rig)
    people = People(np.arange(3) / 25.0, [0, 1], joints_of(3, 2), numbers=np.arange(3))
    write_people(people, lab / "people", formats=("json",))
    for name, factors in (("study", None), ("single", {})):
        study = make_study(lab / name, factors=factors, variants=("full",), seeds=1, run=0, damaged=[])
        (lab / name).mkdir()
        tables = Tables(study.trials, study.frames, study.people, study.failures)
        write_study(lab / name, study.info, tables, "")
    Store(lab / "store")
    return lab


@pytest.fixture(scope="session")
def made_walk(lab):
    for module in pkgutil.walk_packages(simharness.__path__, "simharness."):  # one imported later would keep stand-ins
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)
    return Walk(app, lab / "results", {"lab": lab}, timed=r"(?s)Time per frame.*?PCP: part")


@pytest.fixture
def walk(made_walk, lab, monkeypatch):
    """The walk, with stand-ins for what takes long."""
    monkeypatch.chdir(lab)
    for module in ("simharness.trial.identity", "simharness.outputs.benchmark.layout"):
        monkeypatch.setattr(f"{module}.provenance", lambda **_: {})  # it has the duration
    for module, functions in _stand_ins(read_study(lab / "study")).items():
        for name, result in functions.items():
            monkeypatch.setattr(f"{module}.{name}", _stand_in(name, result))
    monkeypatch.setattr(room_light, "_computed", _once(room_light._computed, LIGHTS))
    return made_walk


def _once(light, kept):
    """Return a function that computes the light of a room, which takes most of the time of a picture, once."""

    def remembered(sources, topology, vertices, normals):
        key = repr(sources), vertices.tobytes()
        kept[key] = kept.get(key) or light(sources, topology, vertices, normals)
        return kept[key]

    return remembered


LIGHTS: dict = {}
CASES = [(command, name) for command, rows in ROWS.items() for name in rows]


def test_every_option_of_every_command_has_a_row():
    known = {command: set(rows) for command, rows in ROWS.items()} | {"scenarios": set()}
    assert {command: set(options) for command, options in parameters(app).items()} == known
    assert len(CASES) >= 106


@pytest.mark.slow
@pytest.mark.parametrize("command", BASES)
def test_a_command_repeats_itself(walk, command):
    words = f"{command} {BASES[command]}"
    assert walk.run(words) == walk.run(f"{words} ")


@pytest.mark.slow
@pytest.mark.parametrize(("command", "name"), CASES)
def test_an_option_changes_the_result_or_is_refused(walk, command, name):
    row = ROWS[command][name]
    base = f"{command} {row.base or BASES[command]} {row.beside}".strip()
    assert walk.run(base).code == (2 if name == "yes" else 0), walk.run(base).told
    assert walk.effect(base, row.words) in ("changes", "refused", "says"), walk.run(f"{base} {row.words}")


@pytest.mark.slow
@pytest.mark.parametrize(("base", "option"), COMBINATIONS)
def test_an_option_counts_beside_others(walk, base, option):
    assert walk.run(base).code == 0, walk.run(base).told
    assert walk.effect(base, option) in ("changes", "refused", "says"), walk.run(f"{base} {option}")


@pytest.mark.parametrize(("base", "option"), NO_EFFECT)
def test_an_option_without_effect_says_so(walk, base, option):
    assert walk.effect(base, option) == "says"
    assert f"{option.split()[0]} has no effect: " in walk.run(f"{base} {option}").told
