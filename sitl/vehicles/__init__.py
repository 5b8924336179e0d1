"""A vehicle of one's own: `sitl vehicle new`, `check` and `list`.

In: a few figures of a data sheet (`Sketch`), or a description. Out: a commented TOML, or what follows from
it.
`sketch` and `figures` are pure; `check` flies a step in process. May import `sitl.flights`, `controller`,
`sitl_bridge`.
"""
