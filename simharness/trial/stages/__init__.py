"""The stages of a trial that make its detections and estimates; their code is part of a trial's identity."""
