"""Subspaces of trajectories: eigen-trajectories of a matrix of frames, projection, expansion."""
