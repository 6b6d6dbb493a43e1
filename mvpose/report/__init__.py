"""Page kit of both packages, and the pages of a recording without truth and of the doctor.

Each page is one HTML file with its style and drawings inside. Needs the extra ``mvpose[recordings]``.
"""
