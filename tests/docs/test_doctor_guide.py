"""The guide of the doctor states the sizes, kinds and mends of the code."""

import re

from doc_pages import FENCE, PAGES

from mvpose.calibration.findings import ALARM, EXCLUDED, KINDS
from mvpose.calibration.mends import MENDS

GUIDE = FENCE.sub("", PAGES["docs/guide/doctor.md"])
SPAN = re.compile(r"`([^`]+)`")


def number(value):
    return f"{value:g}"


def test_the_guide_has_the_sizes_of_alarms():
    rows = dict(
        re.findall(r"^\| (.+?) \| (.+?) \|$", GUIDE.partition("## When is an error an alarm?")[2], re.MULTILINE)
    )
    assert rows["pose of a camera"] == f"{number(ALARM['degrees'])} degrees or {number(100 * ALARM['metres'])} cm"
    assert rows["focal length"] == f"{number(ALARM['percent'])} %"
    assert rows["principal point"] == f"{number(ALARM['px'])} px"
    assert rows["clock"] == f"{number(ALARM['ms'])} ms"
    (lens,) = (size for what, size in rows.items() if what.startswith("lens"))
    assert lens == f"{number(ALARM['edge_px'])} px"
    assert f"with {number(ALARM['times_usual'])} times as much or more" in GUIDE
    excluded = f"{number(EXCLUDED['degrees'])} degree or {number(100 * EXCLUDED['metres'])} cm"
    assert f"no camera can be off by {excluded}" in " ".join(GUIDE.split())


def test_the_guide_names_every_kind_and_every_mend():
    spans = set(SPAN.findall(GUIDE))
    assert not set(KINDS) - spans
    assert not set(MENDS) - {re.split("[:@]", each)[0] for each in spans}
