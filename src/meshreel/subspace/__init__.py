"""Eigen-trajectories of a matrix of frames: how to find them, project on them and come back."""
