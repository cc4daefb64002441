"""Results of solvers: d3plot of LS-DYNA and EnSight Gold."""
