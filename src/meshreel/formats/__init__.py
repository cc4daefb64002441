"""Files of other programs to a `MeshSequence` and back.

load, save, inspection, stretches   what the library and the command line call
sources, outputs                    the files that an input or an output means
registry, kinds                     a row for each format, which names functions that are imported
                                    when they are needed
options, supported_options          options of reading and writing, and where they have an effect
notes, file_errors, named_files     sentences for the user, errors with the name of a file, and the
                                    files that a file names
extras                              libraries that come with an extra of the package
frames, scenes, surfaces            parts of readers and writers that several formats share, as are
hdf, text                           HDF5 files, and words and numbers in text

Every other folder is a format or a family of formats. It is reached through the registry only, and
imports no other one: a new format is a folder, and a row of the registry.
"""
