"""Planning of a rig before its cameras hang: what a set of cameras will make of the people in a volume."""

from simharness.planning.camera_terms import CameraTerms
from simharness.planning.fast_layer import FastLayer, Prediction, Reconstruction
from simharness.types.floor import Volume
from simharness.world.scene.objects.geoms import Box

__all__ = ["Box", "CameraTerms", "FastLayer", "Prediction", "Reconstruction", "Volume"]
