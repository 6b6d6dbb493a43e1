"""The paper's tables: numbers are those of the inputs and of the paper, and wrong inputs are refused."""

import json
import math
import re
import shlex
import sys
from itertools import pairwise

import numpy as np
import pytest
from typer.testing import CliRunner

from simharness.cli import app
from simharness.reality.evaluation import ABLATION
from simharness.trial.identity import PROVENANCE, provenance
from tools.paper_tables.__main__ import main
from tools.paper_tables.seed_scores import main as seed_scores
from tools.paper_tables.tables import COMPARISON, INPUTS, SEED_SCORES, VARIANTS, paper_tables, read_inputs, write_tables
from tools.paper_tables.text import markdown

ON_SHELF = [name for name in VARIANTS if name != "appearance"]
FILES = {"voxelpose": "voxelpose.json", "2019": "2019.json", "campus": "campus.json", "shelf": "shelf.json"}
OPTIONS = {"voxelpose": "--shelf", "2019": "--shelf-2019", "campus": "--campus-twin", "shelf": "--shelf-twin"}


def source(command, seeds):
    return provenance(command=command, seeds=seeds, variants=VARIANTS, seconds=700.0)


def recorded(head, rng):
    """Return a summary as ``evaluate shelf`` writes it, with random numbers."""
    actors = {name: rng.uniform(60, 90, 3).tolist() for name in ON_SHELF}
    variants = {name: {"pcp": float(np.mean(pcp)), "pcp_actors": pcp} for name, pcp in actors.items()}
    summary = {"name": "shelf", "head": head, "frames": 300, "seeds": 0, "variants": variants}
    return {**source(f"simharness evaluate shelf FOLDER --head {head}", ()), **summary}


def twin(name, rng):
    """Return a summary as ``tools.paper_tables.seed_scores`` writes it, with random numbers.

    One difference rounds to -0.0.
    """

    def score(middle):
        low, high = np.sort(rng.uniform(0.1, 3, 2)) * [-1, 1]
        return {"pcp": middle, "low": middle + low, "high": middle + high}

    seeds = (0, 1, 2, 5)
    summary = {"name": name, "detector": "typical", "head": "voxelpose", "frames": 60}
    summary["pcp"] = {variant: score(rng.uniform(60, 90)) for variant in VARIANTS}
    summary["ahead_of_full"] = {variant: score(rng.uniform(-9, 1)) for variant in VARIANTS[1:]}
    summary["ahead_of_full"]["fast"]["pcp"] = -0.04
    return {**source(f"{SEED_SCORES} scenarios/{name}.toml --seeds 4", seeds), **summary}


@pytest.fixture
def inputs():
    rng = np.random.default_rng(0)
    heads = {head: recorded(head, rng) for head in ("voxelpose", "2019")}
    return heads | {name: twin(name, rng) for name in ("campus", "shelf")}


@pytest.fixture
def files(inputs, tmp_path):
    """The inputs on disk."""
    paths = {key: tmp_path / name for key, name in FILES.items()}
    for key, path in paths.items():
        path.write_text(json.dumps(inputs[key]))
    return paths


def tables(text):
    """Return the tables of a Markdown text, as rows of cells without the heads."""
    blocks = [[line for line in block.splitlines() if line.startswith("|")] for block in text.split("\n\n")]
    return [[[cell.strip() for cell in line.split("|")[1:-1]] for line in block[2:]] for block in blocks if block]


def interval(score, sign=""):
    low, pcp, high = (f"{score[key]:{sign}.1f}".replace("+0.0", "0.0") for key in ("low", "pcp", "high"))
    return f"{pcp} ({low} to {high})"


def test_table_1_has_the_papers_rows_and_then_ours(inputs):
    campus, shelf, *_ = tables(markdown(paper_tables(inputs)))
    for data, rows in (("campus", campus), ("shelf", shelf)):
        assert rows[:6] == [
            [method, *(f"{pcp:.1f}" for pcp in printed)] for method, printed in COMPARISON[data].items()
        ]
        for row, variant in zip(rows[-2:], ("no-3dps", "full"), strict=True):
            assert row[1:] == ["–", "–", "–", interval(inputs[data]["pcp"][variant])]
            assert "4 seeds" in row[0]
    assert len(campus) == 6 + 2
    assert len(shelf) == 6 + 4 + 2
    rows = [(head, variant) for head in ("voxelpose", "2019") for variant in ("no-3dps", "full")]
    for row, (head, variant) in zip(shelf[6:10], rows, strict=True):
        scores = inputs[head]["variants"][variant]
        assert row[1:] == [f"{pcp:.1f}" for pcp in (*scores["pcp_actors"], scores["pcp"])]
        assert ("without 3DPS" in row[0]) is (variant == "no-3dps")
        assert ("2019 head" in row[0]) is (head == "2019")


