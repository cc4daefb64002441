"""Subspaces of trajectories: principal components, projection and expansion."""
