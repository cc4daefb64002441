"""Faces and images as files have them: polygons, corners that are welded, types of images."""