def test_table_2_has_every_variant_beside_full(inputs):
    *_, campus, shelf = tables(markdown(paper_tables(inputs)))
    for data, rows in (("campus", campus), ("shelf", shelf)):
        assert [row[0] for row in rows] == [f"`{name}`" for name in VARIANTS]
        for name, (_, printed, against_printed, *real, ours, against_ours) in zip(VARIANTS, rows, strict=True):
            paper = ABLATION[data].get(name)
            assert printed == ("–" if paper is None else f"{paper.average:.1f}")
            assert ours == interval(inputs[data]["pcp"][name])
            if name == "full":
                assert against_printed == against_ours == ""
                continue
            if paper is not None:
                assert float(against_printed) == pytest.approx(paper.average - ABLATION[data]["full"].average)
            if name == "fast":
                assert against_ours.startswith("0.0 (-")
            else:
                assert against_ours == interval(inputs[data]["ahead_of_full"][name], "+")
            assert len(real) == (0 if data == "campus" else 4)
            for head, pcp, against in zip(("voxelpose", "2019"), real[::2], real[1::2], strict=False):
                if name == "appearance":
                    assert (pcp, against) == ("–", "–")
                    continue
                scores = inputs[head]["variants"]
                assert float(pcp) == pytest.approx(scores[name]["pcp"], abs=0.0501)
                assert float(against) == pytest.approx(scores[name]["pcp"] - scores["full"]["pcp"], abs=0.0501)


def test_without_descriptors_full_is_geometry_and_no_difference_is_written(inputs):
    """As on real Shelf: with one head mapping here, while with the other they are two measurements."""
    variants = inputs["voxelpose"]["variants"]
    variants["geometry"] = variants["full"]
    numbers = paper_tables(inputs)
    *_, shelf = tables(markdown(numbers))
    rows = {row[0]: row for row in shelf}
    assert rows["`full`"][4] == "as `geometry`"
    assert rows["`geometry`"][4] == "–"
    assert rows["`full`"][6] == ""
    assert float(rows["`geometry`"][6]) == pytest.approx(
        inputs["2019"]["variants"]["geometry"]["pcp"] - inputs["2019"]["variants"]["full"]["pcp"], abs=0.0501
    )
    assert numbers["ablation"]["shelf"]["geometry"]["voxelpose"]["against_full"] is None
    inputs["shelf"]["ahead_of_full"]["geometry"] = {"pcp": 0.0, "low": -0.1, "high": 0.1}  # the paper is outside
    (line,) = re.findall(
        r"^- `geometry` against .*", markdown(paper_tables(inputs)).split("### Shelf")[-1], re.MULTILINE
    )
    assert "VoxelPose" not in line
    assert "2019 head" in line


def test_with_descriptors_full_is_no_geometry(inputs):
    variants = inputs["voxelpose"]["variants"]
    variants["geometry"] = variants["appearance"] = variants["full"]  # equal by chance
    *_, shelf = tables(markdown(paper_tables(inputs)))
    assert {row[0]: row[4] for row in shelf}["`geometry`"] == "0.0"


def test_skipped_seeds_are_listed(inputs):
    assert markdown(paper_tables(inputs)).count("Skipped: seeds 3 and 4, at which people") == 4
    inputs["shelf"]["seeds"] = [0, 1, 2, 4]
    inputs["campus"]["seeds"] = [4, 5, 6, 7]
    text = markdown(paper_tables(inputs))
    assert re.findall(r"Skipped: (.*), at which", text) == ["seed 3"] * 2  # in both tables
    assert "people or the rack" in text


