"""`sitl sweep`: a study of many flights, described in a TOML file, flown by Dask's workers.

In: a study (`study`). Out: a Parquet `dataset` with a row for each flight, `verdicts`, and a `page`.
`draws` makes the flights from what varies; `worker` flies one of them, and never raises.
"""
