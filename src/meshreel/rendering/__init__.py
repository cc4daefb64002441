"""Pictures of meshes as arrays and PNG files, drawn by the CPU with NumPy and Pillow.

Modules that write text or files import Pillow, the extra [render]; the others need only NumPy.
"""
