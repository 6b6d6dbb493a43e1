"""Scene: room, objects and moving people in one MuJoCo model, and its playback."""
