"""Mining rows that no single memory holds, on a cluster of Dask."""
