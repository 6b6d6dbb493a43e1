"""One-to-one pairs of true and estimated people of a frame."""
