#!/usr/bin/env bash
# Prove a program: 09-verify.sh PART.step SETUP.json PROGRAM; prints the report, and the state on stderr. It ends with 0
# only if the state is proved, with 3 if it is clean (no harm, but work is left undone), unproved or any other.
. "$(dirname "$0")/common.sh"
answer=$(ask -F "part=@$1" -F "setup=@$2;type=application/json" -F "program=@$3" -F deadline_s=3600 \
         "$BASE/v1/verifications")
job=$(json .links.self <<<"$answer")
call --no-buffer "$BASE$job/events" >/dev/null
call "$BASE$job/report"
answer=$(ask "$BASE$job")
state=$(json .state <<<"$answer")
echo "$state" >&2
[ "$state" = proved ] || exit 3
