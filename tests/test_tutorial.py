"""The tutorial notebook: all cells run in their order, from anywhere, and it is stored without outputs."""

import ast
import json
from pathlib import Path

import matplotlib as mpl
import pytest

NOTEBOOK = Path(__file__).parents[1] / "examples" / "tutorial.ipynb"


@pytest.fixture(scope="module")
def cells():
    return json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]


def run(source, names):
    """Run a cell; return the value of its last line, as a notebook shows it, or None where that is a statement."""
    *body, last = ast.parse(source).body
    exec(compile(ast.Module(body, []), "tutorial", "exec"), names)
    if isinstance(last, ast.Expr):
        return eval(compile(ast.Expression(last.value), "tutorial", "eval"), names)
    exec(compile(ast.Module([last], []), "tutorial", "exec"), names)
    return None


def test_it_is_stored_without_outputs(cells):
    code = [cell for cell in cells if cell["cell_type"] == "code"]
    assert len(code) >= 8
    assert all(cell["outputs"] == [] and cell["execution_count"] is None for cell in code)


@pytest.mark.slow
def test_all_cells_run(cells, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    mpl.use("agg")
    names, shown = {}, []
    for cell in cells:
        if cell["cell_type"] == "code":
            shown.append(run("".join(cell["source"]), names))
    assert "people" in shown[0]._repr_html_()
    assert shown[1][1:] == (17, 3)
    assert shown[2]["pcp"] > 90 > shown[2]["pcp"] - names["pcp"][2] > 0  # five cameras against two
    assert 50 < shown[4] <= 100
    assert list(names["pcp"]) == [2, 3, 4, 6]
    assert len(shown[-1]) > 0
    assert list(tmp_path.iterdir()) == []
