"""Rigs of cameras: layouts to watch a room with."""
