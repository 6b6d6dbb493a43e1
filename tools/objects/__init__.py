"""Making of the objects that simharness ships: ``python -m tools.objects simharness/assets/objects``.

    builders of office, home, gym, ... -> parts (boxes, bars, meshes, prints) -> one MJCF file per variant, and textures

The files are read by :mod:`simharness.world.scene.objects.object_files`, as those of users are.
"""
