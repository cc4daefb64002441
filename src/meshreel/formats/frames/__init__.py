"""Frames one after the other: from a file each, kept in files until asked for, or to a writer."""
