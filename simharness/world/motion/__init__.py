"""What people do: paths, gaits and gestures, turned into the joint angles of one body."""
