"""What a flight leaves behind: its figures, how it ended, summary, picture, interactive page.

In: a flight's logs, its reference and its description. Out: files in the flight's folder. `metrics`,
`estimate_metrics`, `sensing_error` and `outcome` are pure functions of the logs. `summary` and `keep` write
the files, `html_report` and `page` the interactive one.
"""
