"""Rigs of cameras: layouts, published rigs and calibration files, and what goes wrong with them."""
