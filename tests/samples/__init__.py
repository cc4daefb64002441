"""Small meshes, files, commands and stand-ins that tests of several rooms share; no tests."""
