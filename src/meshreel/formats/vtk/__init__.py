"""VTK and ParaView formats: legacy and XML VTK files, PVD collections, VTKHDF and XDMF."""
