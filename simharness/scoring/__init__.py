"""Truth against estimates: body parts, people, pairs of detections, and the summary of them all."""
