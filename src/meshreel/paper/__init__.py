"""The paper's seven variants: subspaces, quantisation, solver, and their blocks in a stream."""
