"""The container format: header, sections and their checksums, independent of their contents."""
