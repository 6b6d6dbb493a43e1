"""Coverage of the ellipsoids of estimates, by variant, joint and number of views."""
