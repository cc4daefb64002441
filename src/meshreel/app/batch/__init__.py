"""Batch encoding of many sequences, recorded in a manifest."""
