"""Renderers: colour, depth and mesh ids of every pixel from cameras and meshes."""
