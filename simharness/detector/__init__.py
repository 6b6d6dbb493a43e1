"""Simulated 2D detector: ground truth in pictures to noisy detections, with the truth about each detection."""
