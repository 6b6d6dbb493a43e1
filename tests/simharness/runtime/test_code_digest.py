"""Digests of code change with what it does, not with its documentation."""

from simharness.runtime.code_digest import digest_of_folders

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
