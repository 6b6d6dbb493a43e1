"""Input files: regular ones of bounded size, nested moderately; and nothing in the packages reads around them."""

import ast
import json
import os
import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mvpose.files.input_files import parse_json, parse_toml, read_bytes, read_json, read_json_object

ROOT = Path(__file__).parents[3]


def test_a_regular_file_is_read_up_to_the_bound(tmp_path):
    path = tmp_path / "a"
    path.write_bytes(b"x" * 100)
    assert read_bytes(path, what="words", most=100) == b"x" * 100
    with pytest.raises(ValueError, match=r"a: is larger than .* MiB, the most that is read of words"):
        read_bytes(path, what="words", most=99)


@pytest.mark.parametrize(("kind", "message"), [("pipe", "a pipe"), ("folder", "a folder"), ("device", "a device")])
def test_what_is_no_regular_file_is_refused_at_once(tmp_path, kind, message):
    path = tmp_path / "a"
    {"pipe": os.mkfifo, "folder": os.mkdir, "device": lambda path: path.symlink_to("/dev/zero")}[kind](path)
    with pytest.raises(ValueError, match=rf"a: is {message}, not a regular file; expected words"):
        read_bytes(path, what="words")


def test_missing_files_loops_and_impossible_paths_are_refused(tmp_path):
    with pytest.raises(ValueError, match=r"no such file; expected words"):
        read_bytes(tmp_path / "none", what="words")
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    with pytest.raises(ValueError, match="cannot be read"):
        read_bytes(tmp_path / "loop", what="words")
    with pytest.raises(ValueError, match="cannot be a path"):
        read_bytes(tmp_path / "a\0b", what="words")
    with pytest.raises(ValueError, match="cannot be read") as refused:
        read_bytes(tmp_path / ("x" * 5000), what="words")
    assert len(str(refused.value)) < 500


JSON = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**63), 2**63 - 1) | st.floats(allow_nan=False) | st.text(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner, max_size=4),
    max_leaves=20,
)


@given(value=JSON, mark=st.booleans())
def test_json_means_what_it_means_to_the_library(value, mark):
    text = json.dumps(value).encode()
    assert parse_json(b"\xef\xbb\xbf" + text if mark else text) == value


@pytest.mark.parametrize("depth", [65, 900, 100_000])
def test_deep_nesting_is_refused(depth):
    for text in ("[" * depth, "[" * depth + "]" * depth, '{"a":' * depth, '{"a":' * depth + "1" + "}" * depth):
        with pytest.raises(ValueError, match=r"nested more than 64 deep|Expecting|delimiter"):
            parse_json(text)
        with pytest.raises(ValueError, match=r"nested more than 64 deep|array|inline table|Invalid"):
            parse_toml("a = " + text.replace(":", " =").replace('"', ""))
    with pytest.raises(ValueError, match=r"nested more than 64 deep"):
        parse_toml(".".join(["a"] * depth) + " = 1")
    with pytest.raises(ValueError, match=r"nested more than 64 deep"):
        parse_toml("[" + ". ".join(['"a"'] * depth) + "]")


def test_nesting_up_to_the_bound_is_read():
    assert parse_json("[" * 63 + "]" * 63)
    assert parse_toml(".".join(["a"] * 60) + " = 1")
    assert parse_toml("a = [" + "1.25, " * 1000 + "]")["a"] == [1.25] * 1000


def test_values_that_nothing_can_take_are_refused():
    with pytest.raises(ValueError, match="64 bits"):
        parse_json("[1e5, 99999999999999999999]")
    for text in (r'{"a": "\ud800"}', r'{"\udfff": 1}'):
        with pytest.raises(ValueError, match="Unicode"):
            parse_json(text)
    with pytest.raises(ValueError, match="digits"):
        parse_json("1" * 5000)


def test_broken_json_names_the_file_in_one_line(tmp_path):
    path = tmp_path / "a.json"
    path.write_text("[" * 100_000)
    with pytest.raises(ValueError, match=r"a\.json: broken or truncated JSON \(nested more .*expected words"):
        read_json(path, what="words")
    path.write_text("[1]")
    assert read_json(path, what="words") == [1]
    with pytest.raises(ValueError, match=r"a\.json: expected words, which is a JSON object, got a list"):
        read_json_object(path, what="words")


