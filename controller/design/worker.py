"""The process that `redesign` starts: a vehicle and a rate first, then weights, a line each; designs out."""

from __future__ import annotations

import json
import os
import sys


def main() -> None:
    """Answer each line of weights with a byte, 1 and two records of `law.DESIGN`, or 0 if there are none."""
    os.nice(10)
    about = json.loads(sys.stdin.readline())
    for line in sys.stdin:
        # Not before the first question: a flight whose weights stay pays nothing for this process.
        from controller.design.catalogue import Emphasis, guided_designs, on_cable
        from sitl_bridge.vehicle.description import Vehicle

        asked = json.loads(line)
        vehicle = on_cable(Vehicle.model_validate_json(about["vehicle"]), asked["rest_length"])
        try:
            loaded, alone = guided_designs(vehicle, about["rate_hz"], Emphasis(*asked["emphasis"]))
            answer = b"\x01" + loaded.tobytes() + alone.tobytes()
        except (ValueError, ArithmeticError):  # LinAlgError is a ValueError: no solution for these weights
            answer = b"\x00"
        sys.stdout.buffer.write(answer)
        sys.stdout.buffer.flush()


if __name__ == "__main__":
    main()
