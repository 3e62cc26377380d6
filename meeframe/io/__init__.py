"""Reading and writing of results: HDF5 and, for ParaView, VTK through meshio."""
