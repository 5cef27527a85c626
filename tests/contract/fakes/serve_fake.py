"""Serve with the fake chain in a process of its own: ``python serve_fake.py DATA MAX_ATTEMPTS``; prints the URL.

With a third argument, a port, it serves in the foreground, as ``zonemill serve`` does; a fourth names another chain.
"""

import os
import sys
import threading

from service.api.server import background, run_server, settings_with
from service.logs import configure

configure("warning", "console")
port = int(sys.argv[3]) if len(sys.argv) > 3 else 0
settings = settings_with({"data_dir": sys.argv[1], "port": port, "poll_s": 0.05,
                          "workers": int(os.environ.get("ZONEMILL_WORKERS", "1")), "max_attempts": int(sys.argv[2])})
if port:
    print(f"http://127.0.0.1:{port}", flush=True)
    run_server(settings, sys.argv[4] if len(sys.argv) > 4 else "fake_chain")
    sys.exit()
with background(settings, "fake_chain") as url:
    print(url, flush=True)
    threading.Event().wait()
