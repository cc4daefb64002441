"""Reports in words, tables and pictures: their parts, and the page they become."""
