"""Objects: geometry for physics, meshes for pictures, and drawing of each kind."""
