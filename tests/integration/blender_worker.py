"""Run scenarios inside Blender: one request per line of input, one reply per line of output.

A request names a scenario, its arguments and the .npz that takes what it returns. The answer is a
line that begins with ANSWER and holds the traceback, empty if there was none, as JSON.
"""

import json
import os
import sys
import traceback

import blender_scenarios
import bpy
import meshreel_blender
import numpy as np

ANSWER = "scenario answered: "


def run(name, arguments, result):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    results = getattr(blender_scenarios, name)(**arguments)
    np.savez(result, **results)


def main():
    meshreel_blender.register()
    for line in sys.stdin:
        failure = ""
        try:
            run(*json.loads(line))
        except BaseException:
            failure = traceback.format_exc()
        print(f"\n{ANSWER}{json.dumps(failure)}", flush=True)


if __name__ == "__main__":
    main()
    os._exit(0)  # the bpy module may crash when the interpreter exits
