"""What one person does alone: gaits, gestures, and all that is done on a spot."""
