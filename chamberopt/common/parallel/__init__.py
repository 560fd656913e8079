"""Executors that run replicas and candidates: threads, processes, a Dask cluster."""
