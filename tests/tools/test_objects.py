"""What ships as an object or as a picture of a finish, material, print or panorama can be made again."""

import cv2
import numpy as np
import pytest

from simharness.world.scene.objects.materials import MATERIALS
from simharness.world.scene.objects.object_files import ASSETS
from simharness.world.scene.rooms.landscape import PANORAMAS
from simharness.world.scene.rooms.tiled_textures import FINISHES
from tools.objects.__main__ import write_objects
from tools.objects.finishes import write_finishes
from tools.objects.landscape import write_panoramas
from tools.objects.prints import write_pictures


@pytest.mark.slow
def test_the_shipped_objects_are_those_that_the_tool_writes(tmp_path):
    write_objects(tmp_path)
    made, shipped = ({file.name: file.read_text() for file in folder.glob("*.xml")} for folder in (tmp_path, ASSETS))
    assert sorted(made) == sorted(shipped)
    assert [name for name in made if made[name] != shipped[name]] == []
    pictures = [{file.name for file in (folder / "textures").glob("*.png")} for folder in (tmp_path, ASSETS)]
    assert pictures[0] == pictures[1]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("write", "folder"), [(write_finishes, FINISHES), (write_pictures, MATERIALS), (write_panoramas, PANORAMAS)]
)
def test_the_shipped_pictures_are_those_that_the_tool_draws(tmp_path, write, folder):
    write(tmp_path)
    names = [sorted(file.name for file in each.iterdir()) for each in (tmp_path, folder)]
    assert names[0] == names[1]
    for name in names[0]:
        made, shipped = (cv2.imread(str(each / name)).astype(float) for each in (tmp_path, folder))
        assert np.abs(made - shipped).mean() < 2.0  # versions of the codec may differ
