"""What a flight shows on a terminal.

In: progress events and the summary. Out: a live table or lines, and the table at the end. Of this product it
imports nothing but the names of outcomes.
"""
