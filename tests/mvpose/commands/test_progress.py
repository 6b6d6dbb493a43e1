"""Progress of long commands."""

import io

import pytest
from rich.console import Console

from mvpose.commands import progress
from mvpose.commands.progress import Lines, Pace, counted, duration, reporter


class Clock:
    """A clock that the test sets."""

    now = 100.0

    def __call__(self):
        return self.now


def test_the_rate_counts_neither_earlier_trials_nor_the_first_of_this_run():
    clock = Clock()
    pace = Pace(total=100, done=60, clock=clock)
    assert str(pace) == ""
    clock.now += 50.0  # imports and compilation
    pace.advance(1)
    pace.advance(1)
    assert str(pace) == ""
    clock.now += 4.0
    pace.advance(8)
    assert str(pace) == "2.0/s, 15 s left"
    pace.advance(1, failed=1)
    assert str(pace).endswith(", 1 failed")
    pace.advance(29)
    assert "left" not in str(pace)


def test_two_workers_that_finish_together_give_no_rate():
    clock = Clock()
    pace = Pace(total=100, clock=clock)
    pace.advance(2)
    clock.now += 0.01
    pace.advance(1)
    assert pace.rate is None


@pytest.mark.parametrize(("seconds", "text"), [(4.0, "15.0/min, 6 min left"), (60.0, "1.0/min, 97 min left")])
def test_slow_trials_have_a_rate_per_minute(seconds, text):
    clock = Clock()
    pace = Pace(total=100, clock=clock)
    for _ in range(3):
        clock.now += seconds
        pace.advance(1)
    assert str(pace) == text


@pytest.mark.parametrize(("seconds", "text"), [(45.2, "45 s"), (99.6, "100 s"), (720.0, "12 min"), (12600.0, "3.5 h")])
def test_durations_in_words(seconds, text):
    assert duration(seconds) == text


def test_a_log_gets_a_line_every_ten_seconds_at_most(monkeypatch):
    clock = Clock()
    monkeypatch.setattr(progress.time, "monotonic", clock)
    monkeypatch.setattr(Pace.__init__, "__kwdefaults__", {"clock": clock})
    text = io.StringIO()
    with Lines(Console(file=text, width=80)).stage("trials", 200) as advance:
        for _ in range(100):
            clock.now += 0.5
            advance(1)
    lines = text.getvalue().splitlines()
    assert len(lines) == 5
    assert lines[-1] == "trials: 100 of 200, 2.0/s, 50 s left"


def test_without_a_terminal_lines_are_printed():
    with reporter() as lines:
        assert isinstance(lines, Lines)


def test_items_are_counted_when_they_are_done():
    seen = []
    for each in counted("ab", seen.append):
        seen.append(each)
    assert seen == ["a", 1, "b", 1]