def test_the_numbers_are_all_in_the_json(inputs):
    numbers = json.loads(json.dumps(paper_tables(inputs), allow_nan=False))
    assert numbers["ablation"]["shelf"]["geometry"]["twin"]["against_full"] == [
        inputs["shelf"]["ahead_of_full"]["geometry"][key] for key in ("pcp", "low", "high")
    ]
    assert numbers["ablation"]["shelf"]["fast"]["paper"] is numbers["ablation"]["shelf"]["appearance"]["2019"] is None
    assert numbers["comparison"]["campus"][5]["average"] == [96.3, None, None]
    for key, each in inputs.items():
        written = numbers["inputs"][key]
        assert written.keys() >= set(PROVENANCE)
        assert written["command"] == each["command"]
        assert written["seeds"] == (each["seeds"] or [])
        assert written["variants"] == list(each["variants"])


def test_rows_of_the_paper_outside_the_twins_interval_are_listed(inputs):
    against = {name: row.average - ABLATION["campus"]["full"].average for name, row in ABLATION["campus"].items()}
    ends = inputs["campus"]["ahead_of_full"]
    ends["geometry"] = {"pcp": 0.0, "low": against["geometry"] + 0.1, "high": 1.0}
    ends["appearance"] = {"pcp": -0.6, "low": -0.7, "high": against["appearance"] - 0.05}
    ends["no-3dps"] = {"pcp": -5.0, "low": against["no-3dps"] - 1.0, "high": against["no-3dps"] + 1.0}
    ends["no-matching"] = {"pcp": -12.0, "low": against["no-matching"] - 0.1, "high": -9.0}
    inputs["campus"]["pcp"]["full"] = {"pcp": 96.0, "low": 95.0, "high": 97.0}
    text = markdown(paper_tables(inputs))
    part = text[text.rindex("### Campus") : text.rindex("### Shelf")]
    assert re.findall(r"^- `(\S+)`", part, re.MULTILINE) == ["appearance", "geometry"]
    assert re.findall(r"Inside the interval: (.*)\.", part) == ["`full`, `no-3dps`, `no-matching`"]


def test_the_sources_are_below_each_table(inputs):
    text = markdown(paper_tables(inputs))
    for each, times in zip(inputs.values(), (2, 2, 2, 2), strict=True):  # in both tables
        assert text.count(f"`{each['command']}`") == times
    assert "seeds 0, 1, 2, 5 of 60 frames" in text
    assert "12 min" in text
    assert "code differs" not in text
    inputs["campus"]["digests"] = {"simulation": "0" * 32, "method": "1" * 32}
    assert "The method's code differs between these inputs" in markdown(paper_tables(inputs))


