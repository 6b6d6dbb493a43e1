"""Pages for people without the simulator: a recording without truth, and what the doctor found.

Each page is one HTML file with its style and drawings inside. Needs the extra ``mvpose[recordings]``.
"""
