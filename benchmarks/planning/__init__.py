"""Planning held against simulation, and against the subsets of the cameras of a real recording."""
