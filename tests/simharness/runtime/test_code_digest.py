"""Digests of code change with what it does, not with its documentation."""

import os

import pytest

from simharness.runtime import version
from simharness.runtime.version import digest_of_folders

SOURCE = '"""A module."""\n\nVALUE = 1  # a comment\n'


def test_statements_and_names_of_files_count_and_comments_do_not(tmp_path):
    def digest(name="module.py", text=SOURCE):
        folder = tmp_path / str(len(list(tmp_path.iterdir()))) / "package"
        folder.mkdir(parents=True)
        (folder / name).write_text(text)
        return digest_of_folders(folder, [""])

    assert digest() == digest() == digest(text=SOURCE.replace("  # a comment", "").replace("A module", "Another text"))
    others = {digest(text=SOURCE.replace("1", "2")), digest(name="other.py"), digest(text="")}
    assert len({digest(), *others}) == 4


def test_a_file_that_does_not_parse_counts_by_its_text(tmp_path):
    digests = set()
    for text in ("def f(:", "def g(:"):
        (tmp_path / "module.py").write_text(text)
        digests.add(digest_of_folders(tmp_path, [""]))
    assert len(digests) == 2


def test_what_a_build_leaves_does_not_count(tmp_path):
    (tmp_path / "module.py").write_text(SOURCE)
    before = digest_of_folders(tmp_path, [""])
    (tmp_path / "build").mkdir()
    (tmp_path / "build" / "module.py").write_text(SOURCE)
    assert digest_of_folders(tmp_path, [""]) == before


class TestKeptTrees:
    @pytest.fixture
    def package(self, tmp_path, monkeypatch):
        monkeypatch.delenv("PYTHONPYCACHEPREFIX", raising=False)
        (tmp_path / "module.py").write_text(SOURCE)
        (tmp_path / "data.bin").write_bytes(b"1")
        return tmp_path

    @staticmethod
    def in_a_new_process(package):
        version._known_trees.cache_clear()
        version._meaning.cache_clear()
        return digest_of_folders(package, [""])

    def test_a_module_is_parsed_once(self, package, monkeypatch):
        first = self.in_a_new_process(package)
        monkeypatch.setattr(version.ast, "parse", lambda _: pytest.fail("the module is parsed again"))
        assert self.in_a_new_process(package) == first

    def test_an_edit_counts_even_with_the_size_and_time_of_before(self, package):
        first, module = self.in_a_new_process(package), package / "module.py"
        times = module.stat()
        module.write_text(SOURCE.replace("1", "2"))
        os.utime(module, ns=(times.st_atime_ns, times.st_mtime_ns))
        assert self.in_a_new_process(package) != first
        module.write_text(SOURCE)
        assert self.in_a_new_process(package) == first

    @pytest.mark.parametrize("content", [b"", b"[1]", b'{"a": 1}', b'{"a": "b"}', b"\xff"])
    def test_a_damaged_file_is_made_anew(self, package, content):
        first = self.in_a_new_process(package)
        (kept,) = (package / "__pycache__").iterdir()
        kept.write_bytes(content)
        assert self.in_a_new_process(package) == first
        assert len(kept.read_bytes()) > len(content)

    def test_a_folder_that_cannot_be_written_does_not_matter(self, package):
        (package / "__pycache__").write_text("a file in the way")
        assert self.in_a_new_process(package) == self.in_a_new_process(package)
