"""Pictures of meshes as arrays and PNG files, drawn by the CPU with NumPy and Pillow."""
