"""Renderers: cameras and meshes in, colour, depth and ids of every pixel out."""
