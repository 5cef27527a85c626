"""Serve with the fake chain in a process of its own: ``python serve_fake.py DATA MAX_ATTEMPTS``; prints the URL."""

import sys
import threading

from service.logs import configure
from service.server import background, settings_with

configure("warning", "console")
with background(settings_with({"data_dir": sys.argv[1], "port": 0, "poll_s": 0.05, "workers": 1,
                               "max_attempts": int(sys.argv[2])}), "fake_chain") as url:
    print(url, flush=True)
    threading.Event().wait()
