"""Leaderboard: methods of others beside those of mvpose, on the same detections."""
