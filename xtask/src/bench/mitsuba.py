"""Serves renders of one scene by Mitsuba 3 and the processor time that they take.

Arguments: variant, scene file, width, height, max_depth. Each line of standard input is a number of samples; the reply is
the processor time of the process in seconds.
"""

import os
import sys
import time

# Native code writes to standard output as well, which must not be taken for a reply.
replies = os.fdopen(os.dup(1), "w")
os.dup2(2, 1)

import drjit as dr
import mitsuba as mi

variant, file = sys.argv[1:3]
width, height, max_depth = map(int, sys.argv[3:6])
mi.set_variant(variant)
mi.set_log_level(mi.LogLevel.Error)
# Roulette starts beyond the last edge, so it has no effect.
rr_depth = max_depth + 1
scene = mi.load_file(file, width=width, height=height, max_depth=max_depth, rr_depth=rr_depth, filter="box")
# After loading, which can wait for other threads of the pool for ever if there is only one.
dr.set_thread_count(1)


def reply(text):
    replies.write(text + "\n")
    replies.flush()


reply(mi.__version__)
for seed, line in enumerate(sys.stdin):
    start = time.process_time()
    dr.eval(mi.render(scene, spp=int(line), seed=seed))
    dr.sync_thread()
    reply(repr(time.process_time() - start))
