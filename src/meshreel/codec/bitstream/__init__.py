"""The container format: header, sections and their checksums, whatever they hold."""
