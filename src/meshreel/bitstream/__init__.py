"""The container: header, sections and their checksums. It knows no mathematics."""
