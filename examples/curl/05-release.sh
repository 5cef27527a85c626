#!/usr/bin/env bash
# A release gate: 05-release.sh /v1/jobs/ID COVERAGE; ends with 0 only if the job is proved, nothing is left in its
# remainder and the coverage is high enough.
. "$(dirname "$0")/common.sh"
job=$(ask "$BASE$1")
python3 -c 'import json, sys
job, least = json.loads(sys.argv[1]), float(sys.argv[2])
summary = job["summary"] or {}
fits = job["state"] == "proved" and summary["complete"] and summary["coverage"] >= least
print(job["id"], job["state"], summary, "released" if fits else "not released")
sys.exit(0 if fits else 3)' "$job" "$2"
