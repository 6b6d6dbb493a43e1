"""The sections of a scenario: frozen models, every key documented, unknown keys refused."""
