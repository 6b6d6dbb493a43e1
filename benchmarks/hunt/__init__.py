"""Search for failures: trials at values of the keys of a scenario, and the failures found, shrunk and kept."""
