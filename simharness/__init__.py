"""Simulated people, cameras and 2D detectors with exact ground truth, and scores of the method under test."""

from mvpose.public_names import public_names

__getattr__, __dir__, __all__ = public_names(__name__, __file__)
