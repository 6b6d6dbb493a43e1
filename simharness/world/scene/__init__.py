"""The scene: room, clutter and moving people in one MuJoCo model, and its playback."""
