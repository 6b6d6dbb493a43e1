"""What is said while a study runs."""

import io

import pytest
from rich.console import Console

from simharness.study import study_progress as progress
from simharness.study.study_progress import Pace, _Lines, watching


@pytest.fixture
def clock(monkeypatch):
    class Clock:
        now = 100.0

    monkeypatch.setattr(progress.time, "monotonic", lambda: Clock.now)
    return Clock


def test_rate_and_remaining_time_are_of_what_is_run_now(clock):
    pace = Pace()
    pace.begin(trials=100, kept=60)
    assert str(pace) == ""
    clock.now += 5.0
    for _ in range(10):
        pace.advance(failed=False)
    assert str(pace) == "2.0/s, 15 s left"
    pace.advance(failed=True)
    assert str(pace).endswith(", 1 failed")
    for _ in range(29):
        pace.advance(failed=False)
    assert "left" not in str(pace)


@pytest.mark.parametrize(("seconds", "said"), [(4.0, "15.0/min, 7 min left"), (60.0, "1.0/min, 99 min left")])
def test_slow_trials_are_counted_by_the_minute(clock, seconds, said):
    pace = Pace()
    pace.begin(trials=100, kept=0)
    clock.now += seconds
    pace.advance(failed=False)
    assert str(pace) == said


def test_a_log_gets_a_line_every_ten_seconds_at_most(clock):
    text = io.StringIO()
    lines = _Lines(Console(file=text, width=80))
    lines.begin(trials=200, kept=0)
    for _ in range(100):
        clock.now += 0.5
        lines.advance(failed=False)
    assert len(text.getvalue().splitlines()) == 5
    assert text.getvalue().splitlines()[-1] == "100 of 200 trials, 2.0/s, 50 s left"


def test_where_there_is_no_terminal_there_are_lines():
    with watching() as watch:
        assert isinstance(watch, _Lines)
