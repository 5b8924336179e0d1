"""Files that clients may read: packed parameters, component metadata, the flight's logs.

In come requests of FTP and LOG_*, out go answers, paced; contents come from objects of the station.
Paths are looked up in a table, never in a file system. Imports parameters and peers, no sockets, no clock.
"""