# What reads files by itself, and why it may.
AROUND = {
    "mvpose/networks/session.py": "the digest of an ONNX file, read in blocks",
    "mvpose/networks/card.py": "text within an ONNX file; mvpose stands alone, and a file beside it is checked before",
    "mvpose/tracking/state.py": "mvpose stands alone; kind and size of the file are checked before",
    "mvpose/kernels.py": "code",
    "mvpose/files/input_files.py": "the reader",
    "mvpose/files/archives.py": "bytes that were read",
    "mvpose/formats/people/people_tables.py": "bytes that were read",
    "mvpose/formats/calibration/qualisys.py": "bytes that were read",
    "simharness/runtime/parquet_tables.py": "bytes that were read",
    "simharness/planning/search.py": "text that was just written",
    "simharness/outputs/run/pictures.py": "a film that was just written",
    "simharness/runtime/version.py": "code",
    "simharness/trial/needs.py": "what the kernel says of the machine",
    "simharness/trial/identity.py": "digests of regular files, read in blocks",
    "simharness/trial/stages/estimators.py": "code",
    "simharness/scenario/load.py": "digests of regular files",
    "simharness/gate/suite.py": "digests of regular files",
    "simharness/outputs/benchmark/panoptic_sequence.py": "a file that was just written",
    "simharness/outputs/benchmark/mjcf_scene.py": "files that were just written",
    "simharness/cli/run_command.py": "a file that was just written",
    "simharness/hunt/hunt_run.py": "appended to, read by the reader",
    "mvpose/formats/people/people_parts.py": "files that were just written",
    "simharness/outputs/study/page.py": "a file of a result folder, if regular",
    "simharness/gate/frame_times.py": "a text of its own",
}
SHIPPED = {
    "simharness/world/rigs/layouts.py", "simharness/world/humans/body.py", "simharness/detector/reported.py",
    "simharness/capture/outer_views.py", "simharness/world/scene/rooms/kinds.py",
    "simharness/world/humans/face_colors.py", "simharness/world/humans/population.py",
    "simharness/world/humans/anatomy.py", "simharness/world/scene/rooms/fittings.py",
    "simharness/world/scene/objects/materials.py", "mvpose/calibration/findings.py",
    "simharness/outputs/__init__.py",
    "simharness/reality/detector_fit/fit_table.py",
    "simharness/reality/detector_fit/profile.py", "simharness/study/causes/cause_catalogue.py",
    "simharness/world/scene/rooms/room_lighting.py", "simharness/reality/evaluation.py",
    "simharness/trial/kernel_compilation.py", "mvpose/formats/joint_names.py", "mvpose/networks/catalogue/store.py",
    "mvpose/calibration/file_mistakes.py", "mvpose/networks/catalogue/fetch.py", "mvpose/public_names.py",
    "mvpose/skeleton.py", "simharness/scoring/score_registry.py",
    "simharness/cli/scenarios_command.py",
    "simharness/world/humans/wardrobe.py", "simharness/world/motion/activities/gait.py",
    "simharness/world/motion/mocap/skeleton.py",
}  # fmt: skip
CALLS = re.compile(
    r"(?:^|\.)(?:read_text|read_bytes|loadmat|read_parquet|scan_parquet|FileStorage|imread)$|^(?:np\.load|json\.loads?|"
    r"tomllib\.loads?|yaml\.(?:load|safe_load)|open|pickle\.loads?|Image\.open|ElementTree\.(?:parse|fromstring))$"
)


def calls(file):
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Call):
            name = ast.unparse(node.func)
            if CALLS.search(name) and name != "read_bytes":  # the function of input_files
                yield node, name


@pytest.mark.slow
def test_no_module_reads_files_around_the_one_reader():
    found = {}
    for package in ("mvpose", "simharness"):
        for file in (ROOT / package).rglob("*.py"):
            if names := [name for _, name in calls(file)]:
                found[file.relative_to(ROOT).as_posix()] = names
    writes = [name for name, names in found.items() if set(names) == {"cv2.FileStorage"}]
    assert writes == ["mvpose/formats/calibration/file_storage.py"]
    assert found.keys() - set(writes) - AROUND.keys() - SHIPPED == set()


def test_opencv_parses_no_file():
    file = ROOT / "mvpose/formats/calibration/file_storage.py"
    opened = [ast.unparse(node) for node, name in calls(file) if name == "cv2.FileStorage"]
    assert opened
    assert all("FILE_STORAGE_WRITE" in call and "READ" not in call for call in opened)