class TestFiles:
    """Input files and output folder of the command."""

    @pytest.fixture
    def call(self, files, tmp_path, capsys):
        """The command: returns its exit status and what it wrote to stderr."""

        def call(**other):
            paths = files | other
            words = [word for key, option in OPTIONS.items() for word in (option, str(paths[key]))]
            status = main([*words, "--out", str(tmp_path / "paper")])
            return status, capsys.readouterr().err

        return call

    def test_the_command_writes_both(self, call, inputs, tmp_path):
        (tmp_path / "paper").mkdir()
        for _ in range(2):  # the second run replaces the files of the first
            assert call() == (0, "")
        assert sorted(path.name for path in (tmp_path / "paper").iterdir()) == ["tables.json", "tables.md"]
        numbers = json.loads((tmp_path / "paper" / "tables.json").read_text(encoding="utf-8"))
        assert numbers["command"].startswith("python -m tools.paper_tables --shelf ")
        assert numbers == json.loads(json.dumps(paper_tables(inputs, command=numbers["command"])))
        assert (tmp_path / "paper" / "tables.md").read_text(encoding="utf-8") == markdown(numbers)

    def test_every_input_is_required(self, capsys):
        with pytest.raises(SystemExit) as stop:
            main(["--out", "paper"])
        assert stop.value.code == 2
        assert ", ".join(OPTIONS.values()) in capsys.readouterr().err

    def test_nothing_else_is_replaced(self, inputs, tmp_path):
        (tmp_path / "kept").mkdir()
        (tmp_path / "kept" / "thesis.txt").touch()
        with pytest.raises(ValueError, match="holds no tables"):
            write_tables(paper_tables(inputs), tmp_path / "kept")
        assert [path.name for path in (tmp_path / "kept").iterdir()] == ["thesis.txt"]
        with pytest.raises(ValueError, match="cannot be written"):
            write_tables(paper_tables(inputs), tmp_path / "kept" / "thesis.txt" / "deep")

    @pytest.mark.parametrize(
        ("key", "change", "message"),
        [
            ("campus", lambda summary: summary.update(command="simharness evaluate poses FOLDER"), SEED_SCORES),
            ("voxelpose", lambda summary: summary.update(command=None), "expected a file of simharness evaluate shelf"),
            ("voxelpose", lambda summary: summary.update(head="2019"), "the head voxelpose, got 2019"),
            ("2019", lambda summary: summary.update(head="voxelpose"), "the head 2019, got voxelpose"),
            ("campus", lambda summary: summary.update(name="shelf"), "the name campus, got shelf"),
            ("shelf", lambda summary: summary.pop("digests"), "digests"),
            ("2019", lambda summary: summary.pop("frames"), "frames"),
            ("2019", lambda summary: summary["variants"].pop("fast"), "lacks the variants fast"),
            ("shelf", lambda summary: [summary["pcp"].pop(name) for name in ("full", "fast")], "variants full, fast"),
            ("shelf", lambda summary: summary["ahead_of_full"].pop("fast"), f"not as {SEED_SCORES}"),
            ("shelf", lambda summary: summary["pcp"]["fast"].update(low=None), "PCP of fast"),
            (
                "shelf",
                lambda summary: summary["ahead_of_full"]["fast"].update(high=math.nan),
                "PCP of fast against full",
            ),
            ("voxelpose", lambda summary: summary["variants"]["full"].update(pcp=None), "PCP of full"),
            ("voxelpose", lambda summary: summary["variants"]["full"]["pcp_actors"].pop(), "PCP of full"),
            ("voxelpose", lambda summary: summary.update(variants=["full"]), "not as simharness evaluate shelf"),
        ],
    )
    def test_wrong_inputs_get_one_message(self, call, files, inputs, tmp_path, key, change, message):
        change(inputs[key])
        files[key].write_text(json.dumps(inputs[key]))
        self.refused(call(), tmp_path, f"{OPTIONS[key]} {files[key]}: ", message, INPUTS[key].makes)

    @pytest.mark.parametrize(
        ("content", "message"), [(None, "no such file"), ("x", "not JSON"), ("[]", "expected a JSON object, got list")]
    )
    def test_a_file_that_cannot_be_read_is_named(self, call, tmp_path, content, message):
        file = tmp_path / "other.json"
        if content is not None:
            file.write_text(content)
        self.refused(call(campus=file), tmp_path, f"--campus-twin {file}: ", message)

    @staticmethod
    def refused(result, folder, *messages):
        status, stderr = result
        assert status == 2
        assert len(stderr.strip().splitlines()) == 1
        for text in ("error: ", *messages):
            assert text in stderr
        assert not (folder / "paper").exists()


def test_the_examples_in_messages_name_all_variants():
    for wanted in INPUTS.values():
        words = shlex.split(wanted.makes)
        assert words[:3] == wanted.command.split()
        if wanted.command != SEED_SCORES:
            assert [value for option, value in pairwise(words) if option == "--method"] == ON_SHELF
        else:
            (variants,) = (word for word in words if word.startswith("method.variants="))
            assert json.loads(variants.removeprefix("method.variants=")) == list(VARIANTS)


@pytest.mark.slow
def test_what_the_commands_write_is_read(tmp_path, monkeypatch, shared_data):
    def run(*words):
        monkeypatch.setattr(sys, "argv", ["simharness", *words])
        result = CliRunner().invoke(app, list(words), catch_exceptions=False)
        assert result.exit_code == 0, result.stderr

    small = ("--seeds", "2", "--set", "duration=0.6", "--set", "rate=5", "--set", "rendering.renderer=rays")
    for key, wanted in INPUTS.items():
        words = [str(tmp_path / f"{key}.json") if word == "FILE" else word for word in shlex.split(wanted.makes)]
        if wanted.command == SEED_SCORES:
            drawn = [word.replace("source=pictures", "source=drawn") for word in words[3:]]
            assert seed_scores([*drawn, *small]) == 0
        else:
            run(*(str(shared_data / "shelf") if word == "FOLDER" else word for word in words[1:]))
    numbers = paper_tables(read_inputs({key: tmp_path / f"{key}.json" for key in INPUTS}))
    assert len(tables(markdown(numbers))) == 4
    assert [numbers["inputs"][key]["seeds"] for key in ("voxelpose", "campus")] == [[], [0, 1]]
