"""Planning of a rig before its cameras hang: what a set of cameras will make of the people in a volume."""

from simharness.planning.camera_terms import CameraTerms
from simharness.planning.fast_layer import FastLayer, Figure, Prediction
from simharness.planning.reconstruction import Reconstruction
from simharness.planning.visibility import Obstacle
from simharness.planning.volume import Volume

__all__ = ["CameraTerms", "FastLayer", "Figure", "Obstacle", "Prediction", "Reconstruction", "Volume"]
