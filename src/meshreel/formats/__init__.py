"""Import and export of sequences in the formats of other programs.

load, save, inspection, segments      entry points for the library and the command line
sources, outputs                       resolve an input or output to its files
registry, kinds                        a row for each format, with lazily imported functions
options, supported_options             read and write options, and the formats that support them
file_errors, file_references           errors that name a file, and references between files
needed_extras                          the extras of the package that files need
frames, scenes, surfaces, hdf, text    code that the readers and writers of several formats share

Every other folder is a format or a family of formats. It is imported through the registry only, and
does not import other formats: a new format is a folder and a row of the registry.
"""
