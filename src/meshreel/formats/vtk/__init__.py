"""Files of VTK and ParaView: VTKHDF, XDMF, and VTK files in collections of their own."""
