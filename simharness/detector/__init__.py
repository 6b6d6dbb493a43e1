"""The simulated 2D detector: from the truth in the pictures to noisy detections, and the truth about those."""
