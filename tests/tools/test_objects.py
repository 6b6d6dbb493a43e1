"""What ships as an object can be made again."""

from simharness.world.scene.objects.object_files import ASSETS
from tools.objects.__main__ import write_objects


def test_the_shipped_objects_are_those_that_the_tool_writes(tmp_path):
    write_objects(tmp_path)
    made, shipped = ({file.name: file.read_text() for file in folder.glob("*.xml")} for folder in (tmp_path, ASSETS))
    assert sorted(made) == sorted(shipped)
    assert [name for name in made if made[name] != shipped[name]] == []
    pictures = [{file.name for file in (folder / "textures").glob("*.png")} for folder in (tmp_path, ASSETS)]
    assert pictures[0] == pictures[1]
