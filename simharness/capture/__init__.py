"""Simulated cameras: pictures, visibility of joints, boxes of people."""
