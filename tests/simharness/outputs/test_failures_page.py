"""Page of kept failures: every one is there with its cameras, and with what the method makes of it now."""

import re

from simharness.hunt.frozen_frame import DrawnError, FrozenCamera, FrozenPerson
from simharness.hunt.kept_failure import KeptFailure, write_failure
from simharness.outputs.hunt.page import write_failures_page
from simharness.world.rigs.layouts import look_at


def failure(name, errors):
    K = [[500.0, 0.0, 320.0], [0.0, 500.0, 240.0], [0.0, 0.0, 1.0]]
    rig = [look_at((x, y, 2.0), (0.0, 0.0, 1.0), K=K, size=(640, 480)) for x, y in ((3, 0), (0, 3), (-3, 1))]
    joints = tuple((0.1 * (j % 2), 0.0, 1.7 - 0.1 * j) for j in range(17))
    return KeptFailure(
        name=name,
        violated="missed",
        person=0,
        variant="fast",
        text="Somebody & nobody",
        cameras=tuple(FrozenCamera.of(camera, f"cam{v}") for v, camera in enumerate(rig)),
        people=(FrozenPerson(number=0, joints=joints),),
        errors=errors,
    )


def test_page(tmp_path):
    missed = tuple(DrawnError(kind="missed", camera=f"cam{v}", person=0) for v in (0, 1))
    moved = DrawnError(kind="keypoint", camera="cam2", person=0, joint="nose", offset=(7.0, -5.0), score=0.5)
    write_failure(failure("still", missed), tmp_path)
    write_failure(failure("mended", (moved,)), tmp_path)
    (tmp_path / "other.toml").write_text('name = "none"\n')
    page = write_failures_page(tmp_path).read_text()
    sections = dict(re.findall(r'<section id="(\w+)">(.*?)</section>', page, flags=re.DOTALL))
    assert list(sections) == ["mended", "still"]
    for text in sections.values():
        assert text.count("<svg") == 3
        assert "Somebody &amp; nobody" in text
    assert ">fails<" in sections["still"]
    assert "does not fail any more" in sections["mended"]
    assert re.search(r'class="wrong" d="M[-\d.]+ [-\d.]+l7.0 -5.0"', sections["mended"])
    assert sections["still"].count('class="detected"') == 1
