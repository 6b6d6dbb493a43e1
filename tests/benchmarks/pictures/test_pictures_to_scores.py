"""The whole way of a recording: pictures of an export, ``mvpose run``, ``simharness evaluate poses``."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from benchmarks.pictures.__main__ import measure
from benchmarks.pictures.networks import joint_segments
from benchmarks.pictures.painted_bodies import SEGMENTS, SHADES
from mvpose import COCO17
from mvpose.cli.app import app as mvpose
from simharness.cli import app as simharness
from simharness.world.humans.anatomy import Segment

SMALL = ["people.count=2", "duration=0.4", "cameras.count=3", "cameras.size=[640,480]", "clutter.shelves=0"]


def call(program, *arguments):
    result = CliRunner().invoke({"mvpose": mvpose, "simharness": simharness}[program], list(map(str, arguments)))
    assert result.exit_code == 0, result.output


@pytest.mark.slow
@pytest.mark.parametrize("head", ["simcc", pytest.param("heatmap", marks=pytest.mark.slow)])
def test_people_of_pictures_are_those_of_the_export(tmp_path, head):
    """Joints lie in bodies, and the colours are on them: they are off by the thickness of a limb."""
    scores = json.loads(measure("quickstart", SMALL, tmp_path, head=head, command=call).read_text(encoding="utf-8"))
    files = scores["variants"]["files"]
    assert (scores["name"], scores["frames"], scores["frames_annotated"]) == ("quickstart", 4, 4)
    assert files["recall"] == files["precision"] == 1.0
    assert files["pcp"] > 95.0
    assert files["mpjpe_mm"]["median"] < 60.0
    assert files["tracking"]["mean_joint"]["0.5"]["id_switches"] == 0
    assert {each.suffix for each in (tmp_path / "pictures").iterdir()} == {".mkv", ""}  # videos and a folder


def test_no_mixture_of_two_colours_is_a_third():
    """Of two segments of one person, and of a person and what is black."""
    between = np.linspace(0, 1, 101)[:, None]
    for one in range(len(SEGMENTS)):
        for other in range(one):
            mixed = SEGMENTS[one] * between + SEGMENTS[other] * (1 - between)
            others = np.delete(SEGMENTS, [one, other], axis=0)
            assert np.abs(mixed[:, None] - others).max(axis=-1).min() > 8.0
    assert np.diff(SHADES).min() > 16
    assert np.abs(SHADES - 114).min() > 8


def test_joints_are_where_their_segments_meet():
    pairs = dict(zip(COCO17.joints, joint_segments(), strict=True))
    assert pairs["left_knee"] == (Segment.LEFT_THIGH, Segment.LEFT_SHANK)
    assert pairs["right_shoulder"] == (Segment.TORSO, Segment.RIGHT_UPPER_ARM)
    assert pairs["nose"] == (Segment.HEAD, Segment.HEAD)
