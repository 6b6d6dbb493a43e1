"""TRC files in OpenSim itself, where it is installed (`pip install opensim`), and as Pose2Sim reads them, by pandas."""

import numpy as np
import pytest

from mvpose import COCO17
from mvpose.formats.people import Options, write_people
from mvpose.recording import People

FRAMES = range(3, 9)  # in which the person is there


@pytest.fixture
def people():
    joints = np.random.default_rng(1).uniform(-3, 3, (12, 1, 17, 3))
    joints[: FRAMES.start] = joints[FRAMES.stop :] = np.nan
    joints[4, 0, -1] = joints[5, 0, 0] = joints[6] = np.nan  # the last cell, the first, all of them
    return People(np.arange(12) / 50, [7], joints, np.ones((12, 1, 17)))


@pytest.mark.parametrize("unit", ["m", "mm"])
def test_opensim_reads_markers_times_units_and_gaps(people, tmp_path, unit, monkeypatch):
    monkeypatch.chdir(tmp_path)  # where OpenSim writes its log
    opensim = pytest.importorskip("opensim", reason="OpenSim is not installed")
    write_people(people, tmp_path, formats=["trc"], options=Options(units=unit))
    file = str(tmp_path / "person_7.trc")
    table = opensim.TimeSeriesTableVec3(file)
    assert table.getNumRows() == len(FRAMES)
    assert table.getColumnLabels()[5:7] == ("LShoulder", "RShoulder")
    assert table.getTableMetaDataString("Units") == unit
    np.testing.assert_allclose(table.getIndependentColumn(), people.times[FRAMES], atol=1e-6)
    rows = [table.getRowAtIndex(k) for k in range(len(FRAMES))]
    found = np.array([[[row.getElt(0, j)[axis] for axis in range(3)] for j in range(len(COCO17))] for row in rows])
    wanted = people.joints[FRAMES, 0][..., [1, 2, 0]]  # y up
    np.testing.assert_allclose(found / {"m": 1, "mm": 1000}[unit], wanted, atol=1e-6)  # NaN where NaN
    markers = opensim.MarkerData(file)
    assert (markers.getDataRate(), markers.getNumMarkers()) == (50.0, 17)
    assert markers.getUnits().getAbbreviation() == unit


def test_pose2sim_reads_them_by_pandas(people, tmp_path):
    """The lines of its function `read_trc`."""
    pandas = pytest.importorskip("pandas")
    write_people(people, tmp_path, formats=["trc"])
    file = tmp_path / "person_7.trc"
    labels = [label.strip() for label in file.read_text().split("\n")[3].split("\t")[2::3] if label.strip()]
    table = pandas.read_csv(file, sep="\t", skiprows=4, encoding="utf-8")
    frames, times = table.iloc[:, 0], table.iloc[:, 1]
    values = table.drop(table.columns[[0, 1]], axis=1)
    values = values.loc[:, ~values.columns.str.startswith("Unnamed")]
    assert (len(labels), labels[0], labels[-1]) == (17, "Nose", "RAnkle")
    assert frames.tolist() == [frame + 1 for frame in FRAMES]
    np.testing.assert_allclose(times, people.times[FRAMES], atol=1e-6)
    wanted = people.joints[FRAMES, 0][..., [1, 2, 0]]
    np.testing.assert_allclose(values.to_numpy().reshape(len(FRAMES), 17, 3), wanted, atol=1e-6)
