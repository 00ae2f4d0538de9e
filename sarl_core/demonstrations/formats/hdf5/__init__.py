"""HDF5: read with care, in the layouts in which demonstrations circulate."""
