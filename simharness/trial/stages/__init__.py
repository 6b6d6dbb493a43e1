"""Stages of a trial that make its detections and estimates; their code is part of the identity of a trial."""
