"""Planning held against simulation, against subsets of the cameras of a real recording, and beside other plans."""
