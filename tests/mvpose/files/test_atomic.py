"""Result folders appear complete or not at all, and lose no file of the user."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from mvpose.files.atomic_files import KEPT, MANIFEST, atomic_folder, files_of_user, open_manifest, write_atomic


def test_a_folder_appears_at_the_end_only(tmp_path):
    folder = tmp_path / "deep" / "run"
    with atomic_folder(folder, "test") as partial:
        (partial / "a").write_text("1")
        assert not folder.exists()
    assert sorted(path.name for path in folder.iterdir()) == [MANIFEST, "a"]
    assert list(folder.parent.iterdir()) == [folder]


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_an_error_leaves_nothing(tmp_path, error):
    def write() -> None:
        with atomic_folder(tmp_path / "run", "test") as partial:
            (partial / "a").write_text("1")
            raise error

    with pytest.raises(error):
        write()
    assert list(tmp_path.iterdir()) == []


def test_an_error_leaves_the_old_folder_unchanged(tmp_path):
    def write(text: str, *, fail: bool) -> None:
        with atomic_folder(tmp_path / "run", "test") as partial:
            (partial / "a").write_text(text)
            if fail:
                raise RuntimeError

    write("1", fail=False)
    with pytest.raises(RuntimeError):
        write("2", fail=True)
    assert (tmp_path / "run" / "a").read_text() == "1"


def test_a_new_folder_replaces_the_old_one_completely(tmp_path):
    for name in ("a", "b"):
        with atomic_folder(tmp_path / "run", "test") as partial:
            (partial / name).touch()
    assert sorted(path.name for path in tmp_path.rglob("*")) == [MANIFEST, "b", "run"]


def test_a_killed_process_leaves_no_result_folder(tmp_path):
    code = (
        "import os, pathlib, sys\n"
        "from mvpose.files.atomic_files import atomic_folder\n"
        "with atomic_folder(pathlib.Path(sys.argv[1]), 'test') as partial:\n"
        "    (partial / 'summary.json').touch()\n"
        "    os._exit(9)\n"
    )
    folder = tmp_path / "run"
    assert subprocess.run([sys.executable, "-c", code, str(folder)], check=False).returncode == 9
    assert not folder.exists()
    assert all(path.name.startswith(".") for path in tmp_path.iterdir())


def made(folder: Path, what: str = "test", **files: str) -> Path:
    with atomic_folder(folder, what) as partial:
        for name, text in files.items():
            (partial / name.replace("__", "/")).parent.mkdir(exist_ok=True)
            (partial / name.replace("__", "/")).write_text(text)
    return folder


def contents(folder: Path) -> dict[str, str]:
    files = (path for path in folder.rglob("*") if path.is_file() and path.name != MANIFEST)
    return {path.relative_to(folder).as_posix(): path.read_text() for path in files}


class TestFilesOfTheUser:
    """Files in a folder of results that no command wrote."""

    def test_they_stay_where_they_are_and_old_results_go(self, tmp_path):
        folder = made(tmp_path / "run", a="1", sub__b="1")
        (folder / "sub" / "ik.mot").write_text("mine")
        (folder / "notes").mkdir()
        (folder / "notes" / "a.txt").symlink_to("nowhere")
        for _ in range(2):  # they are still the user's in the third run
            made(folder, a="2")
            assert contents(folder) == {"a": "2", "sub/ik.mot": "mine"}
            assert os.readlink(folder / "notes" / "a.txt") == "nowhere"
            assert files_of_user(folder) == ["notes/a.txt", "sub/ik.mot"]

    def test_one_whose_name_is_taken_and_a_changed_result_are_kept_aside(self, tmp_path):
        folder = made(tmp_path / "run", a="1", b="1", c="1")
        (folder / "a").write_text("changed")
        (folder / "sub").write_text("a file")
        made(folder, a="2", sub__d="2")
        assert contents(folder) == {"a": "2", "sub/d": "2", f"{KEPT}/a": "changed", f"{KEPT}/sub": "a file"}
        (folder / "a").write_text("changed again")
        made(folder, a="3")
        assert sorted(contents(folder).values()) == ["3", "a file", "changed", "changed again"]

    def test_a_file_written_later_belongs_to_the_folder_until_it_is_changed(self, tmp_path):
        folder = made(tmp_path / "run", a="1")
        write_atomic(folder / "page", b"1")
        write_atomic(folder / "page", b"2")
        assert contents(folder) == {"a": "1", "page": "2"}
        (folder / "page").write_text("mine")
        write_atomic(folder / "page", b"3")
        assert contents(folder) == {"a": "1", "page": "3", f"{KEPT}/page": "mine"}
        made(folder, a="2")
        assert contents(folder) == {"a": "2", f"{KEPT}/page": "mine"}

    def test_a_folder_that_grows_file_by_file_keeps_them_too(self, tmp_path):
        open_manifest(tmp_path / "run", "test")
        (tmp_path / "run" / "cam.json").write_text("mine")
        write_atomic(tmp_path / "run" / "cam.json", b"ours")
        assert contents(tmp_path / "run") == {"cam.json": "ours", f"{KEPT}/cam.json": "mine"}

    @pytest.mark.parametrize("moment", ["before the old folder is renamed", "after", "after the new one is renamed"])
    def test_a_killed_run_loses_none(self, tmp_path, moment):
        folder = made(tmp_path / "run", a="1")
        (folder / "mine").write_text("mine")
        renames = {"before the old folder is renamed": 0, "after": 1, "after the new one is renamed": 2}[moment]
        code = (
            "import os, pathlib, sys\n"
            "from mvpose.files import atomic_files\n"
            "rename, left = pathlib.Path.rename, [int(sys.argv[2])]\n"
            "def counted(path, target):\n"
            "    if not left[0]:\n"
            "        os._exit(9)\n"
            "    left[0] -= 1\n"
            "    rename(path, target)\n"
            "pathlib.Path.rename = counted\n"
            "atomic_files.shutil.rmtree = lambda path, **_: left[0] or not path.exists() or os._exit(9)\n"
            "with atomic_files.atomic_folder(pathlib.Path(sys.argv[1]), 'test') as partial:\n"
            "    (partial / 'a').write_text('2')\n"
        )
        killed = subprocess.run([sys.executable, "-c", code, str(folder), str(renames)], check=False)
        assert killed.returncode == 9
        assert folder.exists() == (moment != "after")
        made(folder, a="3")
        assert contents(folder) == {"a": "3", "mine": "mine"}


class TestRefusals:
    """Folders that are not replaced."""

    def test_a_folder_of_another_command_or_of_the_user(self, tmp_path):
        made(tmp_path / "run", what="test", a="1")
        with pytest.raises(ValueError, match="holds results of test, which other does not replace"):
            made(tmp_path / "run", what="other", a="2")
        (tmp_path / "thesis").mkdir()
        (tmp_path / "thesis" / "text").write_text("years")
        with pytest.raises(ValueError, match="has files, and is no result of test"):
            made(tmp_path / "thesis", a="2")
        (tmp_path / "thesis" / MANIFEST).write_text("{")
        with pytest.raises(ValueError, match="has files, and is no result of test"):
            made(tmp_path / "thesis", a="2")
        assert contents(tmp_path) == {"run/a": "1", "thesis/text": "years"}

    def test_the_current_folder(self, tmp_path, monkeypatch):
        monkeypatch.chdir(tmp_path)
        with pytest.raises(ValueError, match="give a folder inside"):
            made(Path(), a="1")

    def test_a_link_stays_and_what_it_names_is_replaced(self, tmp_path):
        made(tmp_path / "real", a="1")
        (tmp_path / "link").symlink_to(tmp_path / "real")
        made(tmp_path / "link", a="2")
        assert (tmp_path / "link").is_symlink()
        assert contents(tmp_path / "real") == {"a": "2"}
