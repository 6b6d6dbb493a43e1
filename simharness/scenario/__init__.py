"""Scenario files: their keys, and how a file is read, checked, resolved and written.

From the file to the study: :mod:`.toml_files` reads TOML, :mod:`.document` joins a file with its bases and the command
line, :mod:`.presets` puts rigs, sensor and detector profiles under it, :mod:`.sweep` reads [sweep] and [cases],
:mod:`.resolution` validates the result against the models of :mod:`.sections`, and :mod:`.study_definition` and
:mod:`.load` return a study or a single scenario.
"""
