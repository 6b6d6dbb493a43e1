"""Gallery of rendered pictures, and sheets that compare two versions of the code."""
