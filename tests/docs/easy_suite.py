"""A suite that replaces the shipped suite `ci` in tests of what the pages say about the gate."""

from __future__ import annotations

import json

from doc_pages import ROOT

# The shipped suite takes minutes; nothing here is hard for the method.
EASY = f"""
extends = {json.dumps(str(ROOT / "scenarios" / "quickstart.toml"))}
name = "easy"
seeds = 6          # the fewest that the gate accepts
variants = ["fast"]
duration = 0.4
rate = 5.0
rendering.renderer = "rays"
people.count = 2
detector.profile = "perfect"
gate.slowdown = 4.0    # other tests run beside it

[clutter]
boxes = 0
shelves = 0
"""
