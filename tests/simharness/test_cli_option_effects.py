"""Options of ``simharness`` that would change nothing beside others are refused, before anything is computed."""

import pytest
from option_walk import parameters
from typer.testing import CliRunner

from simharness.cli import app

WITHOUT_EFFECT = [
    ("--lag", ["evaluate", "shelf", "--lag", "0.5"]),
    ("--lag", ["evaluate", "shelf", "--method", "fast", "--method", "full", "--lag", "0"]),
    ("--blame", ["study", "quickstart", "--shard", "1/2", "--blame", "2"]),
    ("--out", ["study", "quickstart", "--shard", "1/2", "--store", "one", "--out", "two"]),
    ("--workers", ["study", "quickstart", "--scheduler", "tcp://127.0.0.1:1", "--workers", "2"]),
    ("--size", ["rehearse", "ring5", "--size", "320x240"]),
    *(
        (f"--{name}", ["plan", "lab", "--preview", f"--{name}", "4"])
        for name in ("cameras", "scenes", "seed", "workers")
    ),
    ("--lens", ["plan", "lab", "--preview", "--lens", "wide"]),
    ("--summary", ["check", "ci", "--baseline", "new.json", "--update-baseline", "--summary", "page.md"]),
    ("--accept-better", ["check", "ci", "--baseline", "new.json", "--update-baseline", "--accept-better"]),
]


@pytest.mark.parametrize(("option", "words"), WITHOUT_EFFECT, ids=lambda value: value if isinstance(value, str) else "")
def test_an_option_without_effect_is_refused(tmp_path, monkeypatch, option, words):
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 2, result.output
    assert result.stderr.startswith(f"error: {option}")
    assert "Traceback" not in result.output
    assert not [each for each in tmp_path.rglob("*") if each.is_file() and not each.name.startswith(".")]


def test_these_options_exist():
    known = parameters(app)
    for option, words in WITHOUT_EFFECT:
        command = next(name for name in (" ".join(words[:2]), f"{words[0]} recording", words[0]) if name in known)
        assert option in known[command].values()
