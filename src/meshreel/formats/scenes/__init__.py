"""Files with several meshes: select one, merge them into one mesh of parts, or split it again."""
