#!/usr/bin/env bash
# Follow a job to its end: 03-follow.sh /v1/jobs/ID; prints its state.
. "$(dirname "$0")/common.sh"
call --no-buffer "$BASE$1/events" >&2
answer=$(ask "$BASE$1")
json .state <<<"$answer"
