"""Dynamic playback: plans carried out by actuators under gravity and contact."""
