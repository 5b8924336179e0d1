"""The generated part of the documentation.

In: the command line's parser, the schemas, the message tables, docstrings. Out: docs/reference/*.md, written
by `python -m sitl.reference_pages docs/reference`. A test compares the files with what this would write.
"""
