"""Result folders appear complete or not at all."""

import subprocess
import sys

import pytest

from mvpose.files.atomic_files import atomic_folder


def test_a_folder_appears_at_the_end_only(tmp_path):
    folder = tmp_path / "deep" / "run"
    with atomic_folder(folder) as partial:
        (partial / "a").write_text("1")
        assert not folder.exists()
    assert [path.name for path in folder.iterdir()] == ["a"]
    assert list(folder.parent.iterdir()) == [folder]


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_an_error_leaves_nothing(tmp_path, error):
    def write() -> None:
        with atomic_folder(tmp_path / "run") as partial:
            (partial / "a").write_text("1")
            raise error

    with pytest.raises(error):
        write()
    assert list(tmp_path.iterdir()) == []


def test_an_error_leaves_the_old_folder_unchanged(tmp_path):
    def write(text: str, *, fail: bool) -> None:
        with atomic_folder(tmp_path / "run") as partial:
            (partial / "a").write_text(text)
            if fail:
                raise RuntimeError

    write("1", fail=False)
    with pytest.raises(RuntimeError):
        write("2", fail=True)
    assert (tmp_path / "run" / "a").read_text() == "1"


def test_a_new_folder_replaces_the_old_one_completely(tmp_path):
    for name in ("a", "b"):
        with atomic_folder(tmp_path / "run") as partial:
            (partial / name).touch()
    assert [path.name for path in tmp_path.rglob("*")] == ["run", "b"]


def test_a_killed_process_leaves_no_result_folder(tmp_path):
    code = (
        "import os, pathlib, sys\n"
        "from mvpose.files.atomic_files import atomic_folder\n"
        "with atomic_folder(pathlib.Path(sys.argv[1])) as partial:\n"
        "    (partial / 'summary.json').touch()\n"
        "    os._exit(9)\n"
    )
    folder = tmp_path / "run"
    assert subprocess.run([sys.executable, "-c", code, str(folder)], check=False).returncode == 9
    assert not folder.exists()
    assert all(path.name.startswith(".") for path in tmp_path.iterdir())
