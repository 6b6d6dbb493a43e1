"""Scenario files: their keys, and how a file is read, checked and written.

From the file to the study, one module after the other: :mod:`.toml_files` reads TOML, :mod:`.document` joins a file
with its bases and the command line, :mod:`.sweep` takes out sweep, cases and seeds and makes the keys of each setting,
:mod:`.presets` puts rigs, sensor and detector profiles under them, :mod:`.checks` validates the result against the
models of :mod:`.sections`, and :mod:`.load` returns a study or a single scenario.
"""
