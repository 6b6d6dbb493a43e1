"""``mvpose view``: the page of a folder of results."""

import webbrowser

from typer.testing import CliRunner

from mvpose.cli.app import app


def test_the_page_is_named_and_opened(tmp_path, monkeypatch):
    opened = []
    monkeypatch.setattr(webbrowser, "open", opened.append)
    (tmp_path / "recording.html").write_text("")
    result = CliRunner().invoke(app, ["view", str(tmp_path)])
    assert result.exit_code == 0
    assert result.stdout.strip() == str(tmp_path / "recording.html")
    assert opened == [(tmp_path / "recording.html").as_uri()]
    assert CliRunner().invoke(app, ["view", str(tmp_path), "--no-browser"]).exit_code == 0
    assert len(opened) == 1


def test_a_folder_without_a_page(tmp_path):
    result = CliRunner().invoke(app, ["view", str(tmp_path)])
    assert result.exit_code == 2
    assert "has no recording.html; expected a folder that `mvpose estimate ... --out` made" in result.stderr
