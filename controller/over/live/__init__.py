"""Points live: the load as a MAVLink system of its own, which ground stations and scripts move.

`reference` turns a target into a motion that the law follows; `load_system` is the protocol object. In:
SET_POSITION_TARGET_LOCAL_NED and DO_REPOSITION. Out: HEARTBEAT, positions, acknowledgements, texts.
"""
